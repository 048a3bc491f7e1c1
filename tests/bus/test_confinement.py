"""Error frames, error counters and bus off in virtual time, against sequences computed by hand."""

from __future__ import annotations

import pytest

from rds.bus.hub import wire
from rds.bus.medium.bit_string import bit_string
from rds.bus.medium.bits import frame_time
from rds.bus.medium.confinement import ErrorCounters, ErrorState
from rds.bus.medium.error_flags import broken_frame, flipped, noticed_after, vulnerable
from rds.bus.medium.error_reports import describe
from rds.bus.medium.fault_kinds import Fault
from rds.bus.medium.medium import FaultRefused
from rds.bus.medium.station import Station
from rds.bus.medium.timed_medium import TimedMedium

from .wires import MBIT, bus, drain, identifier_of, record

BIT = 1000  # ns
RECOVERY = 128 * 11 * BIT


def counters(medium: TimedMedium[str], *names: str) -> list[tuple[int, int]]:
    return [(medium.stations[name].counters.tec, medium.stations[name].counters.rec) for name in names]


def corrupt(medium: TimedMedium[str], count: int, now: int = 0, **words: object) -> None:
    medium.frame_faults.arm(Fault("corrupt", count=count, **words), now)  # type: ignore[arg-type]


def settle(medium: TimedMedium[str], until: int = 10**9) -> list[int]:
    return [identifier_of(delivery) for delivery in drain(medium, until)]


def make_off(medium: TimedMedium[str], node: str = "A") -> int:
    """Let a node go bus off; returns when it is."""
    corrupt(medium, 32, node=node)
    medium.offer(node, record(0x10), 0)
    settle(medium, 10_000_000)
    assert medium.stations[node].counters.state is ErrorState.OFF
    return 10_000_000


def test_the_rules() -> None:
    one = ErrorCounters()
    for k in range(1, 17):
        assert one.state is ErrorState.ACTIVE and one.warning == (one.tec >= 96)
        one.failed_to_send()
        assert one.tec == 8 * k
    assert one.state is ErrorState.PASSIVE
    one.failed_to_send(unacknowledged=True)
    assert one.tec == 128, "an error-passive node alone goes no further"
    one.sent()
    assert (one.tec, one.state) == (127, ErrorState.ACTIVE)
    for _ in range(17):
        one.failed_to_send()
    assert (one.tec, one.state) == (263, ErrorState.OFF)
    one.sent()
    assert one.state is ErrorState.OFF, "only recovery leads out"
    one.reset()
    assert (one.tec, one.rec, one.state) == (0, 0, ErrorState.ACTIVE)


def test_the_rules_for_receivers() -> None:
    one = ErrorCounters()
    for _ in range(127):
        one.failed_to_receive()
    assert one.state is ErrorState.ACTIVE
    one.failed_to_receive()
    assert (one.rec, one.state) == (128, ErrorState.PASSIVE)
    for _ in range(200):
        one.failed_to_receive()
    assert one.rec == 255, "the counter has eight bits"
    one.received()
    assert (one.rec, one.state) == (127, ErrorState.ACTIVE)
    one.received()
    assert one.rec == 126


@pytest.mark.parametrize(
    "seen, flag, expected",
    [
        ("0100", "0", 4),  # two dominant bits before: the fourth of the flag is the sixth in a row
        ("0011", "0", 6),
        ("10", "0", 5),
        ("100000", "0", 1),
        ("1000000", "0", 0),  # already too many: all see it at once
        ("0111", "1", 3),
    ],
)
def test_when_the_others_notice(seen: str, flag: str, expected: int) -> None:
    assert noticed_after(seen, flag) == expected


def test_an_error_frame_has_its_exact_length() -> None:
    """Bit string and count agree; 0x55 makes runs that one can count by hand."""
    string = bit_string(0x555, b"\x55" * 8)
    start = string.field("data 3").start
    for bit in range(start, start + 8):
        seen = flipped(string, bit)
        # alternating bits: a 1 that becomes 0 makes three 0 with its neighbours, of which two are over
        others = 4 if string.bits[bit] == "1" else 6
        bits = broken_frame(string, seen, passive=False, answered=True)
        assert bits.nominal + 3 == len(string.broken_off(bit, others))
        assert broken_frame(string, seen, False, answered=False).nominal + 3 == len(string.broken_off(bit, 0))


