"""The state machine against the transition table that the canopen library carries, which is not ours."""

from __future__ import annotations

import pytest
from canopen.profiles.p402 import State402
from hypothesis import given
from hypothesis import strategies as st

from rds.bus.modules.cia402.codes import STATUS_PATTERNS, State, state_of, status_text
from rds.bus.modules.cia402.state_machine import TRANSITIONS, Command, StateMachine, command

WAYS = {tuple(way) for way in State402.TRANSITIONTABLE}
# not in the library's table: quick stop without power (7, 10), and 3 with 4 in one command
WAYS |= {("READY TO SWITCH ON", "OPERATION ENABLED")}
MADE_BY_THE_DRIVE = ("START", "NOT READY TO SWITCH ON", "FAULT REACTION ACTIVE")  # by no command
FAULTS = {(state.value, "FAULT REACTION ACTIVE") for state in State}

steps = st.one_of(
    st.integers(0, 0xFFFF).map(lambda word: ("control", word)),
    st.sampled_from([0x06, 0x07, 0x0F, 0x02, 0x00, 0x80]).map(lambda word: ("control", word)),
    st.sampled_from([("fault", 0), ("reacted", 0), ("stopped", 0), ("wake", 0)]),
)


# CiA 402, command coding: (bits that matter, what they are) of bits 7 and 3 to 0
CODING = {
    Command.SHUTDOWN: (0x87, 0x06),
    Command.SWITCH_ON: (0x8F, 0x07),
    Command.ENABLE_OPERATION: (0x8F, 0x0F),
    Command.DISABLE_VOLTAGE: (0x82, 0x00),
    Command.QUICK_STOP: (0x86, 0x02),
    Command.NONE: (0x80, 0x80),
}


def test_every_controlword_is_one_command() -> None:
    for word in [*range(0x100), *range(0xFF00, 0x10000)]:
        assert [name for name, (mask, bits) in CODING.items() if word & mask == bits] == [command(word)], hex(word)


def test_enabling_at_once_makes_two_transitions_and_a_quick_stop_that_has_ended_one() -> None:
    machine = StateMachine()
    assert machine.wake() == [1] and machine.control(0x06) == [2] and machine.control(0x0F) == [3, 4]
    assert machine.stopped() == [] and machine.control(0x02) == [11]
    assert machine.control(0x0F) == [], "it may not be resumed"
    assert machine.stopped() == [12] and machine.state is State.SWITCH_ON_DISABLED


@given(st.lists(steps, max_size=60), st.booleans())
def test_no_sequence_of_controlwords_makes_an_illegal_transition(sequence: list, may_resume: bool) -> None:
    machine = StateMachine()
    for verb, word in sequence:
        before = machine.state
        made = machine.control(word, may_resume) if verb == "control" else getattr(machine, verb)()
        after = machine.state
        for number in made:
            start, end = TRANSITIONS[number]
            assert start is None or start is before, f"transition {number} from {before}"
            before = end
        assert before is after
        if verb == "control" and made:
            assert not word & 0x80 or made == [15]
            assert made != [16] or may_resume


@given(st.lists(steps, max_size=60))
def test_every_way_is_in_the_librarys_table(sequence: list) -> None:
    machine = StateMachine()
    for verb, word in sequence:
        before = machine.state
        if verb == "control":
            machine.control(word, True)
        else:
            getattr(machine, verb)()
        way = before.value, machine.state.value
        assert before is machine.state or way in WAYS or way in FAULTS


@pytest.mark.parametrize(
    "way", sorted(way for way in State402.TRANSITIONTABLE if way[0] not in MADE_BY_THE_DRIVE), ids=" to ".join
)
def test_the_librarys_command_makes_its_way(way: tuple[str, str]) -> None:
    machine = StateMachine()
    machine.wake()
    machine.control(0)
    machine.state = State(way[0])
    machine.control(State402.TRANSITIONTABLE[way], may_resume=True)
    assert machine.state == way[1]


def test_a_fault_is_reset_by_a_rising_edge_only() -> None:
    machine = StateMachine()
    machine.wake()
    machine.control(0x80)
    machine.fault()
    machine.reacted()
    assert not machine.control(0x80)  # set before
    assert not machine.control(0x00)
    assert not machine.control(0x80, may_reset=False)
    assert not machine.control(0x80), "the edge came while nothing could be reset"
    assert not machine.control(0x00)
    assert machine.control(0x80) == [15]
    assert machine.state is State.SWITCH_ON_DISABLED


@pytest.mark.parametrize("state", State)
def test_status_patterns_are_the_librarys(state: State) -> None:
    assert State402.SW_MASK[state.value] == STATUS_PATTERNS[state]
    assert state_of(STATUS_PATTERNS[state][1]) is state
    assert state.value in status_text(STATUS_PATTERNS[state][1])
