"""The timed medium in virtual time: exact instants, arbitration, and never beyond the analysis."""

from __future__ import annotations

from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rds.bus.analysis.messages import Message, in_order
from rds.bus.analysis.messages import priority as message_priority
from rds.bus.analysis.response_times import Errors, responses
from rds.bus.analysis.schedule import schedule
from rds.bus.hub import wire
from rds.bus.medium.bits import frame_time
from rds.bus.medium.fault_kinds import Fault
from rds.bus.medium.station import flags_of, priority, record_bits
from rds.bus.medium.timed_medium import TimedMedium

from .wires import MBIT, bus, drain, identifier_of, record


class Offer(NamedTuple):
    """What is offered when, by whom."""

    at: int  # ns
    node: str
    record: bytes


def carry(medium: TimedMedium[str], offers: list[Offer], until: int = 10**10) -> list[tuple[int, int]]:
    """(instant, identifier) of every frame."""
    seen = []
    for at, node, frame in sorted(offers, key=lambda offer: offer.at):
        medium.offer(node, frame, at)
        seen += drain(medium, at - 1)
    seen += drain(medium, until)
    return [(delivery.at, identifier_of(delivery)) for delivery in seen]


def test_a_frame_arrives_at_the_end_of_its_end_of_frame() -> None:
    data = bytes(range(8))
    for bitrate in (125_000, 250_000, 500_000, MBIT):
        time = frame_time(0x123, data, bitrate=bitrate)
        assert carry(bus(bitrate=bitrate), [Offer(1000, "A", record(0x123, data))]) == [(1000 + time, 0x123)]


def test_nothing_arrives_before_its_time() -> None:
    medium = bus()
    medium.offer("A", record(0x10), 500)
    end = 500 + frame_time(0x10, bitrate=MBIT)
    assert medium.due() == 500
    assert medium.take(end - 1) is None
    assert medium.due() == end
    delivery = medium.take(end + 12345)  # however late one looks
    assert delivery is not None and delivery.at == end
    assert medium.due() is None


def test_a_node_that_is_alone_may_leave_in_the_middle_of_its_frame() -> None:
    """The hub asked for the error state of one that was no more, and failed."""
    medium = bus("A")
    medium.offer("A", record(0x10), 0)
    assert medium.take(1000) is None
    medium.leave("A", 2000)
    end = medium.due()
    assert end is not None and medium.take(end) is None
    assert medium.due() is None and not medium.stations


def test_the_next_frame_starts_three_bits_after_the_last() -> None:
    first, second = frame_time(1, bitrate=MBIT), frame_time(2, bitrate=MBIT)
    assert carry(bus(), [Offer(0, "A", record(1)), Offer(0, "B", record(2))]) == [
        (first, 1),
        (first + 3000 + second, 2),
    ]


@pytest.mark.parametrize("late", [0, 1, 2999, 3000, 3001])
def test_what_is_offered_in_the_interframe_space_takes_part(late: int) -> None:
    """Offered up to the very instant in which the bus is free, the lower identifier wins; afterwards it waits."""
    first = frame_time(1, bitrate=MBIT)
    offers = [Offer(0, "A", record(1)), Offer(10, "B", record(0x20)), Offer(first + late, "C", record(0x10))]
    order = [identifier for _, identifier in carry(bus(), offers)]
    assert order == ([1, 0x10, 0x20] if late <= 3000 else [1, 0x20, 0x10])


def test_who_may_not_send_yet_keeps_nobody_waiting() -> None:
    for waiting, other in ("AC", "CA"):
        medium = bus()
        medium.stations[waiting].resume_at = 500_000
        medium.offer(waiting, record(1), 0)
        medium.offer(other, record(2), 0)
        arrived = [(delivery.at, delivery.sender) for delivery in drain(medium, 10**9)]
        first, second = (frame_time(identifier, bitrate=MBIT) for identifier in (2, 1))
        assert arrived == [(first, other), (500_000 + second, waiting)]


def test_a_frame_in_flight_is_not_interrupted() -> None:
    offers = [Offer(0, "A", record(0x7FF, bytes(8))), Offer(1, "B", record(0))]
    assert [identifier for _, identifier in carry(bus(), offers)] == [0x7FF, 0]


def test_standard_before_extended_and_data_before_remote() -> None:
    base = 0x123
    kinds = [
        record(base << 18 | 5, flags=wire.EXTENDED | wire.REMOTE),
        record(base << 18 | 5, flags=wire.EXTENDED),
        record(base << 18, flags=wire.EXTENDED | wire.REMOTE),
        record(base, flags=wire.REMOTE),
        record(base),
    ]
    medium = bus(*"ABCDE")
    for node, frame in zip("ABCDE", kinds, strict=True):
        medium.offer(node, frame, 0)
    assert [delivery.sender for delivery in drain(medium, 10**9)] == ["E", "D", "C", "B", "A"]


