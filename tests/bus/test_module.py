"""The virtual module: latched at the tick, right in bus time however late it runs, safe without commands."""

from __future__ import annotations

from dataclasses import replace
from math import exp

import pytest

from rds.bus.modules.rds import frames, motion_frames
from rds.bus.modules.rds.frames import Answer, Kind, Status
from rds.bus.modules.rds.module import AxisModule, machine_parameters
from rds.core.errors import InputError
from rds.machines import Axis, load_machine

T = 0.001
AXIS = Axis("X", 2, "mm", (-75.0, 75.0), 0.001, machine={"tau": 0.01, "K": 2.0, "delay": 0.0002})


def command(*voltages: float) -> bytes:
    return frames.encode_voltages(voltages)


def make(slot: int = 0) -> AxisModule:
    return AxisModule(AXIS, slot, T, start=100.0)


def decode(answers: list[bytes]) -> list[Answer]:
    return [frames.decode_answer(0x22, data) for data in answers]


def test_answers_with_the_position_at_the_stamp() -> None:
    module = make()
    (first,) = decode(module.receive(frames.COMMAND, command(5.0), 100.0))
    assert first == Answer(0, Status.ENABLED, Kind.ANSWER, 1)
    module.receive(frames.COMMAND, command(5.0), 100.002)
    (second,) = decode(module.receive(frames.COMMAND, command(5.0), 100.004))
    moved = 4.0 - 0.2  # ms, after the delay
    position = 10.0 * (moved - 10.0 * (1 - exp(-moved / 10.0)))  # µm, 10 mm/s at 5 V, τ = 10 ms
    assert second == Answer(round(position), Status.ENABLED, Kind.ANSWER, 3)


def test_takes_its_own_slot() -> None:
    module = make(slot=2)
    module.receive(frames.COMMAND, command(9.0, 9.0, -4.0, 9.0), 100.0)
    module.motion.advance(100.001)
    assert module.motion.voltage == pytest.approx(-4.0, abs=1e-3)


@pytest.mark.parametrize("volts", [5.0, 24.0])
def test_by_itself_it_gives_up_to_the_range_of_the_converter(volts: float) -> None:
    module = AxisModule(AXIS, 0, T, 0.0, range=volts)
    module.control(motion_frames.encode_gain(2, motion_frames.Gain.FORWARD, 30.0), 0.0)
    module.control(motion_frames.encode_begin(2, motion_frames.Buffer.NONE, 0), 0.0)
    module.receive(motion_frames.SETPOINTS, motion_frames.encode_setpoints([16]), 0.0)
    module.motion.advance(0.001)
    assert module.motion.voltage == volts


def test_in_an_emergency_stop_no_offset_of_the_amplifier_moves_the_axis() -> None:
    module = AxisModule(replace(AXIS, machine={**AXIS.machine, "offset": 0.5}), 0, T, start=100.0)
    module.receive(frames.GENERAL, frames.EMERGENCY, 100.0)
    for k in range(100):  # of a host that goes on
        module.receive(frames.COMMAND, command(5.0), 100.0 + k * T)
    assert module.motion.advance(100.2) == 0.0


@pytest.mark.parametrize("gain", [float("nan"), float("inf")])
def test_a_gain_that_is_no_number_gives_no_voltage(gain: float) -> None:
    module = make()
    module.control(motion_frames.encode_gain(2, motion_frames.Gain.VELOCITY, gain), 100.0)
    module.control(motion_frames.encode_begin(2, motion_frames.Buffer.NONE, 0), 100.0)
    module.receive(motion_frames.SETPOINTS, motion_frames.encode_setpoints([16]), 100.0)
    module.motion.advance(100.001)
    assert module.motion.voltage == 0.0 and not module.by_itself.active