def test_only_bits_between_arbitration_and_the_end_of_the_crc_can_be_disturbed() -> None:
    for flags in ({}, {"extended": True}, {"fd": True}, {"fd": True, "extended": True}):
        string = bit_string(0x123, bytes(4), **flags)
        allowed = vulnerable(string, bool(flags.get("extended")))
        assert allowed.start == string.field("rrs" if flags.get("fd") else "rtr").stop
        assert allowed.stop <= string.field("delimiter").start


def test_one_error_and_the_frame_again() -> None:
    medium = bus()
    data = b"\x55" * 8
    string = bit_string(0x555, data)
    bit = string.field("data 3").start
    corrupt(medium, 1, bit=bit)
    medium.offer("A", record(0x555, data), 0)
    others = 4 if string.bits[bit] == "1" else 6
    broken = len(string.broken_off(bit, others)) * BIT  # with the interframe space
    medium.take(broken - 3 * BIT)
    assert counters(medium, "A", "B", "C") == [(8, 0), (0, 1), (0, 1)]
    (delivery,) = drain(medium, 10**9)
    assert delivery.at == broken + frame_time(0x555, data, bitrate=MBIT)
    assert counters(medium, "A", "B", "C") == [(7, 0), (0, 0), (0, 0)]
    assert medium.errors == 1 and medium.stations["A"].errors == 1 and medium.stations["A"].sent == 1


@pytest.mark.parametrize("passive, unplugged, answered", [("B", "", True), ("BC", "", False), ("B", "C", False)])
def test_an_error_active_node_on_the_bus_answers_an_error_flag(passive: str, unplugged: str, answered: bool) -> None:
    medium = bus()
    for name in passive:
        medium.stations[name].counters.rec = 128
        medium.stations[name].counters.state = ErrorState.PASSIVE
    for name in unplugged:
        medium.unplug(name, 0)
    data = b"\x55" * 8
    string = bit_string(0x555, data)
    bit = string.field("data 3").start
    corrupt(medium, 1, bit=bit)
    medium.offer("A", record(0x555, data), 0)
    others = (4 if string.bits[bit] == "1" else 6) if answered else 0
    (delivery,) = drain(medium, 10**9)
    assert delivery.at == len(string.broken_off(bit, others)) * BIT + frame_time(0x555, data, bitrate=MBIT)


def test_up_to_error_passive_and_back() -> None:
    medium = bus()
    corrupt(medium, 16)
    medium.offer("A", record(0x10), 0)
    assert settle(medium) == [0x10]
    assert counters(medium, "A", "B") == [(127, 0), (0, 15)]
    assert medium.stations["A"].counters.state is ErrorState.ACTIVE
    for k in range(127):
        medium.offer("A", record(0x10), 10**9 + k)
    settle(medium, 2 * 10**9)
    assert counters(medium, "A", "B") == [(0, 0), (0, 0)]


def test_an_error_passive_sender_lets_others_go_first() -> None:
    medium = bus()
    corrupt(medium, 17, node="A")
    medium.offer("A", record(0x10), 0)
    medium.offer("A", record(0x11), 0)
    assert settle(medium, 0) == []
    medium.stations["A"].counters.tec = 0  # the errors come one after the other from here on
    at = 0
    while medium.stations["A"].counters.tec < 128:
        at += BIT
        medium.take(at)
    medium.offer("B", record(0x700), at)
    order = settle(medium)
    assert order[0] == 0x700, "offered within the eight bits for which A is suspended"
    assert order[1:] == [0x10, 0x11]


def test_suspend_transmission_lasts_eight_bits() -> None:
    medium = bus()
    for name in "ABC":
        medium.stations[name].counters.tec = 136 if name == "A" else 0
    medium.stations["A"].counters.state = ErrorState.PASSIVE
    medium.offer("A", record(1), 0)
    medium.offer("A", record(2), 0)
    first, second = (delivery.at for delivery in drain(medium, 10**9))
    assert second - first == (3 + 8) * BIT + frame_time(2, bitrate=MBIT)


