"""Response times: the paper's counterexample, and no schedule that exceeds the bound, which some reach."""

from __future__ import annotations

from itertools import pairwise, product
from math import inf

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from rds.bus.analysis.messages import Message, in_order, messages_of, priority
from rds.bus.analysis.response_times import Errors, Task, responses, worst_response
from rds.bus.analysis.schedule import Slot, occupied, one_cycle, schedule
from rds.core.errors import InputError
from rds.machines import load_machine

# --- the analysis against exact schedules of whole-numbered tasks


def periodic(tasks: list[Task], offsets: list[int], until: int, late: list[list[int]] | None = None) -> list[Slot]:
    """Every task released at offset + k period + lateness; lateness is taken in turn, never beyond the jitter."""
    nominal = {}
    releases = []
    for number, (task, offset) in enumerate(zip(tasks, offsets, strict=True)):
        for count, at in enumerate(range(offset, until, task.period)):
            lateness = late[number][count % len(late[number])] % (task.jitter + 1) if late else 0
            nominal.setdefault(number, []).append(at)
            releases.append((at + lateness, number))
    slots = schedule(releases, lambda number: tasks[number].transmission)
    # frames of one message go in the order of release: give each the instant that its period gave
    turn = {number: iter(sorted(times)) for number, times in nominal.items()}
    return [slot._replace(released=next(turn[slot.message])) for slot in slots]


def longest_stay(slots: list[Slot], number: int) -> int:
    return max((slot.end - slot.released for slot in slots if slot.message == number), default=0)


@st.composite
def task_sets(draw: st.DrawFn, jitter: bool = True) -> list[Task]:
    tasks = []
    for _ in range(draw(st.integers(1, 5))):
        transmission = draw(st.integers(1, 12))
        period = draw(st.integers(transmission + 1, 60))
        tasks.append(Task(transmission, period, draw(st.integers(0, 40)) if jitter else 0))
    assume(sum(task.transmission / task.period for task in tasks) < 0.97)
    return tasks


@given(task_sets(), st.data())
@settings(max_examples=100, deadline=None)
def test_no_schedule_exceeds_the_analysis(tasks: list[Task], data: st.DataObject) -> None:
    offsets = [data.draw(st.integers(0, task.period)) for task in tasks]
    late = [data.draw(st.lists(st.integers(0, 100), min_size=1, max_size=5)) for _ in tasks]
    slots = periodic(tasks, offsets, 1500, late)
    for number in range(len(tasks)):
        bound = worst_response(tasks, number).time
        assert bound is not None
        assert longest_stay(slots, number) <= bound


