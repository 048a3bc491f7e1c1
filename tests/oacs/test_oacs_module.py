"""A module in bus time: replies, motions, limit switches, emergency stop, watchdogs, tuning, hostile frames."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oacs_bench import MACHINE, Bench

from rds.bus.modules.oacs import codes as words
from rds.bus.modules.oacs import messages
from rds.bus.modules.oacs.codes import Acknowledges, Code, Mode, Move, Parameter, Result, Select
from rds.bus.modules.oacs.link import acknowledgement
from rds.bus.modules.rds import frames

Benches = Callable[..., Bench]


@pytest.mark.parametrize(
    "name, call, download", [("drill", 5.2, 5.3), ("X", 1.1, 1.4), ("A", 6.7, 6.9), ("Z", 1.5, 2.2)]
)
def test_response_times_of_table_20(bench: Benches, name: str, call: float, download: float) -> None:
    rig = bench(name)
    for code in (1, 2, 9):
        asked = rig.now
        rig.say("GeneralCall", Code=code)
        rig.run(0.02)
        replied = [at for at, message in rig.heard if message.kind in ("Reply", "Identity")][-1]
        assert replied - asked == pytest.approx(call * 1e-3, abs=1e-5)
    asked = rig.now
    rig.say("Command", Code=Code.DATA_CALL)
    rig.run(0.02)
    first = next(at for at, message in rig.heard if message.kind == "Download")
    assert first - asked == pytest.approx(download * 1e-3, abs=1e-5)


def test_replies_to_the_general_calls(bench: Benches) -> None:
    rig = bench("drill")
    for code in (1, 2, 9):
        rig.say("GeneralCall", Code=code)
        rig.run(0.02)
    kind, kind_of = rig.said("Reply")
    assert messages.text(kind.fields, "KindText", 5) == "SpinM" and kind.fields["BoardID"] == 5
    assert messages.text(kind_of.fields, "TypeText", 6) == "DrillT"
    assert rig.said("Identity")[0].fields["Serial"] == 77


@pytest.mark.parametrize(
    "name, direction, distance, counts, seconds",
    [
        ("X", 1, 80.0, 13533, 36.92),  # tables O32, O33 and O35: averages
        ("X", 0, 80.0, 13537, 30.09),
        ("Z", 1, 50.0, 8438, 27.11),
        ("Z", 0, 50.0, 8456, 22.07),
    ],
)
def test_moves_as_the_thesis_measured_them(
    bench: Benches, name: str, direction: int, distance: float, counts: int, seconds: float
) -> None:
    rig = bench(name)
    asked = rig.now
    rig.move(Move.START, Direction=direction, Argument=round(distance * 1000))
    assert rig.until_done() == Result.CARRIED_OUT
    assert abs(rig.module.plant.counts) == pytest.approx(counts, abs=60)
    assert rig.now - asked == pytest.approx(seconds, rel=0.05)
    assert abs(rig.module.plant.true_position) == pytest.approx(distance, abs=1.0), "table 14: worst accuracy"


@pytest.mark.parametrize("direction", [1, 0])
def test_the_a_axis_loses_counts_and_goes_too_far(bench: Benches, direction: int) -> None:
    """Section 9.5: 63 of 67 counts per degree, so it turns too far (22 degrees in 360) and cannot know it."""
    rig = bench("A")
    rig.move(Move.START, Direction=direction, Argument=170_000)
    assert rig.until_done() == Result.CARRIED_OUT
    turned = abs(rig.module.plant.true_position)
    assert abs(rig.module.plant.counts) / turned == pytest.approx(63.0, abs=1.3)
    assert turned - 170.0 == pytest.approx(22.0 * 170 / 360, abs=4.0)
    assert rig.said("Status")[-1].fields["CountsMissing"] > 400, "the module's index pulses show it"


def test_with_half_the_encoder_the_a_axis_is_right(bench: Benches) -> None:
    rig = bench("A", counts_per_unit=33.5, counts_per_turn=512)
    rig.module.plant.counter.set(0)
    rig.move(Move.START, Direction=1, Argument=170_000)
    assert rig.until_done() == Result.CARRIED_OUT
    assert rig.module.plant.true_position == pytest.approx(170.0, abs=1.5)
    assert rig.module.plant.counter.missing <= 2


def test_the_thesis_way_of_writing_a_distance(bench: Benches) -> None:
    rig = bench("X")
    rig.frame(0x004, bytes([3, 1, 3, 1, 0, 0, 0, 0]))  # 31XY0000: start, 3 mm, clockwise
    assert rig.until_done() == Result.CARRIED_OUT
    assert rig.module.plant.true_position == pytest.approx(3.0, abs=0.3)


def test_a_motion_is_accepted_then_carried_out_with_positions_between(bench: Benches) -> None:
    rig = bench("X")
    rig.say("Command", Code=Code.READINGS, Quantities=1, ReadingsPeriod=10)
    rig.move(Move.TO_POINT, Argument=2000)
    rig.until_done()
    rig.run(0.1)
    assert rig.results() == [Result.CARRIED_OUT, Result.ACCEPTED, Result.CARRIED_OUT]
    positions = [(at, m.fields) for at, m in rig.heard if m.fields.get("Code") == words.MessageToHost.POSITION]
    assert [fields["Sequence"] for _, fields in positions] == [k % 256 for k in range(len(positions))]
    steps = [b - a for (a, _), (b, _) in pairwise(positions)]
    assert steps == pytest.approx([0.01] * len(steps), abs=1e-6)
    assert positions[0][1]["Position"] == 0 and positions[-1][1]["Position"] == rig.module.plant.counts


def test_positions_do_not_depend_on_how_late_the_process_is(bench: Benches) -> None:
    def positions(late: float) -> list[int]:
        rig = bench("X")
        rig.say("Command", Code=Code.READINGS, Quantities=1, ReadingsPeriod=10)
        rig.move(Move.START, Direction=1, Argument=2000)
        while rig.now < 103.0:
            rig.module.mover.heard = rig.now
            rig.now += late
            rig._note(rig.module.expire(rig.now))
        return [m.fields["Position"] for m in rig.said("Reply") if m.fields["Code"] == words.MessageToHost.POSITION]

    assert positions(0.003) == positions(0.07)[: len(positions(0.003))] != []


def test_stop_and_switch_direction(bench: Benches) -> None:
    rig = bench("X")
    rig.move(Move.SWITCH_DIRECTION)
    rig.move(Move.START, Direction=1, Argument=20_000)
    rig.run(3.0)
    there = rig.module.plant.true_position
    rig.move(Move.SWITCH_DIRECTION)
    rig.run(3.0)
    assert rig.module.plant.true_position < there - 3.0
    rig.move(Move.STOP)
    rig.run(1.0)
    nothing, accepted, switched, stopped, ended = rig.results()
    assert (nothing, accepted, switched) == (Result.NOTHING_MOVES, Result.ACCEPTED, Result.CARRIED_OUT)
    assert (stopped, ended) == (Result.CARRIED_OUT, Result.STOPPED_BY_COMMAND)
    assert rig.module.plant.voltage == 0.0 and rig.module.plant.velocity == 0.0


@pytest.mark.parametrize(
    "fields, result",
    [
        ({"Move": Move.TO_POINT, "Argument": 151_000}, Result.OUTSIDE_TRAVEL),
        ({"Move": Move.START, "Argument": 151_000}, Result.OUTSIDE_TRAVEL),
        ({"Move": Move.START}, Result.BAD_VALUE),
        ({"Move": Move.START, "Argument": -5}, Result.BAD_VALUE),
        ({"Move": Move.JOG, "Argument": 0}, Result.BAD_VALUE),
        ({"Move": Move.JOG, "Argument": 61_000}, Result.BAD_VALUE),
    ],
)
def test_commands_outside_the_limits_are_refused(bench: Benches, fields: dict[str, int], result: Result) -> None:
    rig = bench("X")
    rig.say("Command", Code=Code.MOVE, **fields)
    rig.run(0.1)
    assert rig.results() == [result]


@pytest.mark.parametrize("data", ["", "03", "63" + 7 * "00", "0363" + 6 * "00", "0563" + 6 * "00", "00" * 8])
def test_a_command_that_the_module_does_not_know_is_refused(bench: Benches, data: str) -> None:
    rig = bench("X")
    rig.frame(words.COMMAND + rig.module.node, bytes.fromhex(data))
    rig.frame(words.COMMAND + rig.module.node + 1, bytes.fromhex(data))  # another module's
    rig.run(0.1)
    (answer,) = rig.said("Reply")
    said = answer.fields
    assert acknowledgement(Acknowledges.START)(answer) and not acknowledgement(Acknowledges.START, last=True)(answer)
    assert (said["Acknowledges"], said["Result"]) == (Acknowledges.UNKNOWN, Result.BAD_VALUE)
    assert rig.module.mover.motion is None and rig.module.plant.voltage == 0.0
    assert rig.module.plant.voltage == 0.0 and rig.module.mover.motion is None


def test_one_motion_at_a_time(bench: Benches) -> None:
    rig = bench("X")
    rig.move(Move.START, Argument=5000)
    rig.move(Move.START, Argument=5000)
    rig.run(0.1)
    assert rig.results() == [Result.ACCEPTED, Result.BUSY]
    (busy,) = [each for each in rig.said("Reply") if each.fields.get("Result") == Result.BUSY]
    # the host of the first motion hears it, too, and takes it for no end of that
    assert acknowledgement(Acknowledges.START)(busy) and not acknowledgement(Acknowledges.START, last=True)(busy)


@pytest.mark.parametrize("direction, start", [(1, 149.0), (0, -149.0)])
def test_a_limit_switch_stops_the_axis_within_its_time(bench: Benches, direction: int, start: float) -> None:
    rig = bench("X", start=start)
    rig.move(Move.JOG, Direction=direction, Argument=10_000)
    assert rig.until_done() == Result.STOPPED_BY_LIMIT
    beyond = abs(rig.module.plant.true_position) - 152.0
    # 100 ms of debouncing at 2.7 mm/s at most, and the way to a stand
    assert 0.1 < beyond < 2.7 * 0.101 + 0.25
    side = "HighLimitOpen" if direction else "LowLimitOpen"
    assert rig.said("Status")[-1].fields[side] == 1
    rig.move(Move.JOG, Direction=direction, Argument=1000)
    rig.run(0.1)
    assert rig.results()[-1] == Result.AT_LIMIT, "not further"
    rig.move(Move.JOG, Direction=1 - direction, Argument=2000)
    assert rig.until_done() == Result.CARRIED_OUT, "but back"
    assert rig.said("Status")[-1].fields[side] == 0


def test_a_broken_wire_stops_whichever_way_it_moves(bench: Benches) -> None:
    rig = bench("X")
    rig.move(Move.START, Direction=1, Argument=20_000)
    rig.run(1.0)
    broke = rig.now
    rig.module.set_wire(-1, False, rig.now)
    rig.run(0.0995)
    assert rig.module.plant.voltage != 0.0, "a glitch would be over by now"
    rig.run(0.002)
    assert rig.module.plant.voltage == 0.0 and rig.now - broke < 0.102
    assert rig.until_done() == Result.STOPPED_BY_LIMIT


def test_a_glitch_stops_nothing(bench: Benches) -> None:
    rig = bench("X")
    rig.move(Move.START, Direction=1, Argument=5000)
    rig.run(1.0)
    rig.module.set_wire(1, False, rig.now)
    rig.run(0.09)
    rig.module.set_wire(1, None, rig.now)
    assert rig.until_done() == Result.CARRIED_OUT


def test_homing_finds_the_zero(bench: Benches) -> None:
    rig = bench("X", start=-145.0)
    rig.module.plant.counter.set(999_999)  # the count is anything after a failure
    rig.move(Move.HOME)
    assert rig.until_done() == Result.CARRIED_OUT
    plant = rig.module.plant
    assert plant.counts / 169.0 == pytest.approx(plant.true_position, abs=0.02)
    assert rig.said("Status")[-1].fields["Homed"] == 1 and not plant.switches[0].open


@pytest.mark.parametrize("homed", [False, True])
def test_homing_from_on_the_switch(bench: Benches, homed: bool) -> None:
    rig = bench("X", start=-152.5)
    rig.run(0.3)
    rig.module.mover.homed = homed  # once before, since when counts were lost
    rig.module.plant.counter.recorded += 500
    rig.module.plant.look(rig.now)
    rig.run(0.3)
    assert rig.module.plant.switches[0].open
    rig.move(Move.HOME)
    assert rig.until_done() == Result.CARRIED_OUT
    assert rig.module.plant.counts / 169.0 == pytest.approx(rig.module.plant.true_position, abs=0.02)


def test_an_axis_that_is_switched_on_beyond_its_switch_finds_the_zero(bench: Benches) -> None:
    rig = bench("X", start=-155.0)
    assert rig.module.plant.switches[0].open
    rig.move(Move.HOME)
    assert rig.until_done() == Result.CARRIED_OUT
    assert rig.module.plant.counts / 169.0 == pytest.approx(rig.module.plant.true_position, abs=0.02)


@pytest.mark.parametrize("before", [True, False])
def test_a_wire_that_breaks_is_not_taken_for_the_zero(bench: Benches, before: bool) -> None:
    """The axis leaves the switch, and it stays open: 5 % of the travel on, it is the wire."""
    rig = bench("X", start=-100.0)
    rig.move(Move.HOME)
    rig.run(1.0)
    rig.module.set_wire(-1, False, rig.now)
    if before:  # broken when it begins: the axis believes to stand on the switch
        rig.until_done()
        rig.heard.clear()
        rig.move(Move.HOME)
    assert rig.until_done() == Result.STOPPED_BY_LIMIT
    plant = rig.module.plant
    assert not rig.module.mover.homed and plant.true_position < -100.0 + 35.0
    assert plant.counts / 169.0 == pytest.approx(plant.true_position, abs=0.02)


@pytest.mark.parametrize("seconds", [0.15, 0.5, 2.0])
def test_a_wire_that_opens_and_closes_again_is_not_taken_for_the_zero(bench: Benches, seconds: float) -> None:
    rig = bench("X", start=-100.0)
    rig.move(Move.HOME)
    rig.run(1.0)
    rig.module.set_wire(-1, False, rig.now)
    rig.run(seconds)
    rig.module.set_wire(-1, None, rig.now)
    assert rig.until_done() == Result.STOPPED_BY_LIMIT
    plant = rig.module.plant
    assert not rig.module.mover.homed and plant.counts / 169.0 == pytest.approx(plant.true_position, abs=0.02)


def test_a_homing_ends_where_its_switch_never_opens(bench: Benches) -> None:
    rig = bench("X", start=-100.0)
    rig.module.set_wire(-1, True, rig.now)
    rig.move(Move.HOME)
    assert rig.until_done() == Result.STOPPED_BY_LIMIT
    data = rig.module.plant.data
    assert -100.0 - rig.module.plant.true_position < 1.25 * (data.highest - data.lowest) and not rig.module.mover.homed


@pytest.mark.parametrize("start", [-145.0, -145.37, -146.21])
def test_a_switch_is_its_own_edge_at_many_counts_a_step(bench: Benches, start: float) -> None:
    """Of 25 counts in each ms, as other machines' modules count them, an edge may be noted a ms late, both ways."""
    rig = bench("X", start=start, counts_per_unit=16900.0)
    rig.move(Move.HOME)
    assert rig.until_done() == Result.CARRIED_OUT and rig.module.mover.homed


