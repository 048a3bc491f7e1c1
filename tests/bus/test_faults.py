"""Faults on demand: what may be said of them, and what they do on either bus, in virtual time."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.bus.hub.faults import Faults
from rds.bus.medium.bits import frame_time
from rds.bus.medium.fault_file import read_faults
from rds.bus.medium.fault_kinds import KINDS, Fault
from rds.bus.medium.medium import FaultRefused, Medium
from rds.core.errors import InputError

from .wires import MBIT, SECOND, Hand, bus, drain, heard, identifier_of, record, untimed

# --- words


@pytest.mark.parametrize(
    "words, reason",
    [
        ({"kind": "corupt"}, "did you mean 'corrupt'"),
        ({"kind": "die"}, "'die' needs 'node'"),
        ({"kind": "die", "node": "X", "for": 1.0}, "nothing to do with 'for'"),
        ({"kind": "delay"}, "needs 'by'"),
        ({"kind": "lose", "count": 0}, "count = 0 must be"),
        ({"kind": "corrupt", "bit": 12}, "bit = 12 must be a whole number from 13"),
        ({"kind": "lose", "count": True}, "count = True"),
        ({"kind": "lose", "at": -1.0}, r"at = -1.0 must be from 0 to 1e.06 s"),
        ({"kind": "unplug", "node": "X", "for": 0}, "for = 0 must be more than 0"),
        ({"kind": "lose", "probability": 0.5, "count": 3}, "needs a seed"),
        ({"kind": "lose", "probability": 0.5, "seed": 1}, "needs 'count' or 'for'"),
        ({"kind": "lose", "seed": 1}, "without a probability"),
        ({"kind": "lose", "nod": "X"}, "did you mean 'node'"),
        ({"kind": "lose", "node": 3}, "node = 3 must be a text in quotes"),
        ({"node": "X"}, "needs a kind"),
        ({"kind": "lose", "at": float("nan")}, "at = nan"),
        ({"kind": "lose", "at": 1e300}, "at = 1e.300 must be from 0 to 1e.06 s"),
        (
            {"kind": "lose", "identifier": 1 << 29},
            "identifier = 0x20000000 must be a whole number from 0 to 0x1fffffff",
        ),
        ({"kind": "lose", "count": 10**10}, "from 1 to 1000000000"),
    ],
)
def test_what_cannot_be_is_refused_with_the_reason(words: dict[str, Any], reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        Fault.from_table(words)


def test_a_schedule_is_read_in_the_order_of_its_times(tmp_path: Path) -> None:
    file = tmp_path / "faults.toml"
    late = '[[fault]]\nat = 2.0\nnode = "Y"\nkind = "unplug"\nfor = 1.0\n'
    file.write_text(late + '[[fault]]\nat = 0.5\nkind = "corrupt"\ncount = 3\n')
    assert read_faults(file) == (Fault("corrupt", at=0.5, count=3), Fault("unplug", "Y", 2.0, 1.0))


@pytest.mark.parametrize(
    "text, place, reason",
    [
        ('[[fault]]\nkind = "lose"\n\n[[fault]]\nat = 1.0\nkind = "unplugg"\n', "line 6", "did you mean 'unplug'"),
        ('[[fault]]\nkind = "lose"\nat = 1\nnoed = "X"\n', "line 4", "did you mean 'node'"),
        ('[[fault]]\nkind = "lose"\ncount = -1\n', "line 3", "count = -1"),
        ('[[fault]]\nnode = "X"\n', "line 1", "needs a kind: lose, corrupt"),
        ("[[fault]\n", "faults.toml", "not valid TOML"),
        ("", "faults.toml", r"no \[\[fault\]\] tables"),
        ("[fault]\nkind = 'lose'\n", "faults.toml", r"no \[\[fault\]\] tables"),
        ("[[faults]]\nkind = 'lose'\n", "faults.toml", "unknown key 'faults'"),
    ],
)
def test_a_bad_schedule_names_file_and_line(tmp_path: Path, text: str, place: str, reason: str) -> None:
    file = tmp_path / "faults.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=reason) as caught:
        read_faults(file)
    assert "faults.toml" in str(caught.value) and place in str(caught.value)
    with pytest.raises(InputError, match="cannot be read"):
        read_faults(tmp_path / "missing.toml")


@given(st.sampled_from(sorted(KINDS)), st.floats(0, 100), st.booleans())
def test_a_fault_survives_its_table(kind: str, at: float, named: bool) -> None:
    words: dict[str, Any] = {"kind": kind, "at": at}
    if named or "node" in KINDS[kind].needed:
        words["node"] = "X"
    if kind == "delay":
        words["by"] = 0.5
    fault = Fault.from_table(words)
    assert Fault.from_table(fault.to_table()) == fault


# --- frames


def test_lost_frames_reach_nobody(medium: Medium[str]) -> None:
    hand = Hand(medium)
    hand.inject("lose", node="A", count=2)
    for identifier in (1, 2, 3):
        medium.offer("A", record(identifier), 0)
    medium.offer("B", record(4), 0)
    assert heard(medium, SECOND) == [(1, ""), (2, ""), (3, "BC"), (4, "AC")]
    assert medium.stations["C"].lost == 2


def test_one_receiver_may_lose_a_frame(medium: Medium[str]) -> None:
    Hand(medium).inject("lose", identifier=2, receiver="C")
    for identifier in (1, 2, 2):
        medium.offer("A", record(identifier), 0)
    assert heard(medium, SECOND) == [(1, "BC"), (2, "B"), (2, "BC")]


def test_a_lost_frame_takes_its_time() -> None:
    medium = bus()
    Hand(medium).inject("lose")
    for identifier in (1, 2):
        medium.offer("A", record(identifier), 0)
    first, second = drain(medium, SECOND)
    assert second.at - first.at == 3000 + frame_time(2, bitrate=MBIT)


def test_duplicated_frames_come_twice(medium: Medium[str]) -> None:
    Hand(medium).inject("duplicate", node="A")
    medium.offer("A", record(1), 0)
    medium.offer("A", record(2), 0)
    assert heard(medium, SECOND) == [(1, "BC"), (1, "BC"), (2, "BC")]


def test_on_the_wire_a_duplicate_is_an_error_in_the_last_bit() -> None:
    medium = bus()
    Hand(medium).inject("duplicate")
    medium.offer("A", record(1), 0)
    first, second = drain(medium, SECOND)
    whole = frame_time(1, bitrate=MBIT)
    assert (first.at, second.at - first.at) == (whole, 14_000 + 3000 + whole)
    assert medium.stations["A"].counters.tec == 7 and medium.errors == 1


def test_a_frame_that_is_lost_twice_is_counted_once(medium: Medium[str]) -> None:
    hand = Hand(medium)
    hand.inject("hang", node="B", duration=1.0)
    hand.inject("lose")
    medium.offer("A", record(1), 0)
    assert heard(medium, SECOND // 2) == [(1, "")]
    assert [medium.stations[name].lost for name in "ABC"] == [0, 1, 1]


@pytest.mark.parametrize("end", ["die", "leave"])
def test_a_delayed_frame_goes_with_its_sender(medium: Medium[str], end: str) -> None:
    Hand(medium).inject("delay", by=0.25)
    medium.offer("A", record(1), 0)
    getattr(medium, end)("A", SECOND // 8)
    assert heard(medium, SECOND) == []


def test_delayed_frames_come_later_and_others_pass(medium: Medium[str]) -> None:
    Hand(medium).inject("delay", by=0.25, identifier=1)
    medium.offer("A", record(1), 0)
    medium.offer("A", record(2), 0)
    assert heard(medium, SECOND // 8) == [(2, "BC")]
    assert medium.due() == SECOND // 4
    assert heard(medium, SECOND) == [(1, "BC")]


def test_faults_by_chance_come_again_with_their_seed(medium: Medium[str]) -> None:
    def struck(seed: int) -> list[int]:
        Hand(medium).inject("lose", probability=0.3, seed=seed, count=1000)
        for number in range(100):
            medium.offer("A", record(number), 0)
            heard_now = heard(medium, SECOND)
            if heard_now[0][1] == "":
                found.append(number)
        medium.frame_faults.disarm()
        return found

    found: list[int] = []
    first = list(struck(1))
    found = []
    assert struck(1) == first and 15 < len(first) < 45
    found = []
    assert struck(2) != first


def test_a_fault_with_a_time_strikes_while_it_lasts(medium: Medium[str]) -> None:
    Hand(medium).inject("lose", at=1.0, duration=1.0)
    seen = []
    for k in range(30):
        medium.offer("A", record(k), k * SECOND // 10)
        seen += heard(medium, k * SECOND // 10 + SECOND // 20)
    assert [identifier for identifier, getters in seen if not getters] == list(range(10, 20))


# --- nodes


def test_an_unplugged_node_hears_nothing_and_what_it_sends_waits(medium: Medium[str]) -> None:
    hand = Hand(medium)
    hand.inject("unplug", node="B", duration=1.0)
    medium.offer("A", record(2), 0)
    medium.offer("B", record(1), 0)  # it would win, but takes no part
    assert heard(medium, SECOND // 2) == [(2, "C")]
    assert heard(medium, 2 * SECOND) == [(1, "AC")]
    medium.offer("A", record(3), 2 * SECOND)
    assert heard(medium, 3 * SECOND) == [(3, "BC")]


def test_an_unplugged_node_goes_error_passive_and_no_further() -> None:
    medium = bus()
    medium.unplug("B", 0)
    medium.offer("B", record(2), 0)
    attempt = frame_time(2, bitrate=MBIT) + (-8 + 14 + 3) * 1000  # to the ACK slot, an error frame, intermission
    drain(medium, 7 * attempt // 2)
    assert medium.stations["B"].counters.tec == 24
    drain(medium, SECOND)
    assert medium.stations["B"].counters.tec == 128 and medium.stations["A"].counters.rec == 0
    assert medium.stations["B"].errors == 16, "more attempts would change nothing"
    medium.plug("B", SECOND)
    (delivery,) = drain(medium, 2 * SECOND)
    assert delivery.at == SECOND + 11_000 + frame_time(2, bitrate=MBIT), "it listens for eleven bits first"


def test_a_plug_pulled_while_sending_is_an_error_for_the_others() -> None:
    medium = bus()
    medium.offer("A", record(1, bytes(8)), 0)
    medium.take(50_000)
    medium.unplug("A", 50_000)
    medium.offer("B", record(2), 50_000)
    broken = (6 + 6 + 8 + 3) * 1000  # the sixth equal bit is the error, then come flag, delimiter, intermission
    assert medium.take(50_000 + broken) is None
    assert [medium.stations[name].counters.rec for name in "BC"] == [1, 1]
    (delivery,) = drain(medium, SECOND)
    assert delivery.at == 50_000 + broken + frame_time(2, bitrate=MBIT)
    medium.plug("A", SECOND)
    assert [identifier_of(delivery) for delivery in drain(medium, 2 * SECOND)] == [1]


@pytest.mark.parametrize("senders", ["AB", "B"])
def test_a_plug_pulled_while_another_sends_a_frame_or_the_same_disturbs_nobody(senders: str) -> None:
    medium = bus()
    for name in senders:
        medium.offer(name, record(1, bytes(8)), 0)
    medium.take(50_000)
    medium.unplug("A", 50_000)
    (delivery,) = drain(medium, SECOND)
    assert (delivery.at, medium.errors) == (frame_time(1, bytes(8), bitrate=MBIT), 0)


def test_a_dead_node_says_no_more(medium: Medium[str]) -> None:
    hand = Hand(medium)
    medium.offer("A", record(1), 0)
    assert heard(medium, SECOND) == [(1, "BC")]
    hand.inject("die", SECOND, node="A")
    medium.offer("A", record(2), SECOND)
    medium.offer("B", record(3), SECOND)
    assert heard(medium, 2 * SECOND) == [(3, "C")]
    hand.injector.withdraw(None, 2 * SECOND)
    medium.offer("A", record(2), 2 * SECOND)
    assert heard(medium, 3 * SECOND) == [], "dead is dead"


def test_a_hanging_node_comes_back(medium: Medium[str]) -> None:
    Hand(medium).inject("hang", node="B", duration=0.5)
    medium.offer("A", record(1), 0)
    medium.offer("B", record(2), 0)
    assert heard(medium, SECOND // 4) == [(1, "C")]
    drain(medium, SECOND)
    medium.offer("B", record(3), SECOND)
    medium.offer("A", record(4), SECOND)
    assert heard(medium, 2 * SECOND) == [(3, "AC"), (4, "BC")]


def test_a_hanging_controller_still_acknowledges() -> None:
    medium = bus("A", "B")
    medium.hang("B", 0)
    medium.offer("A", record(1), 0)
    assert len(drain(medium, SECOND)) == 1 and medium.errors == 0


def test_a_babbling_node_takes_the_whole_bus() -> None:
    medium = bus()
    hand = Hand(medium)
    hand.inject("babble", node="A", duration=0.01)
    medium.offer("B", record(5), 1000)
    seen = [(identifier_of(delivery), delivery.at) for delivery in drain(medium, SECOND)]
    each = frame_time(0, bytes(8), bitrate=MBIT, interframe=True)
    assert [identifier for identifier, _ in seen] == [0] * (len(seen) - 1) + [5]
    assert len(seen) - 1 == -(-10_000_000 // each)
    assert all(after - before == each for (_, before), (_, after) in pairwise(seen[:-1]))


def test_a_babbling_node_leaves_what_is_above_it() -> None:
    medium = bus()
    Hand(medium).inject("babble", node="A", identifier=0x100, duration=0.01)
    medium.offer("B", record(5), 1000)
    assert [identifier_of(delivery) for delivery in drain(medium, SECOND)][1] == 5


@pytest.mark.parametrize("kind", ["corrupt", "babble", "restart"])
def test_what_needs_bits_is_refused_without_them(kind: str) -> None:
    with pytest.raises(FaultRefused, match=f"{kind}.*bit timing"):
        Hand(untimed()).inject(kind, node="A", at=5.0)


# --- the injector


@pytest.mark.parametrize("schedule", ["abc", [{"kind": "unplug"}], [None]])
def test_what_is_no_fault_is_refused(schedule: Any, open_bus: Callable[..., Any]) -> None:
    open_bus("test")
    with Faults("test") as faults, pytest.raises(InputError, match=r"is no fault: play\(\) takes Fault objects"):
        faults.play(schedule)


# --- the document

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "bus-timing.md"


def test_the_document_names_every_kind_and_word(tmp_path: Path) -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+)` \|(.*)$", text, re.MULTILINE))
    for name, kind in KINDS.items():
        assert name in rows, f"{name} is not in {DOCUMENT.name}"
        assert ("| no" in rows[name]) == kind.needs_bits
        for word in kind.words:
            assert f"`{word}`" in rows[name] or "the same" in rows[name], f"{name} takes {word}"
    (schedule,) = re.findall(r"```toml file=faults.toml\n(.*?)```", text, re.DOTALL)
    (tmp_path / "faults.toml").write_text(schedule)
    assert [fault.kind for fault in read_faults(tmp_path / "faults.toml")] == ["corrupt", "unplug", "lose"]
