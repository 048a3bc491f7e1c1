"""Two clocks: offset and drift recovered within their stated uncertainty; units converted exactly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.identification.logs.clocks import align, hold, resample
from rds.identification.logs.read_log import read_log
from rds.identification.logs.units import dimension, factor
from tests.logs.data_files import axis, headed, write


def recordings(seed: int, offset: float, drift: float) -> tuple[np.ndarray, ...]:
    """Two recordings of one motion, 10 s: at 1 kHz in steps of 1 µm, at 1.43 kHz in other units and coarser steps."""
    random = np.random.default_rng(seed)
    parts = list(zip(random.uniform(0.3, 3, 6), random.uniform(0, 6, 6), random.uniform(1, 5, 6), strict=True))

    def motion(t: np.ndarray) -> np.ndarray:
        return sum((a * np.sin(2 * np.pi * f * t + p) for f, p, a in parts), np.zeros_like(t))

    first = np.arange(0.0, 10.0, 0.001)
    true = np.arange(0.3, 9.8, 0.0007)
    second = (true - offset + 5.0 * drift) / (1.0 + drift)
    return first, np.round(motion(first), 3), second, 2.0 + np.round(3.0 * motion(true) / 0.005) * 0.005, true


@settings(max_examples=15)
@given(seed=st.integers(0, 10_000), offset=st.floats(-1e3, 1e3), drift=st.floats(-2e-4, 2e-4))
def test_a_second_clock_is_recovered_to_a_microsecond(seed: int, offset: float, drift: float) -> None:
    *given_, true = recordings(seed, offset, drift)
    found = align(*given_)
    assert np.abs(found.to_first(given_[2]) - true).max() < 2e-6  # s; the sample periods are 1 and 0.7 ms
    assert abs(found.drift - drift) < 3e-7


def test_the_stated_uncertainty_is_that_of_the_errors() -> None:
    scores = []
    for seed in range(30):
        *given_, true = recordings(seed, 12.5, 50e-6)
        found = align(*given_)
        at = int(np.argmin(np.abs(given_[2] - found.centre)))
        centre = given_[2][at]
        scores.append((found.to_first(given_[2][at : at + 1])[0] - true[at]) / found.uncertainty(float(centre)))
    assert 0.6 < np.std(scores) < 1.6  # 30 standard scores: 1 ± 0.13
    assert np.max(np.abs(scores)) < 4.5


def test_a_periodic_motion_does_not_tell_an_offset_and_a_window_helps() -> None:
    t = np.arange(0.0, 10.0, 0.001)
    with pytest.raises(InputError, match="the motion repeats itself; give window"):
        align(t, np.sin(2 * np.pi * t), t, np.sin(2 * np.pi * (t + 0.05)))
    found = align(t, np.sin(2 * np.pi * t), t, np.sin(2 * np.pi * (t + 0.05)), window=0.4)
    assert found.offset == pytest.approx(0.05, abs=1e-6)


def test_motions_that_are_not_one_are_refused() -> None:
    random = np.random.default_rng(1)
    t = np.arange(0.0, 5.0, 0.001)
    with pytest.raises(InputError, match="do not look like one motion"):
        align(t, random.normal(size=len(t)), t, random.normal(size=len(t)))
    with pytest.raises(InputError, match="is constant"):
        align(t, np.ones_like(t), t, random.normal(size=len(t)))
    with pytest.raises(InputError, match="the second file's column for the alignment holds no numbers"):
        align(t, random.normal(size=len(t)), t[:0], t[:0])


def test_resampling_states_its_error_and_keeps_it() -> None:
    t = np.arange(0.0, 2.0, 0.01)
    grid = np.arange(0.005, 1.9, 0.001)
    values, error = resample(t, np.sin(5.0 * t), grid)
    worst = np.abs(values - np.sin(5.0 * grid)).max()
    assert 0.9 * error < worst <= 1.02 * error
    assert hold(np.array([0.0, 1.0]), np.array([5.0, 7.0]), np.array([0.5, 1.0, 3.0])).tolist() == [5.0, 7.0, 7.0]


def test_command_and_position_of_two_recorders_become_one_log(tmp_path: Path) -> None:
    made = axis()
    position = made["position"]
    write(tmp_path / "host.csv", {"time [s]": made["time"], "u [V]": made["voltage"], "seen [mm]": position})
    clock = (made["time"] - 7.25) / (1 + 30e-6)
    write(tmp_path / "scope.csv", {"t [ms]": clock * 1e3, "probe [um]": position * 1e3})
    map_file = tmp_path / "host.csv.map.toml"
    map_file.write_text("""
[time]
column = "time"
[second]
file = "scope.csv"
time = { column = "t" }
same = { first = "seen", second = "probe" }
[axis.X]
command = "u"
position = { column = "probe", second = true }
""")
    (log,) = read_log(tmp_path / "host.csv")
    inside = (made["time"] >= log.time[0]) & (made["time"] <= log.time[-1])
    assert np.abs(log.position - position[inside]).max() < 1.1e-3  # mm, the encoder's step
    stamp = next(clock for clock in log.clocks if clock.quantities == ("position",))
    assert stamp.drift == pytest.approx(30e-6, abs=2e-6)
    assert 0.0 < stamp.uncertainty < 2e-5
    assert {"clock", "resampling"} <= {finding.kind for finding in log.findings}
    map_file.write_text(map_file.read_text().replace('file = "scope.csv"', 'file = "scope.csv"\noffset = 7.25'))
    (log,) = read_log(tmp_path / "host.csv")
    assert any("as the map states" in finding.what for finding in log.findings)


@pytest.mark.parametrize(
    ("unit", "to", "value"),
    [
        ("m", "mm", 1000.0),
        ("µm", "mm", 1e-3),
        ("μm", "mm", 1e-3),
        ("in", "mm", 25.4),
        ("ms", "s", 1e-3),
        ("ns", "s", 1e-9),
        ("mV", "V", 1e-3),
        ("rpm", "rev/min", 1.0),
        ("rad/s", "rev/min", 30.0 / np.pi),
        ("rad", "deg", 180.0 / np.pi),
        ("m/min", "mm/s", 1000.0 / 60.0),
        ("°", "deg", 1.0),
    ],
)
def test_units(unit: str, to: str, value: float) -> None:
    assert factor(unit, to) == pytest.approx(value, rel=1e-14)
    assert factor(to, unit) == pytest.approx(1.0 / value, rel=1e-14)


def test_units_that_do_not_match_or_are_unknown() -> None:
    with pytest.raises(InputError, match="mm measures length, and V measures voltage"):
        factor("mm", "V")
    with pytest.raises(InputError, match="unit 'furlong' is unknown; known units: s, ms"):
        factor("furlong", "mm")
    assert dimension("MV") is None  # the case of a unit is its meaning


def test_headed_columns_are_guessed_and_said(tmp_path: Path) -> None:
    (log,) = read_log(write(tmp_path / "log.csv", headed(axis())))
    said = [f.what for f in log.findings if f.kind == "map"]
    assert said == [
        "guessed: time is 'time' [s]",
        "guessed: command of axis is 'voltage' [V]",
        "guessed: position of axis is 'position' [mm]",
    ]
    assert np.array_equal(log.command, axis()["voltage"])