def test_a_homing_that_is_stopped_while_it_leaves_the_switch_leaves_the_zero_alone(bench: Benches) -> None:
    rig = bench("X", start=-100.0)
    rig.move(Move.HOME)
    rig.run(1.0)
    rig.module.set_wire(-1, False, rig.now)  # the axis takes the wire for the switch, and begins to leave it
    while rig.module.mover.motion is not None and not rig.module.mover.motion.found:
        rig.run(0.01)
    rig.module.mover.stop(Result.STOPPED_BY_EMERGENCY, rig.now)
    assert rig.until_done() == Result.STOPPED_BY_EMERGENCY
    plant = rig.module.plant
    assert not rig.module.mover.homed and plant.true_position < -90.0
    assert plant.counts / 169.0 == pytest.approx(plant.true_position, abs=0.02)


def test_homing_without_switches_sets_the_zero_here(bench: Benches) -> None:
    rig = bench("A", start=30.0)
    rig.move(Move.HOME)
    rig.run(0.1)
    assert rig.results() == [Result.CARRIED_OUT, Result.ACCEPTED] or rig.results()[-1] == Result.CARRIED_OUT
    assert rig.module.plant.counts == 0 and rig.module.mover.homed


def test_emergency_stop_latches_zero_volts(bench: Benches) -> None:
    rig = bench("X")
    rig.move(Move.START, Direction=1, Argument=20_000)
    rig.run(2.0)
    rig.say("GeneralCall", Code=Code.EMERGENCY)
    assert rig.module.plant.voltage == 0.0
    rig.run(1.0)
    assert Result.STOPPED_BY_EMERGENCY in rig.results() and rig.module.mode == Mode.EMERGENCY
    rig.move(Move.START, Direction=1, Argument=1000)
    rig.run(0.1)
    assert rig.results()[-1] == Result.EMERGENCY_LATCHED
    rig.frame(frames.COMMAND, frames.encode_voltages([8.0]))
    rig.run(0.005)
    assert rig.module.plant.voltage == 0.0, "nor do cyclic commands move it"
    rig.run(0.1)
    rig.say("Command", Code=Code.EMERGENCY)
    rig.move(Move.START, Direction=1, Argument=1000)
    assert rig.until_done() == Result.CARRIED_OUT