def test_frames_of_one_node_with_one_identifier_stay_in_order_and_others_overtake() -> None:
    medium = bus()
    for number in range(5):
        medium.offer("A", record(0x50, bytes([number])), number)
    medium.offer("A", record(0x40), 6)
    frames = [delivery.frame for delivery in drain(medium, 10**9)]
    assert [wire.HEADER.unpack_from(frame)[1] for frame in frames] == [0x50, 0x40, 0x50, 0x50, 0x50, 0x50]
    assert [frame[16] for frame in frames if frame[8] == 0x50] == list(range(5))


def test_fd_data_go_at_their_own_rate() -> None:
    data = bytes(range(48))
    flags = wire.FD | wire.BITRATE_SWITCH
    (fast,) = carry(bus(data_bitrate=4 * MBIT), [Offer(0, "A", record(1, data, flags))])
    expected = frame_time(1, data, bitrate=MBIT, data_bitrate=4 * MBIT, fd=True, bitrate_switch=True)
    assert fast == (expected, 1)
    (slow,) = carry(bus(), [Offer(0, "A", record(1, data, flags))])
    assert slow[0] == frame_time(1, data, bitrate=MBIT, fd=True, bitrate_switch=True)


@given(
    identifier=st.integers(0, 0x1FFFFFFF),
    data=st.binary(max_size=8),
    kind=st.sampled_from([0, wire.EXTENDED, wire.REMOTE, wire.EXTENDED | wire.REMOTE]),
)
def test_records_have_the_bits_and_priority_of_their_frames(identifier: int, data: bytes, kind: int) -> None:
    extended, remote = bool(kind & wire.EXTENDED), bool(kind & wire.REMOTE)
    identifier &= 0x1FFFFFFF if extended else 0x7FF
    frame = record(identifier, b"" if remote else data, kind, len(data))
    flags = flags_of(frame)
    assert record_bits(frame).time(MBIT) == frame_time(bitrate=MBIT, **flags)
    message = Message("m", identifier, extended, len(data), 1.0, remote=remote)
    assert priority(identifier, extended, remote) == message_priority(message)


def test_the_same_frame_from_two_nodes_is_one_frame() -> None:
    medium = bus()
    for node in "AB":
        medium.offer(node, record(5, b"same"), 0)
    (delivery,) = drain(medium, 10**9)
    assert set(delivery.deaf) | {delivery.sender} == {"A", "B"}
    assert [medium.stations[node].sent for node in "ABC"] == [1, 1, 0]
    assert medium.frames == 1 and medium.errors == 0


def test_nodes_may_offer_only_so_much_before_they_wait() -> None:
    medium = bus()
    number = 0
    while not medium.is_full("A"):
        medium.offer("A", record(1, bytes([number])), 0)
        number += 1
    assert 8 <= number <= 64 and not medium.is_full("B")
    assert len(drain(medium, 10**9)) == number and not medium.is_full("A")


def test_frames_sent_before_leaving_still_go_and_an_empty_bus_is_empty() -> None:
    medium = bus()
    for k in range(3):
        medium.offer("A", record(k), 0)
    medium.leave("A", 1)
    assert len(drain(medium, 10**9)) == 3 and "A" not in medium.stations
    medium.offer("B", record(1), 10**9)
    medium.leave("C", 10**9)
    medium.leave("B", 10**9)
    assert not medium.stations and medium.due() is None


# --- against the exact schedule and the analysis

message_sets = st.lists(
    st.tuples(
        st.integers(0, 0x7FF),
        st.booleans(),
        st.integers(0, 8),
        st.integers(300, 5000),  # period, µs
        st.integers(0, 400),  # jitter, µs
    ),
    min_size=1,
    max_size=6,
    unique_by=lambda message: message[0],
)


def table(raw: list[tuple[int, bool, int, int, int]]) -> list[Message]:
    return in_order(
        Message(
            f"m{identifier:x}",
            identifier << 18 if extended else identifier,
            extended,
            size,
            period * 1e-6,
            jitter * 1e-6,
        )
        for identifier, extended, size, period, jitter in raw
    )


