"""The parts of a module by themselves: encoder counting, debouncing, the controller, the sensors' figures."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.bus.modules.oacs import pid
from rds.bus.modules.oacs.codes import DUTY, Parameter, Select
from rds.bus.modules.oacs.module_data import read_modules
from rds.bus.modules.oacs.pid import Memory, Tuning
from rds.bus.modules.oacs.plant import Plant
from rds.bus.modules.oacs.quadrature import Counter, Interrupts, decode, highest_rate, levels
from rds.bus.modules.oacs.sensors import gravities, motor_current, vibrating
from rds.bus.modules.oacs.switches import Debouncer, LimitSwitch
from rds.bus.modules.rds.module import machine_parameters
from rds.core.errors import InputError
from rds.machines import load_machine

SLOW = Interrupts(0.2e-3, 4e-3, 48e-3)  # the A axis's board


def turn(counter: Counter, counts: float, rate: float, start: float = 0.0) -> None:
    """Turn by `counts` at `rate` counts/s in steps of 1 ms."""
    way, now, step = 0.0, start, 1e-3
    while abs(way) < abs(counts):
        further = way + (rate if counts > 0 else -rate) * step
        counter.move(way, further, now, now + step)
        way, now = further, now + step


# --- quadrature


@pytest.mark.parametrize("count, a, b", [(0, False, False), (1, True, False), (2, True, True), (3, False, True)])
def test_the_channels_are_a_quarter_apart(count: int, a: bool, b: bool) -> None:
    assert levels(count) == levels(count + 4) == (a, b)


def test_table_13() -> None:
    """Rising edges, as the table has them: the other channel's level says which way."""
    assert decode("A", a=True, b=False) == 1, "interrupt of A, B low: clockwise"
    assert decode("A", a=True, b=True) == -1, "interrupt of A, B high: counter-clockwise"
    assert decode("B", a=False, b=True) == -1, "interrupt of B, A low: counter-clockwise"
    assert decode("B", a=True, b=True) == 1, "interrupt of B, A high: clockwise"


@given(st.lists(st.floats(-50, 50), min_size=1, max_size=20))
def test_a_quick_processor_loses_nothing(ways: list[float]) -> None:
    counter, now, position = Counter(Interrupts(1e-9)), 0.0, 0.0
    for way in ways:
        counter.move(position, position + way, now, now + 1.0)
        position, now = position + way, now + 1.0
        counter.move(position, position, now, now + 1.0)
        assert counter.recorded == counter.true and abs(counter.true - position) <= 0.5 + 1e-9


@pytest.mark.parametrize("direction", [1, -1])
def test_63_of_67_counts_per_degree_arrive(direction: int) -> None:
    """Section 9.5, at the speeds of table O35: 314 degrees/min clockwise and 388 counter-clockwise, on average."""
    recorded = []
    for speed in (314.0 / 60.0, 388.0 / 60.0):
        counter = Counter(SLOW)
        turn(counter, direction * 345 * 67, speed * 67)
        recorded.append(abs(counter.recorded) / 345.0)
        assert 61.5 < recorded[-1] < 64.5
        assert counter.missing == pytest.approx(345 * 67 - abs(counter.recorded), abs=1024), "the index pulses tell"
    assert sum(recorded) / 2 == pytest.approx(63.0, abs=0.5)


@pytest.mark.parametrize("speed", [314.0 / 60.0, 388.0 / 60.0])
def test_with_half_the_encoder_nothing_is_lost(speed: float) -> None:
    """Section 9.5: 512 counts per turn, 33 counts per degree."""
    counter = Counter(SLOW, counts_per_turn=512)
    turn(counter, 345 * 33.5, speed * 33.5)
    assert counter.recorded == pytest.approx(345 * 33.5, abs=2) and counter.missing == pytest.approx(0, abs=2)


@given(st.floats(0.05, 0.99), st.floats(0, 4e-3), st.floats(1e-5, 1e-3))
def test_below_the_highest_rate_nothing_is_lost(share: float, pause: float, service: float) -> None:
    interrupts = Interrupts(service, pause, 0.05)
    counter = Counter(interrupts)
    turn(counter, 300, share * highest_rate(interrupts))
    counter.move(counter.true, counter.true, 1e3, 1e3)  # time to serve the last ones
    assert counter.recorded == counter.true


def test_more_edges_than_it_can_serve_are_lost() -> None:
    counter = Counter(Interrupts(10e-3))
    turn(counter, 1000, 1000.0)
    assert counter.lost > 0 and counter.recorded < 500


# --- debouncing