def test_the_emergency_input_stops_all_and_holds(bench: Benches) -> None:
    rig = bench("drill")
    rig.move(Move.START, Direction=1, Argument=500_000)
    rig.run(1.0)
    assert rig.module.plant.velocity > 400
    rig.module.set_emergency_input(True, rig.now)
    rig.run(0.01)
    assert rig.said("GeneralCall")[0].fields["Code"] == Code.EMERGENCY, "the others hear it"
    assert rig.module.plant.voltage == 0.0
    rig.say("Command", Code=Code.EMERGENCY)
    rig.run(0.1)
    assert rig.results()[-1] == Result.EMERGENCY_LATCHED, "not while the button is pressed"
    rig.module.set_emergency_input(False, rig.now)
    assert rig.module.plant.emergency, "releasing the button starts nothing"
    rig.say("Command", Code=Code.EMERGENCY)
    rig.run(0.1)
    assert rig.results()[-1] == Result.CARRIED_OUT and not rig.module.plant.emergency


@pytest.mark.parametrize("name, argument", [("X", 50_000), ("drill", 500_000)])
def test_a_host_that_falls_silent_leaves_nothing_moving(bench: Benches, name: str, argument: int) -> None:
    rig = bench(name)
    rig.move(Move.START, Direction=1, Argument=argument)
    rig.run(1.9, alive=False)
    assert rig.module.plant.voltage != 0.0
    rig.run(0.2, alive=False)
    assert rig.module.plant.voltage == 0.0
    rig.run(2.0, alive=False)
    assert rig.results()[-1] == Result.HOST_SILENT


