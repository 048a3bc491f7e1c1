"""Faults at their time, and their end: by their owner, by a clear, by themselves, in virtual time."""

from __future__ import annotations

import pytest

from rds.bus.medium.bits import frame_time
from rds.bus.medium.fault_kinds import Fault
from rds.bus.medium.medium import FaultRefused, Medium, UntimedMedium

from .wires import MBIT, SECOND, Hand, bus, drain, heard, record


def test_an_unknown_node_is_refused_at_once_and_noted_later(medium: Medium[str]) -> None:
    hand = Hand(medium)
    with pytest.raises(FaultRefused, match=r"no node is called 'Q'; on the bus: A, B, C"):
        hand.inject("unplug", node="Q")
    with pytest.raises(FaultRefused, match="'Q'"):
        hand.injector.inject([Fault("hang", "A"), Fault("lose", receiver="Q")], 0)
    assert not medium.stations["A"].hung, "then none is injected"
    hand.inject("unplug", node="Q", at=1.0)
    hand.inject("lose", node="Q", at=1.5)
    medium.take(2 * SECOND)
    assert len(hand.notes) == 2 and all("'Q'" in note for note in hand.notes)
    with pytest.raises(FaultRefused, match="on the bus: nobody"):
        Hand(UntimedMedium()).inject("die", node="A")


def test_a_controller_that_is_not_bus_off_is_not_restarted() -> None:
    with pytest.raises(FaultRefused, match="B is error active, not bus off"):
        Hand(bus()).inject("restart", node="B")


def test_what_has_an_owner_ends_with_it(medium: Medium[str]) -> None:
    hand, owner = Hand(medium), object()
    hand.inject("unplug", node="B", owner=owner)
    hand.inject("lose", node="A", count=10, owner=owner)
    hand.inject("hang", node="C", at=5.0, owner=owner)
    hand.inject("hang", node="C", duration=0.5)
    medium.offer("A", record(1), 0)
    assert heard(medium, SECOND) == [(1, "")]
    hand.injector.withdraw(owner, SECOND)
    medium.offer("A", record(2), SECOND)
    assert heard(medium, 2 * SECOND) == [(2, "BC")]
    medium.take(10 * SECOND)
    assert not medium.stations["C"].hung


def test_an_owner_ends_its_own_faults_and_clear_those_of_all(medium: Medium[str]) -> None:
    hand, one, other = Hand(medium), object(), object()
    hand.inject("unplug", node="A", owner=one)
    hand.inject("unplug", node="B", owner=other)
    hand.inject("hang", node="C", at=1.0, owner=other)
    hand.injector.withdraw(one, 0)
    medium.take(2 * SECOND)
    a, b, c = (medium.stations[name] for name in "ABC")
    assert a.plugged and not b.plugged and c.hung
    hand.inject("hang", now=2 * SECOND, node="A", at=1.0)
    hand.inject("hang", now=2 * SECOND, node="B", at=1.0, owner=other)
    hand.injector.withdraw(None, 2 * SECOND)
    assert b.plugged and not c.hung
    medium.take(4 * SECOND)
    assert not a.hung and not b.hung, "what is still to come is ended, too"


def test_faults_of_frames_end_with_their_owner_or_with_those_of_all(medium: Medium[str]) -> None:
    hand, one, other = Hand(medium), object(), object()
    for identifier, owner in ((1, one), (2, other), (3, None)):
        hand.inject("lose", identifier=identifier, count=10, owner=owner)
    for now, owner, expected in ((0, one, ["BC", "", ""]), (SECOND, None, ["BC", "BC", "BC"])):
        hand.injector.withdraw(owner, now)
        for identifier in (1, 2, 3):
            medium.offer("A", record(identifier), now)
        assert heard(medium, now + SECOND // 2) == list(zip((1, 2, 3), expected, strict=True))
    assert medium.frame_faults.struck == 2


@pytest.mark.parametrize("ended", ["by a plug", "by its owner", "by its time"])
def test_a_fault_that_is_over_is_not_lifted_again(ended: str) -> None:
    """Whoever is plugged in listens for eleven bits first: a frame would wait for them."""
    medium, owner = bus(), object()
    hand = Hand(medium)
    hand.inject("unplug", node="B", duration=1.0 if ended == "by its time" else 5.0, owner=owner)
    if ended == "by a plug":
        hand.inject("plug", node="B", at=1.0)
    medium.take(2 * SECOND)
    if ended == "by its owner":
        hand.injector.withdraw(owner, 2 * SECOND)
    elif ended == "by its time":
        hand.injector.withdraw(None, 5 * SECOND)
    medium.offer("B", record(1), 5 * SECOND)
    assert [delivery.at for delivery in drain(medium, 6 * SECOND)] == [5 * SECOND + frame_time(1, bitrate=MBIT)]


def test_a_plug_may_be_put_back_early(medium: Medium[str]) -> None:
    hand = Hand(medium)
    hand.inject("unplug", node="B", duration=5.0)
    hand.inject("plug", node="B", at=1.0)
    hand.inject("unplug", node="B", at=4.0)
    medium.take(2 * SECOND)
    assert medium.stations["B"].plugged
    medium.take(6 * SECOND)
    assert not medium.stations["B"].plugged, "the end of the first one does not end the second"


def test_a_node_that_leaves_takes_its_faults_along(medium: Medium[str]) -> None:
    hand = Hand(medium)
    hand.inject("unplug", node="B", duration=1.0)
    medium.leave("B", SECOND // 2)
    medium.take(2 * SECOND)
    hand.injector.withdraw(None, 3 * SECOND)
    medium.offer("A", record(1), 3 * SECOND)
    assert [delivery.sender for delivery in drain(medium, 4 * SECOND)] == ["A"]