@given(st.lists(st.tuples(st.floats(1e-4, 0.0999), st.booleans()), max_size=30))
def test_no_glitch_shorter_than_the_time_counts(glitches: list[tuple[float, bool]]) -> None:
    debouncer, now = Debouncer(0.1), 0.0
    for length, level in glitches:
        debouncer.feed(level, now)
        now += length
        debouncer.feed(True, now)  # back before the time is over
        now += 1e-3
    assert debouncer.level


def test_a_level_counts_after_exactly_the_time() -> None:
    debouncer = Debouncer(0.1)
    debouncer.feed(False, 5.0, mark=42)
    assert debouncer.due == pytest.approx(5.1)
    assert not debouncer.settle(5.0999) and debouncer.level
    assert debouncer.settle(5.1) and not debouncer.level and debouncer.mark == 42


def test_bouncing_starts_the_time_again() -> None:
    debouncer = Debouncer(0.1)
    for k in range(10):
        debouncer.feed(bool(k % 2), 0.05 * k)
    debouncer.feed(False, 0.5)
    assert not debouncer.settle(0.599) and debouncer.settle(0.6)


def test_a_broken_wire_opens_a_switch() -> None:
    switch = LimitSwitch(10.0, 1, 0.1)
    assert not switch.look(0.0, 1.0, 0) and not switch.open
    switch.wire = False
    switch.look(0.0, 1.1, 0)
    assert switch.look(0.0, 1.2, 0) and switch.open


# --- the controller


def test_the_first_iteration_kicks() -> None:
    output, memory = pid.step(1.0, Memory(), Tuning())
    assert output == DUTY and memory == (0.5, 1.0, 1)
    output, _ = pid.step(1.0, memory, Tuning())
    assert output == pytest.approx(1.5 * 1.0 + 1.5 * 1.0)


def test_pi_has_no_derivative_and_pid_has() -> None:
    memory = Memory(0.0, 10.0, 3)
    plain = pid.step(20.0, memory, Tuning(Select.PI, Kp=1.0, Ki=0.0, Kd=5.0))[0]
    assert plain == 20.0
    assert pid.step(20.0, memory, Tuning(Select.PID, Kp=1.0, Ki=0.0, Kd=5.0))[0] == 20.0 + 5.0 * 10.0 / 0.5


@given(st.lists(st.floats(-1e5, 1e5), min_size=1, max_size=50), st.floats(0, 1e3), st.floats(0, 1e3))
def test_integral_and_output_keep_their_limits(errors: list[float], Kp: float, Ki: float) -> None:
    tuning, memory = Tuning(Kp=Kp, Ki=Ki, Kd=0.1), Memory()
    for error in errors:
        output, memory = pid.step(error, memory, tuning)
        assert abs(memory.integral) <= 200.0 and 0.0 <= output <= 255.0


@pytest.mark.parametrize(
    "parameter, value", [(Parameter.KP, -1.0), (Parameter.SAMPLE_TIME, 0.0), (Parameter.OUTPUT_LOW, 256.0)]
)
def test_impossible_gains_are_refused(parameter: Parameter, value: float) -> None:
    with pytest.raises(InputError, match="must be a number from"):
        Tuning().with_parameter(parameter, value)


# --- the sensors


def test_readings_at_rest_are_gravity() -> None:
    """Table 19's 404, 522, 499 with 3.3 V for 1024 levels."""
    x, y, z = (gravities(reading) for reading in (404, 522, 499))
    assert (x, y, z) == pytest.approx((-1.05, 0.10, -0.13), abs=0.01)
    assert (x * x + y * y + z * z) ** 0.5 == pytest.approx(1.06, abs=0.01)


def test_vibration_stays_in_ten_bits_and_stops_with_the_shaft() -> None:
    assert vibrating((404, 522, 499), (40, 40, 40), 0.0, 3.0) == [404, 522, 499]
    assert all(
        0 <= reading < 1024 for k in range(100) for reading in vibrating((10, 1010, 500), (90, 90, 90), 1.0, k * 0.01)
    )


def test_current_falls_from_start_to_run() -> None:
    assert motor_current(12.0, 0.0, 4.8, 2.6, 12.0, 130.0) == pytest.approx(4.8)
    assert motor_current(12.0, 130.0, 4.8, 2.6, 12.0, 130.0) == pytest.approx(2.6)
    assert motor_current(0.0, 0.0, 4.8, 2.6, 12.0, 130.0) == 0.0


# --- the axis


def test_an_axis_that_is_cut_comes_to_rest() -> None:
    machine = load_machine("mrmt-oacs")
    axis = machine.axis("X")
    plant = Plant(machine_parameters(axis), read_modules(machine)["X"], 0.0)
    plant.command(10.0, 0.0)
    plant.advance(2.0)
    assert plant.velocity > 1.0  # mm/s
    plant.cut(2.0)
    plant.advance(4.0)
    assert plant.velocity == 0.0 and plant.voltage == 0.0