def test_the_cyclic_watchdog_cuts_after_ten_periods(bench: Benches) -> None:
    rig = bench("X")
    rig.frame(frames.COMMAND, frames.encode_voltages([8.0]))
    period = MACHINE.sample_period
    rig.run(2.4 * period)
    assert rig.module.plant.voltage == pytest.approx(8.0, abs=1e-3)
    rig.run(0.2 * period)
    assert rig.module.plant.voltage == 0.0, "a command older than two periods acts no more"
    assert not any(status.fields["WatchdogCut"] for status in rig.said("Status"))
    rig.run(8.0 * period)
    assert rig.module.plant.voltage == 0.0
    assert rig.said("Status")[-1].fields["WatchdogCut"] == 1


def test_cyclic_commands_take_over_and_keep_the_axis(bench: Benches) -> None:
    rig = bench("X")
    rig.move(Move.START, Direction=1, Argument=50_000)
    rig.run(1.0)
    answers = rig.module.receive(frames.COMMAND, frames.encode_voltages([0.0]), rig.now)
    assert frames.decode_answer(answers[0].identifier, answers[0].data).counts == rig.module.plant.counts
    rig.move(Move.START, Direction=1, Argument=50_000)
    rig.run(0.05)
    assert rig.results()[-2:] == [Result.HOST_COMMANDS, Result.HOST_COMMANDS]