def test_bus_off_after_32_errors_and_back_after_128_times_11_bits() -> None:
    medium = bus()
    changes: list[tuple[str, ErrorState]] = []
    medium._changed = lambda node, station: changes.append((node, station.counters.state))
    now = make_off(medium)
    assert changes == [("A", ErrorState.PASSIVE), ("A", ErrorState.OFF)]
    assert counters(medium, "A", "B") == [(256, 0), (0, 32)]
    medium.offer("A", record(1), now)
    assert settle(medium, now + 10**9) == [] and medium.stations["A"].lost == 2
    now += 10**9
    medium.restart("A", now)
    medium.take(now + RECOVERY - 1)
    assert medium.stations["A"].counters.state is ErrorState.OFF
    assert medium.due() == now + RECOVERY
    medium.take(now + RECOVERY)
    assert medium.stations["A"].counters.state is ErrorState.ACTIVE and counters(medium, "A") == [(0, 0)]
    medium.offer("A", record(1), now + RECOVERY)
    assert settle(medium, now + 10**9) == [1]
    with pytest.raises(FaultRefused, match="error active, not bus off"):
        medium.restart("A", now + 2 * 10**9)


def test_who_is_off_stays_off_and_counts_nothing() -> None:
    counters = ErrorCounters()
    for _ in range(32):
        counters.failed_to_send()
    counters.sent()
    counters.failed_to_receive()
    assert (counters.tec, counters.rec, counters.state) == (255, 0, ErrorState.OFF)


def test_a_controller_warns_from_96_receive_errors_on() -> None:
    counters = ErrorCounters()
    for number in range(1, 98):
        counters.failed_to_receive()
        assert counters.warning is (number >= 96)


def test_who_is_bus_off_hears_nothing_until_it_is_back() -> None:
    medium = bus()
    changes: list[tuple[str, ErrorState]] = []
    medium._changed = lambda node, station: changes.append((node, station.counters.state))
    now = make_off(medium)
    medium.offer("B", record(1), now)
    assert [set(delivery.deaf) for delivery in drain(medium, now + 10**6)] == [{"A"}]
    medium.restart("A", now + 10**6)
    medium.offer("B", record(2), now + 10**7)
    assert [set(delivery.deaf) for delivery in drain(medium, now + 2 * 10**7)] == [set()]
    assert changes[1:] == [("A", ErrorState.OFF), ("A", ErrorState.ACTIVE)]


@pytest.mark.parametrize("gone", ["unplug", "die"])
def test_who_is_cut_off_does_not_come_back_from_bus_off(gone: str) -> None:
    medium = bus()
    now = make_off(medium)
    getattr(medium, gone)("A", now)
    medium.restart("A", now)
    medium.take(now + 2 * RECOVERY)
    assert medium.stations["A"].counters.state is ErrorState.OFF and medium.due() is None


def test_two_that_recover_come_back_each_at_its_time() -> None:
    medium = bus()
    for station in (medium.stations["A"], medium.stations["B"]):
        station.counters.tec, station.counters.state = 256, ErrorState.OFF
    medium.restart("A", 10**6)
    medium.restart("B", 10**6 + 500)
    back = []
    while (due := medium.due()) is not None:
        medium.take(due)
        back.append((due, [medium.stations[name].counters.state for name in "AB"]))
    first = 10**6 + RECOVERY
    assert back == [(first, [ErrorState.ACTIVE, ErrorState.OFF]), (first + 500, [ErrorState.ACTIVE] * 2)]


def test_whoever_leaves_while_it_recovers_is_waited_for_no_longer() -> None:
    medium = bus()
    now = make_off(medium)
    medium.restart("A", now)
    medium.leave("A", now)
    assert medium.due() is None


def test_the_unplugged_acknowledge_nothing_and_count_nothing() -> None:
    medium = bus()
    for name in "BC":
        medium.unplug(name, 0)
    medium.offer("A", record(5), 0)
    assert settle(medium, 10**6) == [] and counters(medium, "A", "B", "C") == [(128, 0), (0, 0), (0, 0)]
    medium.plug("B", 10**6)
    (delivery,) = drain(medium, 2 * 10**6)
    assert set(delivery.deaf) == {"C"} and medium.stations["A"].sent == 1
    assert medium.stations["A"].bits * BIT == frame_time(5, bitrate=MBIT) + 3 * BIT


