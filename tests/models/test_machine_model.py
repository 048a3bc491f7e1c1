"""The machine's own axis as a model in a sampled loop: the same motion as behind the bus, and as the plain axis."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis.strategies import floats, lists, sampled_from

from rds.core.errors import InputError
from rds.machines import load_machine
from rds.models import library_model
from rds.models.machine_axis import MachineAxis, MachineParameters
from rds.models.machine_model import MachineAxisMotion, split_delay

MACHINE = load_machine("mini-cnc")
FULL = dict(MACHINE.axis("X").machine)
VOLTAGES = lists(floats(-10.0, 10.0), min_size=1, max_size=40)


@settings(max_examples=60)
@given(
    voltages=VOLTAGES,
    delay=sampled_from([0.0, 0.0002, 0.001, 0.0017, 0.002]),
    offset=floats(-0.3, 0.3),
    dead_zone=sampled_from([0.0, 0.2]),
)
def test_it_moves_as_the_machine_behind_the_bus(
    voltages: list[float], delay: float, offset: float, dead_zone: float
) -> None:
    params = FULL | {"delay": delay, "offset": offset, "dead_zone": dead_zone}
    model, machine = library_model("machine-axis", **params), MachineAxis(MachineParameters(**params))
    motion, state = MachineAxisMotion(model, 0.001), tuple(model.initial_state)
    machine.command(0.0, at=-delay)  # switched on: an offset pulls from now on
    for k, voltage in enumerate(voltages):
        machine.command(voltage, at=k * 0.001)
        motion.write(voltage)
        state = model.advance(state, voltage, 0.001, model.params)
        assert motion.read() == state[0]
        assert machine.advance((k + 1) * 0.001) == pytest.approx(motion.read(), abs=2e-6)


@given(voltages=VOLTAGES)
def test_without_its_extras_it_is_the_linear_axis(voltages: list[float]) -> None:
    plain = {key: value for key, value in MACHINE.axis("X").model.items() if key != "name"}
    models = [library_model(name, **plain) for name in ("machine-axis", "linear-axis")]
    moving = [model.motion(model, 0.001) for model in models if model.motion]
    for voltage in voltages:
        for motion in moving:
            motion.write(voltage)
        assert moving[0].read() == pytest.approx(moving[1].read(), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    ("delay", "T", "split"), [(0.003, 0.001, (3, 0.0)), (0.0, 0.001, (0, 0.0)), (0.0025, 0.001, (2, 0.0005))]
)
def test_a_delay_is_whole_samples_and_a_rest(delay: float, T: float, split: tuple[int, float]) -> None:
    assert split_delay(delay, T) == (split[0], pytest.approx(split[1], abs=1e-15))


def test_a_whole_delay_shifts_the_answer() -> None:
    plain, late = (library_model("machine-axis", tau=0.01, K=2.0, delay=delay) for delay in (0.0, 0.004))
    moving = [MachineAxisMotion(model, 0.001) for model in (plain, late)]
    tracks: list[list[float]] = [[], []]
    for k in range(50):
        for motion, track in zip(moving, tracks, strict=True):
            motion.write(5.0 if k % 20 < 10 else -5.0)
            track.append(motion.read())
    assert tracks[1][4:] == tracks[0][:-4]


@pytest.mark.parametrize(
    ("params", "said"),
    [
        ({"tau": 0.01}, "machine parameter K is missing"),
        ({"tau": 0.0, "K": 1.0}, "tau = 0.0"),
        ({"tau": 1, "K": 1, "x": 1}, "'x'"),
    ],
)
def test_impossible_parameters_are_refused(params: dict[str, float], said: str) -> None:
    with pytest.raises(InputError, match=said):
        library_model("machine-axis", **params)