def test_cyclic_commands_stop_at_the_limit_and_say_so(bench: Benches) -> None:
    rig = bench("X", start=151.5)
    status = 0
    for k in range(3000):
        rig.now = 100.0 + k * 1e-3
        for frame in rig.module.receive(frames.COMMAND, frames.encode_voltages([9.0]), rig.now):
            if frame.identifier == 0x24:
                status = frames.decode_answer(0x24, frame.data).status
    assert rig.module.plant.voltage == 0.0 and rig.module.plant.true_position < 152.7
    assert status & frames.Status.FAULT
    rig.module.receive(frames.COMMAND, frames.encode_voltages([-9.0]), rig.now)
    rig.module.advance(rig.now + 0.001)
    assert rig.module.plant.voltage < 0.0, "back is free"


def test_tuning_takes_effect_as_a_whole(bench: Benches) -> None:
    rig = bench("X")
    rig.say("Command", Code=Code.SET_PARAMETER, Parameter=Parameter.KP, ParameterValue=3.0)
    rig.say("Command", Code=Code.SET_PARAMETER, Parameter=Parameter.SAMPLE_TIME, ParameterValue=0.02)
    assert rig.module.mover.tuning.Kp == 1.5
    rig.say("Command", Code=Code.SET_PARAMETER, Parameter=Parameter.SELECT, Selection=Select.PI)
    assert (rig.module.mover.tuning.Kp, rig.module.mover.tuning.controller) == (3.0, Select.PI)
    rig.say("Command", Code=Code.SET_PARAMETER, Parameter=Parameter.KI, ParameterValue=-1.0)
    rig.say("Command", Code=Code.READ_PARAMETER, ReadIndex=Parameter.KP)
    rig.run(0.05)
    assert rig.results() == [Result.CARRIED_OUT] * 3 + [Result.BAD_VALUE]
    assert rig.said("Parameter")[0].fields["ParameterValue"] == 3.0