@settings(max_examples=60, deadline=None)
@given(raw=message_sets, bitrate=st.sampled_from([125_000, 250_000, 500_000, MBIT]), data=st.data())
def test_as_the_exact_schedule_and_never_beyond_the_analysis(
    raw: list[tuple[int, bool, int, int, int]], bitrate: int, data: st.DataObject
) -> None:
    messages = table(raw)
    bounds = responses(messages, bitrate)
    offers: list[Offer] = []
    releases: list[tuple[int, int]] = []
    queued: dict[int, list[tuple[int, int, bytes]]] = {number: [] for number in range(len(messages))}
    for number, message in enumerate(messages):
        period, jitter = round(message.period * 1e9), round(message.jitter * 1e9)
        offset, at = data.draw(st.integers(0, period)), 0
        for k in range(30_000_000 // period):
            due = offset + k * period
            late = data.draw(st.integers(0, jitter)) if jitter else 0
            at = max(at, due + late)  # sent in order, also if jitter is longer than the period
            content = data.draw(st.binary(min_size=message.size, max_size=message.size))
            queued[number].append((at, due, content))
    for number, message in enumerate(messages):
        for at, _, content in queued[number]:
            flags = wire.EXTENDED if message.extended else 0
            offers.append(Offer(at, f"n{number}", record(message.identifier, content, flags)))
            releases.append((at, number))
    sent = [iter(instances) for instances in queued.values()]

    def duration(number: int) -> int:
        _, _, content = next(sent[number])
        message = messages[number]
        return frame_time(message.identifier, content, bitrate=bitrate, interframe=True, extended=message.extended)

    slots = schedule(releases, duration)
    medium = bus("listener", *(f"n{number}" for number in range(len(messages))), bitrate=bitrate)
    seen = carry(medium, offers, 10**12)
    interframe = 3 * 10**9 // bitrate
    assert seen == [(slot.end - interframe, messages[slot.message].identifier) for slot in slots]
    instance = [0] * len(messages)
    for slot in slots:
        due = queued[slot.message][instance[slot.message]][1]
        instance[slot.message] += 1
        bound = bounds[slot.message].time
        if bound is not None:
            assert slot.end - due <= bound


@settings(max_examples=40, deadline=None)
@given(raw=message_sets, burst=st.integers(1, 8), seed=st.integers(0, 100), probability=st.floats(0.05, 1.0))
def test_with_errors_never_beyond_the_analysis_with_so_many(
    raw: list[tuple[int, bool, int, int, int]], burst: int, seed: int, probability: float
) -> None:
    messages = table(raw)
    bounds = responses(messages, 500_000, errors=Errors(burst=burst))
    medium = bus("listener", *(message.name for message in messages), bitrate=500_000)
    medium.frame_faults.arm(Fault("corrupt", count=burst, probability=probability, seed=seed), 0)
    due: dict[int, list[int]] = {message.identifier: [] for message in messages}
    offers = []
    for message in messages:
        period = round(message.period * 1e9)
        for k in range(20_000_000 // period):  # all released together at 0, the worst case
            due[message.identifier].append(k * period)
            flags = wire.EXTENDED if message.extended else 0
            content = bytes([seed, k % 256] * 4)[: message.size]
            offers.append(Offer(k * period, message.name, record(message.identifier, content, flags)))
    worst = dict.fromkeys(due, 0)
    for at, identifier in carry(medium, offers, 10**12):
        worst[identifier] = max(worst[identifier], at + 6000 - due[identifier].pop(0))
    for message, bound in zip(messages, bounds, strict=True):
        assert bound.time is None or worst[message.identifier] <= bound.time


@settings(max_examples=50, deadline=None)
@given(
    offers=st.lists(
        st.tuples(st.integers(0, 2_000_000), st.sampled_from("ABC"), st.integers(0, 0x7FF)), max_size=30, unique=True
    ),
    looks=st.lists(st.integers(0, 5_000_000), max_size=20),
)
def test_when_one_looks_changes_nothing(offers: list[tuple[int, str, int]], looks: list[int]) -> None:
    def run(looking: list[int]) -> list[tuple[int, bytes, str | None]]:
        medium = bus()
        events = [(at, 1, node, identifier) for at, node, identifier in offers]
        events += [(at, 0, "", 0) for at in looking]
        seen = []
        for at, kind, node, identifier in sorted(events):
            if kind:
                medium.offer(node, record(identifier, node.encode()), at)
            else:
                due = medium.due()
                taken = drain(medium, at)
                assert not taken or (due is not None and due <= at), "due() promises no later than what comes"
                seen += taken
        seen += drain(medium, 10**9)
        return [(delivery.at, delivery.frame, delivery.sender) for delivery in seen]

    assert run(looks) == run([])