@pytest.mark.parametrize("data", [b"", b"\x02", b"\x02\x00"])
def test_a_piece_of_a_buffer_without_bytes_changes_nothing(data: bytes) -> None:
    module = make()
    module.control(motion_frames.encode_begin(2, motion_frames.Buffer.INCREMENTS, 0), 100.0)
    assert module.receive(motion_frames.DATA, data, 100.0) == []
    _, told = module.control(bytes([motion_frames.Verb.INQUIRE, 2]), 100.0) or (0, b"")
    assert motion_frames.decode_progress(told).wanted == 0


def test_a_dry_run_answers_and_does_not_move() -> None:
    module = make()
    module.receive(frames.DRY_COMMAND, command(9.0), 100.0)
    (answer,) = decode(module.receive(frames.DRY_COMMAND, command(9.0), 100.009))
    assert answer == Answer(0, Status.DRY_RUN, Kind.ANSWER, 2)


def test_ten_periods_without_a_command_cut_the_voltage_at_that_instant() -> None:
    module = make()
    module.receive(frames.COMMAND, command(5.0), 100.0)
    assert module.expires == pytest.approx(100.0025), "its voltage ends"
    assert module.expire(100.0099) == [] and module.motion.voltage == 0.0
    assert module.expires == pytest.approx(100.010), "the watchdog speaks"
    (report,) = decode(module.expire(100.010001))
    assert report.status == Status.WATCHDOG and report.kind == Kind.REPORT and report.ticks == 1
    assert module.expires is None
    assert module.expire(200.0) == []
    (called,) = decode(module.receive(frames.CALL, b"", 101.0))
    assert called.status == Status.WATCHDOG
    (answer,) = decode(module.receive(frames.COMMAND, command(0.0), 102.0))
    assert answer.status == Status.ENABLED, "the next command clears it"


@pytest.mark.parametrize("found_out_at", [100.0101, 100.5, 200.0])
def test_found_out_late_it_still_was_zero_volts_from_that_instant(found_out_at: float) -> None:
    module = make()
    module.receive(frames.COMMAND, command(5.0), 100.0)
    report, answer = decode(module.receive(frames.COMMAND, command(0.0), found_out_at))
    assert report.status == Status.WATCHDOG and answer.status == Status.ENABLED
    moved = 0.0023  # two and a half periods, less the delay
    speed = 10.0 * (1 - exp(-moved / 0.01))
    at_cut = 10.0 * moved - 0.01 * speed
    coasting = 0.01 * speed * (1 - exp(-0.0075 / 0.01))
    coast = 0.01 * speed * (1 - exp(-(found_out_at - 100.0025) / 0.01))
    assert report.counts == round((at_cut + coasting) / 0.001)
    assert answer.counts == round((at_cut + coast) / 0.001)


def test_set_up_sets_the_period_that_the_watchdog_counts_in() -> None:
    module = make()
    module.receive(frames.SETUP, frames.encode_setup(0.005), 100.0)
    module.receive(frames.COMMAND, command(5.0), 100.0)
    assert module.expires == pytest.approx(100.0125)
    module.expire(100.0126)
    assert module.expires == pytest.approx(100.05)


@pytest.mark.parametrize(
    "identifier, data",
    [
        (frames.COMMAND, b""),
        (frames.COMMAND, b"1234567"),
        (frames.SETUP, b"x"),
        (frames.SETUP, bytes(8)),
        (0x7FF, b"?"),
    ],
)
def test_bad_frames_change_nothing(identifier: int, data: bytes, caplog: pytest.LogCaptureFixture) -> None:
    module = make()
    module.receive(frames.COMMAND, command(5.0), 100.0)
    expires = module.expires
    assert module.receive(identifier, data, 100.001) == []
    assert module.ticks == 1 and module.expires == expires
    assert identifier == 0x7FF or "ignored a frame" in caplog.text


def test_the_machine_of_the_package_makes_modules() -> None:
    for slot, axis in enumerate(load_machine("mini-cnc").axes.values()):
        module = AxisModule(axis, slot, T, 0.0)
        assert module.identifier == 0x20 + axis.node


