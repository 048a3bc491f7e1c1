"""A user's function of time, and a user's CSV file."""

from __future__ import annotations

import numpy as np
import pytest

from rds.core.errors import ContractError, InputError
from rds.references import make_signal, sample, sinusoid, user

T = 1e-3


def write(folder, text, name="signal.csv"):
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return file


def wave_rows(columns, seconds=5.0, step=0.01):
    t = np.arange(0, seconds + step / 2, step)
    parts = [t, *sinusoid(5, 0.2).reference(t)][:columns]
    return "\n".join(",".join(f"{value:.10g}" for value in row) for row in zip(*parts, strict=True))


def test_function_gets_the_derivatives_of_its_values():
    wave = sinusoid(5, 2.0)
    built = sample(user(lambda t: 5 * np.sin(2 * np.pi * 2.0 * t)), T, 1000)
    exact = sample(wave, T, 1000)
    np.testing.assert_allclose(built.position, exact.position, atol=1e-12)
    np.testing.assert_allclose(built.velocity, exact.velocity, atol=1e-6)
    np.testing.assert_allclose(built.acceleration, exact.acceleration, atol=2e-3)


def test_function_is_not_asked_for_negative_times():
    built = sample(user(lambda t: np.sqrt(t + 1e-6) if t >= 0 else 1 / 0), T, 10)
    assert np.isfinite(built.velocity).all()


def test_function_may_bring_its_own_derivatives():
    built = sample(user(lambda t: (t**2, 2 * t, 2.0)), T, 100)
    t = np.arange(100) * T
    np.testing.assert_allclose([built.position, built.velocity, built.acceleration], [t**2, 2 * t, 2 + 0 * t])


@pytest.mark.parametrize("answer", ["up", None, float("nan"), [1.0, 2.0], [1.0, 2.0, float("inf")]])
def test_functions_that_give_no_number_break_the_contract(answer):
    with pytest.raises(ContractError, match="one finite number"):
        user(lambda t: answer).value(0.5)


def test_functions_that_fail_are_named_with_the_time():
    def broken(t):
        return 1 / (t - 0.5)

    with pytest.raises(
        ContractError, match=r"broken\(t\) fails at t = 0.5 s: .*, line 54, in broken: ZeroDivisionError"
    ):
        user(broken).value([0.0, 0.5])


@pytest.mark.parametrize(
    "header", ["", "time,value\n", "t (s), position (mm)\n", "# my data\n\ntime,value\n", "\ufeff"]
)
def test_rows_of_time_and_value_make_a_smooth_reference(tmp_path, header):
    signal = make_signal("user", file=str(write(tmp_path, header + wave_rows(2))))
    built, exact = sample(signal, T, 5000), sample(sinusoid(5, 0.2), T, 5000)
    np.testing.assert_allclose(built.position, exact.position, atol=1e-6)
    np.testing.assert_allclose(built.velocity, exact.velocity, atol=1e-4)
    np.testing.assert_allclose(built.acceleration, exact.acceleration, atol=2e-2)


def test_a_voltage_runs_straight_between_its_rows_and_nowhere_beyond_them(tmp_path):
    signal = user(file=write(tmp_path, "0,0\n1,2\n2,2\n3,-2\n"))
    np.testing.assert_allclose(signal.value([0, 0.5, 1, 1.5, 2.5, 3, 9]), [0, 1, 2, 2, 0, -2, -2])


def test_hold_and_linear_rule_voltage_and_reference_alike(tmp_path):
    file = write(tmp_path, "1,3\n2,5\n4,1\n")
    held = user(file=file, interpolation="hold")
    np.testing.assert_allclose(held.value([0, 1, 1.999, 2, 3.9, 4, 5]), [3, 3, 3, 5, 5, 1, 1])
    assert held.reference(3.0) == (5.0, 0.0, 0.0)
    linear = user(file=file, interpolation="linear")
    assert linear.reference(3.0) == (3.0, -2.0, 0.0)
    assert linear.reference(9.0) == (1.0, 0.0, 0.0)


def test_rows_are_reached_at_their_sample_in_spite_of_rounding(tmp_path):
    text = "\n".join(f"{k * 0.1:.1f},{k}" for k in range(50))
    held = user(file=write(tmp_path, text), interpolation="hold")
    np.testing.assert_array_equal(held.value(np.arange(50) * 0.1), np.arange(50))


def test_rows_that_begin_later_repeat_from_there(tmp_path):
    """Rows at 0.3 and 0.7 s, every second: from the last row to the next first one it stays."""
    rows = write(tmp_path, "0.3,1\n0.7,5\n")
    signal = user(file=rows, interpolation="linear", period=1.0)
    np.testing.assert_allclose(
        signal.value(np.array([0.2, 0.3, 0.5, 0.7, 0.9, 1.2, 1.3, 1.6])), [5, 1, 3, 5, 5, 5, 1, 4]
    )


def test_rows_repeat_with_a_period(tmp_path):
    signal = user(file=write(tmp_path, "0,0\n1,2\n2,0\n"), period=2.0)
    np.testing.assert_allclose(signal.value([0.5, 2.5, 3.0, 7.0]), [1, 1, 2, 2])
    with pytest.raises(InputError, match="longer than period"):
        user(file=write(tmp_path, "0,0\n1,2\n2,0\n"), period=1.0)