def test_an_axis_that_does_not_move_is_given_up(bench: Benches) -> None:
    rig = bench("X")
    for parameter, value in ((Parameter.KP, 0.01), (Parameter.KI, 0.0), (Parameter.KICK, 0.0)):
        rig.say("Command", Code=Code.SET_PARAMETER, Parameter=parameter, ParameterValue=value)
    rig.say("Command", Code=Code.SET_PARAMETER, Parameter=Parameter.SELECT, Selection=Select.PI)
    rig.move(Move.START, Argument=2000)
    assert rig.until_done() == Result.STALLED


def test_a_tool_turns_and_turns_round(bench: Benches) -> None:
    rig = bench("drill")
    rig.move(Move.START, Direction=1, Argument=400_000)
    rig.run(1.5)
    assert rig.module.plant.counts == pytest.approx(400, abs=20)
    rig.move(Move.SWITCH_DIRECTION)
    rig.run(1.5)
    assert rig.module.plant.counts == pytest.approx(-400, abs=20)
    rig.move(Move.TO_POINT, Argument=5)
    rig.move(Move.HOME)
    rig.run(0.1)
    assert rig.results()[-2:] == [Result.NOT_FOR_THIS_MODULE] * 2


def test_acceleration_and_current(bench: Benches) -> None:
    rig = bench("drill")
    rig.say("Command", Code=Code.READINGS, Quantities=6, ReadingsPeriod=20)
    rig.run(0.2)
    rest = rig.said("Acceleration")[-1].fields
    assert rest["AccelerationX"] == pytest.approx(-1.05, abs=0.01)
    rig.move(Move.START, Direction=1, Argument=580_000)
    rig.run(2.0)
    currents = [m.fields["Current"] for m in rig.said("Current")]
    assert max(currents) == pytest.approx(1.48, abs=0.1) and currents[-1] == pytest.approx(1.4, abs=0.1)
    # the drill turns without a product: stage B of figure 91, readings 6 to 20 of table P36
    for axis, rms in (("X", 0.0445), ("Y", 0.0433), ("Z", 0.0461)):
        shaken = [m.fields[f"Acceleration{axis}"] for m in rig.said("Acceleration")[-50:]]
        mean = sum(shaken) / 50
        assert (sum((each - mean) ** 2 for each in shaken) / 50) ** 0.5 == pytest.approx(rms, rel=0.15)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from([0x001, 0x004, 0x114, 0x010, 0x011, 0x012, 0x013]) | st.integers(0, 0x7FF),
            st.binary(max_size=8),
            st.floats(0, 0.05),
        ),
        max_size=40,
    )
)
def test_hostile_frames_break_nothing(frames_: list[tuple[int, bytes, float]]) -> None:
    rig = Bench("X")
    for identifier, data, pause in frames_:
        rig.frame(identifier, data)
        rig.run(pause, alive=False)
    rig.run(0.3, alive=False)
    rig.say("GeneralCall", Code=Code.EMERGENCY)
    rig.run(0.05)
    assert rig.module.plant.voltage == 0.0
    kinds: list[Any] = [m.fields for m in rig.said("Reply") if m.fields.get("Acknowledges") == Acknowledges.EMERGENCY]
    assert kinds