@given(task_sets())
@settings(max_examples=100, deadline=None)
def test_the_critical_instant_reaches_the_bound(tasks: list[Task]) -> None:
    """All released at their latest at once, and after it without delay; the longest lower one has started just before.

    In whole numbers "just before" is one unit, so the analysis with blocking less by one is to be met exactly.
    """
    for number, task in enumerate(tasks):
        lower = tasks[number + 1 :]
        bound = worst_response(tasks, number).time
        exact = worst_response(
            tasks[: number + 1] + [other._replace(transmission=other.transmission - 1) for other in lower], number
        )
        assert bound is not None and exact.time is not None
        releases = []
        begin = max(other.jitter for other in tasks) + 1
        if lower:
            blocker = max(range(len(lower)), key=lambda place: lower[place].transmission) + number + 1
            releases.append((begin - 1, blocker))
        for higher, other in enumerate(tasks[: number + 1]):
            times = (begin - other.jitter + count * other.period for count in range(4000 // other.period))
            releases += [(max(begin, at), higher) for at in times]
        slots = schedule(releases, lambda place: tasks[place].transmission)
        mine = [slot for slot in slots if slot.message == number and slot.end < 2000]
        seen = max(slot.end - (begin - task.jitter + count * task.period) for count, slot in enumerate(mine))
        assert seen == exact.time <= bound


def test_the_counterexample_to_the_analysis_of_1994() -> None:
    """Davis et al. (2007): messages A, B, C of 1 ms each, periods 2.5, 3.5, 3.5 ms, deadlines 2.5, 3.25, 3.25 ms.

    The first instance of C responds after 3 ms, which is all that the old analysis sees; the second after 3.5 ms, later
    than its deadline.
    """
    tasks = [Task(1000, 2500), Task(1000, 3500), Task(1000, 3500)]
    found = [worst_response(tasks, number) for number in range(3)]
    assert [result.time for result in found] == [2000, 3000, 3500]
    assert (found[2].instance, found[2].instances, found[2].blocking) == (1, 2, 0)
    slots = [slot for slot in periodic(tasks, [0, 0, 0], 7000) if slot.message == 2]
    assert [slot.end - slot.released for slot in slots] == [3000, 3500]


def test_what_blocks_the_first_instance_may_delay_the_second_more() -> None:
    """Blocked by 1 and then 3 of the higher one, the first takes 5; the second waits for 3 more: until 9, from 3 on."""
    tasks = [Task(3, 5), Task(1, 3), Task(1, 6)]
    found = worst_response(tasks, 1)
    assert (found.time, found.blocking, found.instance) == (6, 1, 1)


def test_the_counterexample_as_frames() -> None:
    """The same as real messages: seven bytes with worst stuffing are 125 bits, 1 ms at 125 kbit/s."""
    table = in_order(
        Message(name, identifier, False, 7, period, deadline=deadline)
        for name, identifier, period, deadline in (
            ("A", 1, 2.5e-3, 2.5e-3),
            ("B", 2, 3.5e-3, 3.25e-3),
            ("C", 3, 3.5e-3, 3.25e-3),
        )
    )
    assert [result.time for result in responses(table, 125_000)] == [2_000_000, 3_000_000, 3_500_000]


def test_overload_is_unbounded_and_says_from_which_priority_on() -> None:
    tasks = [Task(3, 10), Task(4, 10), Task(3, 10), Task(1, 100)]
    found = [worst_response(tasks, number) for number in range(4)]
    assert [result.time for result in found] == [7, 10, None, None]
    assert "100 % of the bus" in found[2].reason and "101 % of the bus" in found[3].reason


def test_nearly_full_bus_is_given_up_not_waited_for() -> None:
    tasks = [Task(999_999_999_999, 1_000_000_000_000, 10**18), Task(1, 1_000_000_000_001)]
    assert "busy for more than" in worst_response(tasks, 1).reason


# --- errors


def test_each_error_costs_its_frame_and_the_longest_frame_again() -> None:
    """One error: 31 bits, and the longest frame of this priority or higher, are added to all that waits for it."""
    table = in_order([Message("a", 1, False, 8, 10e-3), Message("b", 2, False, 0, 10e-3)])
    plain = [result.time for result in responses(table, 1_000_000)]
    once = [result.time for result in responses(table, 1_000_000, errors=Errors())]
    twice = [result.time for result in responses(table, 1_000_000, errors=Errors(burst=2))]
    assert plain == [(135 + 55) * 1000, (135 + 55) * 1000]
    assert once == [time + (31 + 135) * 1000 for time in plain]
    assert twice == [time + 2 * (31 + 135) * 1000 for time in plain]


@pytest.mark.parametrize("interval, time", [(51, 51), (50, 92), (46, 92), (92, 51)])
def test_an_error_may_strike_the_frame_itself(interval: int, time: int) -> None:
    """It takes 10, an error 31 and the frame again: 51 with one. Within 51 there is a second one after 50."""
    assert worst_response([Task(10, 1000)], 0, errors=Errors(1, interval * 1e-9)).time == time


def test_errors_alone_can_overload_a_bus() -> None:
    table = in_order([Message("a", 1, False, 8, 1e-3)])
    assert responses(table, 1_000_000, errors=Errors(interval=1e-3))[0].time == (135 + 31 + 135) * 1000
    assert responses(table, 1_000_000, errors=Errors(1.0)) == responses(table, 1_000_000, errors=Errors(1))  # type: ignore[arg-type]
    assert "and errors ask for" in responses(table, 1_000_000, errors=Errors(interval=190e-6))[0].reason
    for wrong in ({"burst": 0}, {"burst": 1.5}, {"interval": 1e-10}):
        with pytest.raises(InputError, match="burst is a whole number of 1 or more, and the interval at least 1e-9 s"):
            Errors(**wrong)


@given(st.integers(0, 10**9), st.integers(1, 5), st.sampled_from([inf, 1e-3, 0.1]))
def test_errors_never_get_fewer(time: int, burst: int, interval: float) -> None:
    errors = Errors(burst, interval)
    assert burst <= errors.within(time) <= errors.within(time + 10**6)


# --- priorities


def message(identifier: int, extended: bool = False, remote: bool = False, **more: object) -> Message:
    name = f"{identifier:x} {extended} {remote}"
    return Message(**{"name": name, "identifier": identifier, "extended": extended, "size": 2, "period": 0.1,
                      "remote": remote, **more})  # fmt: skip


def test_arbitration_standard_before_extended_and_data_before_remote() -> None:
    base = 0x123
    expected = [
        message(base - 1, False, True),
        message(base),
        message(base, False, True),
        message(base << 18, True),
        message(base << 18, True, True),
        message(base << 18 | 1, True),
        message(base + 1),
    ]
    assert in_order(reversed(expected)) == expected


@given(st.integers(0, 0x1FFFFFFF), st.integers(0, 0x1FFFFFFF), st.booleans(), st.booleans())
def test_priority_is_what_the_wire_decides(first: int, second: int, standard: bool, remote: bool) -> None:
    """The first bit in which the frames differ: dominant wins."""
    from rds.bus.medium.bit_string import bit_string

    first = first & 0x7FF if standard else first
    one, two = message(first, not standard, remote), message(second, True)
    assume(priority(one) != priority(two))
    strings = [
        bit_string(m.identifier, b"" if m.remote else bytes(2), extended=m.extended, remote=m.remote, dlc=2).bits
        for m in (one, two)
    ]
    # stuff bits come in both or in neither up to the first difference
    assert (strings[0] < strings[1]) == (priority(one) < priority(two))


def test_tables_that_cannot_be_are_refused() -> None:
    with pytest.raises(InputError, match="same identifier 0x5"):
        in_order([message(5), message(5, name="other")])
    with pytest.raises(InputError, match="2 messages are called"):
        in_order([message(5, name="x"), message(6, name="x")])
    with pytest.raises(InputError, match="without messages"):
        in_order([])
    with pytest.raises(InputError, match="after 'nobody', which is not in the table"):
        in_order([message(5, after="nobody")])
    with pytest.raises(InputError, match="wait for each other: x after y after x"):
        in_order([message(5, name="x", after="y"), message(6, name="y", after="x")])
    bad = {"period": 0.0, "jitter": -1.0, "deadline": 0.0, "size": 9, "data": b"123"}
    for key, value in bad.items():
        with pytest.raises(InputError, match="message '5 False False'"):
            message(5, **{key: value})


# --- machines: answers that the command releases


@pytest.mark.parametrize(("bitrate", "axes"), [(1_000_000, 4), (500_000, 2), (1_000_000, 1)])
def test_answers_come_one_after_another_within_the_cycle(bitrate: int, axes: int) -> None:
    bit = 1_000_000_000 // bitrate
    table = messages_of(load_machine("mini-cnc"), 1e-3)[: axes + 1]
    found = responses(table, bitrate)
    assert [result.time for result in found] == [135 * bit * (place + 1) for place in range(axes + 1)]


@pytest.mark.parametrize("period, often", [(1.0, 1), (3e-3, 1), (2e-3, 2)])
def test_a_message_beside_the_cycle_is_reckoned_with_as_often_as_it_comes_in_three_periods(
    period: float, often: int
) -> None:
    beside = Message("beside", 0x7FF, False, 8, period)
    table = in_order([*messages_of(load_machine("mini-cnc"), 1e-3)[:4], beside])
    found = responses(table, 1_000_000)
    assert [result.time for result in found[1:4]] == [135_000 * (place + often) for place in (2, 3, 4)]


def test_a_cycle_that_does_not_fit_is_not_called_met() -> None:
    """At 500 kbit/s five frames of 135 bits are 1.35 ms: the bus is overloaded from the third answer on."""
    found = responses(messages_of(load_machine("mini-cnc")), 500_000)
    assert [result.time is None for result in found] == [False, False, False, True, True]


@given(st.data())
@settings(max_examples=75, deadline=None)
def test_no_cycle_exceeds_the_analysis(data: st.DataObject) -> None:
    """Random tables: a message releases others, and these others; some beside them; random lengths, jitters, delays."""
    period = data.draw(st.sampled_from([1e-3, 1.3e-3, 2e-3]), "period")
    identifiers = iter(data.draw(st.lists(st.integers(0, 2047), min_size=8, max_size=8, unique=True), "identifiers"))
    jitter = st.sampled_from([0.0, 20e-6, 150e-6])
    root = Message("root", next(identifiers), False, data.draw(st.integers(0, 8)), period, data.draw(jitter))
    answers = [
        Message(f"answer {place}", next(identifiers), False, data.draw(st.integers(0, 8)), period, data.draw(jitter),
                after=data.draw(st.sampled_from(["root", *(f"answer {before}" for before in range(place))])))
        for place in range(data.draw(st.integers(1, 4)))
    ]  # fmt: skip
    others = [
        Message(f"other {place}", next(identifiers), False, data.draw(st.integers(0, 8)),
                data.draw(st.sampled_from([1e-3, 2.5e-3, 3.5e-3, 20e-3])), data.draw(jitter))
        for place in range(data.draw(st.integers(0, 2)))
    ]  # fmt: skip
    table = in_order([root, *answers, *others])
    chance = data.draw(st.randoms(use_true_random=False))
    bounds = responses(table, 1_000_000)
    names = [entry.name for entry in table]
    periods = [round(entry.period * 1e9) for entry in table]
    lates = [round(entry.jitter * 1e9) for entry in table]
    offsets = [chance.randrange(each) for each in periods]
    most = [entry.most().total for entry in table]
    least = [entry.least().total for entry in table]

    def late(number: int) -> int:
        return chance.choice([0, lates[number], chance.randint(0, lates[number])])

    def follow(slot: Slot) -> list[tuple[int, int]]:
        released = [n for n, entry in enumerate(table) if entry.after == names[slot.message]]
        return [(slot.end - 3000 + late(n), n) for n in released]

    releases = [
        (offsets[number] + count * periods[number] + late(number), number)
        for number, entry in enumerate(table)
        if entry.after is None
        for count in range(30_000_000 // periods[number])
    ]
    full = chance.random() < 0.5
    slots = schedule(
        releases, lambda n: 1000 * (most[n] + 3 if full else chance.randint(least[n], most[n]) + 3), follow
    )
    begin = offsets[names.index("root")]
    seen = [0] * len(table)
    for slot in slots:
        start = begin if table[slot.message].after else offsets[slot.message]
        time = slot.end - start - seen[slot.message] * periods[slot.message]
        seen[slot.message] += 1
        bound = bounds[slot.message].time
        assert bound is None or time <= bound, names[slot.message]


def test_messages_of_the_mini_cnc() -> None:
    table = messages_of(load_machine("mini-cnc"), response_time=5e-5, host_jitter=1e-5)
    assert [entry.identifier for entry in table] == [0x10, 0x22, 0x23, 0x24, 0x25]
    assert [entry.jitter for entry in table] == [1e-5, 5e-5, 5e-5, 5e-5, 5e-5]
    assert {entry.after for entry in table} == {None, "command"}


# --- schedules


def test_one_cycle_is_frame_after_frame() -> None:
    table = messages_of(load_machine("mini-cnc"))
    slots = one_cycle(table, 1_000_000)
    assert [slot.message for slot in slots] == [0, 1, 2, 3, 4]
    assert all(slot.start == before.end for before, slot in pairwise(slots))
    assert slots[-1].end == sum(occupied(entry.exact(), 1_000_000) for entry in table)
    assert slots[1].released == slots[0].end - 3000


@given(st.lists(st.tuples(st.integers(0, 50), st.integers(0, 3)), max_size=30))
def test_schedules_keep_the_rules(releases: list[tuple[int, int]]) -> None:
    slots = schedule(releases, lambda message: message + 2)
    assert sorted((slot.released, slot.message) for slot in slots) == sorted(releases)
    for before, slot in pairwise(slots):
        assert slot.start >= before.end and slot.start == max(before.end, slot.start)
    for slot, other in product(slots, slots):
        assert slot.start >= slot.released
        if other.released <= slot.start < other.start:  # it was waiting and did not go
            assert (slot.message, slot.released) <= (other.message, other.released)


def test_five_axes_have_a_frame_more_before_the_command() -> None:
    table = {message.name: message for message in messages_of(load_machine("xyzac"))}
    assert len(table) == 7 and table["command"].after == "voltages 5 to 8"
    assert table["voltages 5 to 8"].identifier < table["command"].identifier
    assert len(messages_of(load_machine("mini-cnc"))) == 5