@pytest.mark.parametrize("samples", [2, 3, 5, 10, 30])
@pytest.mark.parametrize("interpolation", ["hold", "linear", "spline"])
def test_a_period_begins_at_its_sample_in_spite_of_rounding(tmp_path, interpolation, samples):
    period = round(samples * T, 6)
    file = write(tmp_path, f"0,0\n{0.3 * period},2\n{0.95 * period},5\n")
    repeated = sample(user(file=file, interpolation=interpolation, period=period), T, 50 * samples)
    for part in repeated:
        first = part[:samples]
        np.testing.assert_allclose(part.reshape(-1, samples), np.tile(first, (50, 1)), atol=1e-6 * np.ptp(first) + 1e-9)


def test_rows_with_velocity_and_acceleration_are_kept(tmp_path):
    file = write(tmp_path, "time,position,velocity,acceleration\n" + wave_rows(4, step=0.05))
    built, exact = sample(user(file=file), T, 5000), sample(sinusoid(5, 0.2), T, 5000)
    np.testing.assert_allclose(built.position, exact.position, atol=1e-7)
    np.testing.assert_allclose(built.velocity, exact.velocity, atol=1e-6)
    np.testing.assert_allclose(built.acceleration, exact.acceleration, atol=1e-4)


def test_a_trapezoidal_profile_belongs_together_though_its_acceleration_jumps(tmp_path):
    user(file=write(tmp_path, "0,0,0,10\n0.1,0.05,1,10\n0.2,0.15,1,0\n0.3,0.25,1,0\n0.4,0.3,0,-10\n"))


def test_rows_to_either_side_of_the_peak_of_an_acceleration_belong_together(tmp_path):
    """Ten rows a period: between those beside the peak the acceleration is higher than at both."""
    t = 0.01 * np.arange(-0.5, 30)
    wave = np.sin(20 * np.pi * t + np.pi / 2)
    rows = np.column_stack((t, wave, 20 * np.pi * np.cos(20 * np.pi * t + np.pi / 2), -((20 * np.pi) ** 2) * wave))
    user(file=write(tmp_path, "\n".join(",".join(map(repr, row)) for row in rows.tolist())))


@pytest.mark.parametrize(
    "text, line, fault",
    [
        ("time,value\n0,1\n1,x\n", 3, "value = 'x' must be a finite number"),
        ("0,1\n1,nan\n", 2, "finite"),
        ("0,1\n1,inf\n", 2, "finite"),
        ("0,1\n0,2\n", 2, "must increase"),
        ("0,1\n2,1\n1,2\n", 3, "must increase"),
        ("0,1\n1,2,3,4\n", 2, "4 columns, the ones before it 2; repair or remove it"),
        ("0,1,2\n", 1, "3 columns; it needs time,value or"),
        ("0;1\n1;2\n", 1, "1 column; it needs"),
        ("time [ms],value\n0,1\n500,2\n", 1, "the column 'time [ms]' is in ms; give the time in s"),
        ("time,value (desired)\n0,1\n1,2\n", 1, "give the value in mm or V, and a heading with that unit or none"),
        ("time_s,value (m)\n0,1\n1,2\n", 1, "the column 'value (m)' is in m; give the value in mm or V"),
        ("t,p,v [mm/s],a [m/s²]\n0,0,0,0\n1,0,0,0\n", 1, "give the acceleration in mm/s²"),
        ("time,position_m\n0,1\n1,2\n", 1, "the column 'position_m' is in m; give the value in mm or V"),
        ("t/ms,u/V\n0,1\n500,2\n", 1, "the column 't/ms' is in ms; give the time in s"),
        ("value,time\n1,0\n", 1, "the first column is 'value'"),
        ("0,0,1,0\n1,1,1,0\n2,5,1,0\n", 3, "must belong together"),
        ("0,0,0,0\n1,0.5,1,0\n2,2,2,0\n", 2, "must belong together"),
        ("0,1\n", None, "1 rows of numbers; a signal needs at least two"),
        ("time,value\n", None, "0 rows"),
        ("", None, "0 rows"),
    ],
)
def test_bad_files_are_refused_with_file_and_line(tmp_path, text, line, fault):
    file = write(tmp_path, text)
    with pytest.raises(InputError) as error:
        make_signal("user", file=str(file))
    assert str(error.value).startswith(f"{file}:{line}: " if line else f"{file}: ")
    assert fault in str(error.value)


def test_files_that_cannot_be_read_are_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        user(file=tmp_path / "none.csv")
    with pytest.raises(InputError, match="cannot be read"):
        user(file=tmp_path)
    binary = tmp_path / "binary.csv"
    binary.write_bytes(b"\xff\xfe0,1")
    with pytest.raises(InputError, match="UTF-8"):
        user(file=binary)


@pytest.mark.parametrize(
    "options, fault",
    [
        ({"function": np.sin, "file": "a.csv"}, "not both"),
        ({"function": "sin"}, "must be a function"),
        ({"file": 5}, "name of a CSV file"),
        ({"function": np.sin, "interpolation": "linear"}, "is for a file"),
        ({"file": "a.csv", "interpolation": "cubic"}, "known ones: spline, linear, hold"),
        ({"function": np.sin, "period": 0}, "more than 0"),
    ],
)
def test_bad_options_are_refused(options, fault):
    with pytest.raises(InputError) as error:
        user(**options)
    assert fault in str(error.value)


@pytest.mark.parametrize("heading", ["t,v_in", "t,u_min", "t,x_m", "Time [S],Value [MM]", "t (s),u (v)", "t/s,u/V"])
def test_an_index_and_capitals_in_a_heading_are_no_other_unit(tmp_path, heading):
    file = write(tmp_path, heading + "\n0,1\n1,2\n")
    assert sample(make_signal("user", file=str(file)), 0.5, 3).position.tolist() == [1.0, 1.5, 2.0]