def test_a_spindle_reports_its_speed() -> None:
    axis = load_machine("mini-cnc").axis("spindle")
    module = AxisModule(axis, 3, T, 0.0)
    for k in range(2000):
        answers = module.receive(frames.COMMAND, command(0, 0, 0, 5.0), k * T)
    final = (975.0 * 5.0 - 40.0) / 1.01
    assert decode(answers)[0].counts == pytest.approx(final, abs=2.0)


def test_without_a_machine_table_the_machine_is_its_model() -> None:
    axis = Axis("X", 2, "mm", (-1, 1), 0.001, model={"name": "linear-axis", "tau": 0.01, "K": 1.5})
    assert machine_parameters(axis).K == 1.5


def test_a_ninth_axis_has_no_slot() -> None:
    with pytest.raises(InputError, match="number 9"):
        make(slot=8)


def numbered(number: int, *voltages: float) -> bytes:
    return frames.number_voltages(command(*voltages), number)


def running(slot: int) -> AxisModule:
    """A module that is set up, and has heard two commands of one host, half a period per number."""
    module = make(slot)
    module.receive(frames.SETUP, frames.encode_setup(T), 100.0)
    for k in (0, 1):
        module.receive(frames.MORE_VOLTAGES, numbered(1 + 2 * k, 1.0), 100.0 + k * T - 1e-4)
        module.receive(frames.COMMAND, numbered(1 + 2 * k, 5.0), 100.0 + k * T)
    return module


def test_the_fifth_axis_takes_the_voltage_before_the_tick_of_the_same_number() -> None:
    module = running(slot=4)
    at = 100.0 + 2 * T
    assert module.receive(frames.MORE_VOLTAGES, numbered(5, -3.0), at - 1e-4) == [], "it is no tick"
    (answer,) = decode(module.receive(frames.COMMAND, numbered(5, 9.0), at))
    assert answer.ticks == 3 and answer.status == Status.ENABLED
    module.motion.advance(at + T / 2)
    assert module.motion.voltage == pytest.approx(-3.0, abs=1e-3)
    assert frames.MORE_VOLTAGES in module.hears and frames.MORE_VOLTAGES not in make(slot=3).hears
    (dry,) = decode(module.receive(frames.DRY_COMMAND, numbered(7, 9.0), at + T))
    assert dry.status == Status.DRY_RUN


@pytest.mark.parametrize("before", [None, 3], ids=["lost", "of another tick"])
def test_without_its_voltage_the_one_before_lasts_two_and_a_half_periods(before: int | None) -> None:
    module = running(slot=4)
    if before is not None:
        module.receive(frames.MORE_VOLTAGES, numbered(before, 7.0), 100.0 + T + 1e-4)
    for k in (2, 3):
        (answer,) = decode(module.receive(frames.COMMAND, numbered(1 + 2 * k, 9.0), 100.0 + k * T))
        assert answer.kind == Kind.ANSWER and answer.ticks == k + 1
    assert module.motion.voltage == pytest.approx(1.0, abs=1e-3)
    assert module.expires == pytest.approx(100.0 + 3.5 * T)
    assert module.expire(100.0 + 3.6 * T) == [] and module.motion.voltage == 0.0


def test_a_tick_by_hand_stops_the_fifth_axis_too() -> None:
    """As the emergency stop and a replayed log end: zero volts in one frame."""
    module = make(slot=7)
    module.receive(frames.MORE_VOLTAGES, command(0, 0, 0, 4.0), 100.0)
    module.receive(frames.COMMAND, command(), 100.0)
    module.motion.advance(100.0005)
    assert module.motion.voltage == pytest.approx(4.0, abs=1e-3)
    module.receive(frames.COMMAND, command(), 100.001)
    module.motion.advance(100.0015)
    assert module.motion.voltage == 0.0