def test_recovery_counts_what_is_recessive_between_frames() -> None:
    """Frames back to back have eleven recessive bits at their ends: 128 of them are enough."""
    medium = bus()
    now = make_off(medium)
    medium.restart("A", now)
    for number in range(140):
        medium.offer("B", record(0x20, bytes([number])), now)
    seen = 0
    while medium.stations["A"].counters.state is ErrorState.OFF:
        now = medium.due() or 0
        seen += len(drain(medium, now))
    # the frame that starts when A asks has seen nothing recessive yet; each later one, and its own end, eleven bits
    assert seen == 128


def test_automatic_restart() -> None:
    medium: TimedMedium[str] = TimedMedium()
    medium.join("A", Station(1, "A", restart_after=50_000_000), 0)
    medium.join("B", Station(2, "B"), 0)
    corrupt(medium, 32, node="A")
    medium.offer("A", record(0x10), 0)
    medium.take(40_000_000)
    assert medium.stations["A"].counters.state is ErrorState.OFF
    medium.take(60_000_000)
    assert medium.stations["A"].counters.state is ErrorState.ACTIVE


def test_alone_on_the_bus_nobody_acknowledges() -> None:
    medium = bus("A")
    data = bytes(8)
    medium.offer("A", record(5, data), 0)
    whole = frame_time(5, data, bitrate=MBIT)
    attempt = whole - 8 * BIT + (6 + 8) * BIT + 3 * BIT  # to the ACK slot, error frame, interframe space
    assert medium.take(15 * attempt) is None
    assert counters(medium, "A") == [(120, 0)]
    medium.take(16 * attempt)
    assert counters(medium, "A") == [(128, 0)]
    medium.take(17 * attempt)
    assert medium.due() is None, "nothing changes until somebody comes"
    medium.take(10**9)
    assert counters(medium, "A") == [(128, 0)]
    failed = medium.stations["A"].errors
    assert failed == 16 + (10**9 - 16 * attempt - 8 * BIT) // (attempt + 8 * BIT) == medium.errors
    medium.join("B", Station(2, "B"), 10**9)
    (delivery,) = drain(medium, 2 * 10**9)
    assert delivery.at < 10**9 + 2 * (attempt + 8 * BIT) + whole
    assert counters(medium, "A") == [(127, 0)]


def test_two_nodes_with_one_identifier_destroy_each_others_frames() -> None:
    """Until the one that sends the recessive bit is error passive, 16 errors later: then the other gets through."""
    medium = bus()
    medium.offer("A", record(7, b"\x00"), 0)
    medium.offer("B", record(7, b"\x01"), 0)
    first, second = drain(medium, 10**9)
    assert (first.sender, second.sender) == ("A", "B")
    # B lost its place in that frame, and did not hear it
    assert "B" in first.deaf and not second.deaf
    # 16 errors each; then A's frame: -1, and B's error: +8; then B's frame: -1
    assert counters(medium, "A", "B") == [(127, 0), (135, 0)]
    assert medium.stations["C"].counters.rec == 14
    assert medium.errors == 16


def test_who_asks_for_error_frames_gets_its_controllers() -> None:
    medium: TimedMedium[str] = TimedMedium()
    medium.join("A", Station(1, "A", reports=True), 0)
    medium.join("B", Station(2, "B"), 0)
    corrupt(medium, 32, node="A")
    medium.offer("A", record(0x10), 0)
    seen = drain(medium, 10**9)
    assert all(delivery.only == "A" for delivery in seen)
    texts = [describe(identifier_of(delivery), delivery.frame[16:24]) for delivery in seen]
    assert texts[0] == "bus error while sending (TEC 8, REC 0)"
    assert "transmit warning (TEC 96, REC 0)" in texts and "transmit passive (TEC 128, REC 0)" in texts
    assert texts[-1] == "bus off (TEC 255, REC 0)"
    assert sum(text.startswith("transmit") for text in texts) == 2, "a state is told when it changes"
    assert all(delivery.frame[13] & wire.ERROR for delivery in seen)
    wire.check_frame(seen[0].frame[wire.KEY_AT])


def test_error_frames_cannot_be_sent() -> None:
    with pytest.raises(wire.WireError, match="can't be sent"):
        bus().offer("A", record(1, flags=wire.ERROR), 0)