@pytest.mark.parametrize(
    ("name", "direction", "mean", "std", "swings"),
    [
        # tables Q39 to Q41: mean and standard deviation of the readings behind the first
        ("X", 1, 2.477, 0.357, True),
        ("X", 0, 2.735, 0.292, True),
        ("Z", 1, 4.030, 0.568, True),
        ("Z", 0, 3.677, 0.606, True),
        ("A", 1, 1.794, 0.061, False),
        ("A", 0, 1.876, 0.146, False),
    ],
)
def test_currents_are_the_tables_and_swing_with_the_screw(
    bench: Benches, name: str, direction: int, mean: float, std: float, swings: bool
) -> None:
    """Figures 94 and 95: as many crests as turns of the M24x3 screw."""
    rig = bench(name)
    rig.say("Command", Code=Code.READINGS, Quantities=words.Quantity.CURRENT, ReadingsPeriod=50)
    way = 12.0 if swings else 30.0  # mm, four turns; degrees
    rig.move(Move.START, Direction=direction, Argument=round(way * 1000))
    while rig.module.mover.mode != Mode.MOVING:
        rig.run(0.01)
    rig.run(0.5)
    began = len(rig.said("Current"))
    while rig.module.mover.mode == Mode.MOVING:
        rig.run(0.05)
    running = [m.fields["Current"] for m in rig.said("Current")][began:-25]  # before it comes to its end
    average = sum(running) / len(running)
    assert average == pytest.approx(mean, rel=0.05)
    spread = (sum((each - average) ** 2 for each in running) / len(running)) ** 0.5
    if not swings:
        assert spread < 0.15
        return
    assert spread == pytest.approx(std, rel=0.25)
    crossings = sum((a - average) * (b - average) < 0.0 for a, b in pairwise(running))
    assert 2 * (way / 3.0) - 3 <= crossings <= 2 * (way / 3.0) + 1
