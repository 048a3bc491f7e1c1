"""The circular test: constructed circles with one known cause each, what is no circle, and a run of the mini CNC."""

from __future__ import annotations

from math import atan, cos, pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rds
from rds.core.errors import InputError
from rds.nc.bundled import find_bundled
from rds.nc.run.run import PartProgram
from rds.results.reports import Report, make_report

RADIUS, FEED = 20.0, 10.0  # mm, mm/s


def ideal(sense: int, radius: float = RADIUS, phase: float = 0.1, lags: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Two turns and a bit, as two axes with first-order lags (s) go them: time, x and y."""
    rate = FEED / radius
    time = np.arange(0.0, 4.6 * pi / rate, 0.005)
    x, y = (
        cos(atan(rate * lag)) * f(sense * rate * time + phase - sense * atan(rate * lag)) * radius
        for lag, f in zip(lags, (np.cos, np.sin), strict=True)
    )
    return np.column_stack([time, x, y])


def both_ways(**options: Any) -> np.ndarray:
    """A circle counter-clockwise, a second of rest, and the same clockwise."""
    one, other = (ideal(sense, **options) for sense in (1, -1))
    rest = np.column_stack([one[-1, 0] + np.arange(1, 200) * 0.005, *(np.full(199, last) for last in one[-1, 1:])])
    other[:, 0] += rest[-1, 0] + 0.005
    return np.vstack([one, rest, other])


def with_play(values: np.ndarray, play: float) -> np.ndarray:
    """What hangs behind a play of this width (mm)."""
    found = values.copy()
    for k in range(1, len(values)):
        found[k] = min(max(found[k - 1], values[k] - play / 2), values[k] + play / 2)
    return found


def report_of(folder: Path, table: np.ndarray, reference: np.ndarray | None = None, **options: Any) -> Report:
    file, heads = folder / "circle.csv", ["time [s]", "X_measured [mm]", "Y_measured [mm]"]
    if reference is not None:
        table, heads = np.column_stack([table, reference[:, 1:]]), [*heads, "X_reference [mm]", "Y_reference [mm]"]
    np.savetxt(file, table, delimiter=",", header=",".join(heads), comments="", fmt="%.9f")
    return make_report("circular", [file], options)


def causes(report: Report) -> dict[tuple[str, str], float]:
    """The causes that it names, by name and axis."""
    if not any(table.title == "Causes" for table in report.tables):
        return {}
    table = report.table("Causes")
    return dict(zip(zip(table.column("cause"), table.column("axis"), strict=True), table.column("value"), strict=True))


def test_a_true_circle_has_no_causes(tmp_path: Path) -> None:
    report = report_of(tmp_path, both_ways(), both_ways())
    table = report.table("Circular test")
    assert table.column("direction") == ["counter-clockwise", "clockwise", "both directions"]
    assert table.column("G [µm]") == pytest.approx([0.0] * 3, abs=1e-4)
    assert table.column("feed [mm/min]") == pytest.approx([600.0] * 3, rel=1e-6)
    assert not causes(report) and "no cause is above" in report.findings[-1]


@pytest.mark.parametrize("noise", [0.0, 0.0005])
@pytest.mark.parametrize(
    ("what", "axis", "value"),
    [
        ("scale mismatch", "X - Y", 40.0),
        ("squareness", "X, Y", 800.0),
        ("gain mismatch", "X - Y", 2.0),
        ("reversal step", "X", 15.0),
        ("reversal step", "Y", 25.0),
        ("reversal spike", "X", 12.0),
        ("reversal spike", "Y", 9.0),
        ("radius error", "X, Y", -22.36),
    ],
)
def test_each_cause_alone_is_found_and_no_other(
    tmp_path: Path, what: str, axis: str, value: float, noise: float
) -> None:
    wanted = both_ways()
    table = wanted.copy()
    if what == "scale mismatch":
        table[:, 1] *= 1 + 0.001 * value / (4 * RADIUS)
        table[:, 2] *= 1 - 0.001 * value / (4 * RADIUS)
    elif what == "squareness":
        table[:, 1] += value * 1e-6 / 2 * wanted[:, 2]
        table[:, 2] += value * 1e-6 / 2 * wanted[:, 1]
    elif what == "gain mismatch":
        table = both_ways(lags=(0.003 + value / 1e3, 0.003))
    elif what == "reversal step":
        table[:, "XY".index(axis) + 1] = with_play(wanted[:, "XY".index(axis) + 1], value / 1e3)
    elif what == "reversal spike":
        angle = np.unwrap(np.arctan2(wanted[:, 2], wanted[:, 1]))
        since = np.degrees(angle * np.where(np.arange(len(angle)) < len(angle) / 2, 1, -1) - "XY".index(axis) * pi / 2)
        bump = since % 180 / 4.0 * np.exp(1 - since % 180 / 4.0)  # at most 1, after 4 degrees
        column = "XY".index(axis) + 1
        table[:, column] += value / 1e3 * bump * np.sign(wanted[:, column]) * (since % 180 < 60)
    else:
        table = both_ways(lags=(0.095, 0.095))
    table[:, 1:] += noise * np.random.default_rng(4).standard_normal(table[:, 1:].shape)
    report = report_of(tmp_path, table, wanted)
    found = causes(report)
    assert found.pop((what, axis)) == pytest.approx(value, rel=0.05)
    assert not found
    if what == "reversal spike":
        spikes = report.table("Spikes after reversals")
        assert spikes.column("quadrant [deg]") == [0.0 + 90 * (axis == "Y"), 180.0 + 90 * (axis == "Y")] * 2
        assert spikes.column("peak after [deg]") == pytest.approx([4.0] * 4, abs=1.3 if noise else 0.5)
    if what == "radius error":
        assert "lags of 95 ms, as measured, would make it -22.5" in report.findings[-1]


def test_g_and_f_are_those_of_an_ellipse(tmp_path: Path) -> None:
    table = both_ways()
    table[:, 1] = table[:, 1] * (1 + 0.0005) + 0.004
    report = report_of(tmp_path, table, both_ways()).table("Circular test")
    assert report.column("G [µm]") == pytest.approx([10.0] * 3, abs=0.05)
    assert report.column("F max [µm]") == pytest.approx([14.0] * 3, abs=0.05)
    assert report.column("F min [µm]") == pytest.approx([0.0] * 3, abs=0.8)
    assert report.column("mean radius error [µm]") == pytest.approx([5.0] * 3, abs=0.05)
    assert report.column("centre, 1st axis [µm]") == pytest.approx([4.0] * 3, abs=0.05)


@settings(max_examples=8)
@given(
    x=st.floats(-300, 300),
    y=st.floats(-300, 300),
    radius=st.floats(4, 120),
    phase=st.floats(0, 6.28),
    first=st.booleans(),
)
def test_the_causes_do_not_depend_on_where_the_circle_is(
    tmp_path_factory: pytest.TempPathFactory, x: float, y: float, radius: float, phase: float, first: bool
) -> None:
    ways = [ideal(sense, radius, phase)[:: max(1, round(radius / 10))] for sense in (1, -1)]
    for way in ways:
        way[:, 1:] += np.column_stack([x + 4e-4 * way[:, 2], y - 0.02 / (2 * radius) * way[:, 2]])
    folder, files = tmp_path_factory.mktemp("circles"), []
    for name, way in zip("ab", ways if first else ways[::-1], strict=True):
        np.savetxt(folder / f"{name}.csv", way, delimiter=";", header="time [s];x_mm;y_mm", comments="", fmt="%.9f")
        files.append(folder / f"{name}.csv")
    found = causes(make_report("circular", files, {"radius": radius}))
    assert found["squareness", "X, Y"] == pytest.approx(400.0, rel=0.05)
    assert found.pop(("scale mismatch", "X - Y")) == pytest.approx(20.0, rel=0.05)
    assert not set(found) - {("squareness", "X, Y"), ("radius error", "X, Y")}


def test_one_direction_and_less_than_a_turn_are_said(tmp_path: Path) -> None:
    table = ideal(-1)[:4000] * (1, 1.0005, 1)
    turn = table[: int(0.9 * 2 * pi * RADIUS / FEED / 0.005)]
    report = report_of(tmp_path, turn)
    said = " ".join(report.findings)
    assert "clockwise: only 324° are at a steady feed" in said and "for lack of a circle counter-clockwise" in said
    assert report.table("Circular test").column("F max [µm]") == [None]


def test_what_is_no_circle_is_refused(tmp_path: Path) -> None:
    line = np.column_stack([np.arange(200) * 0.01, np.arange(200.0), 2 * np.arange(200.0)])
    still = np.column_stack([np.arange(200) * 0.01, np.zeros(200), np.zeros(200)])
    corner = np.linspace(0, 4, 401)[:-1]
    square = np.column_stack([corner, *(np.clip(2 - np.abs((corner + k) % 4 - 2), 0.5, 1.5) for k in (0, 1))])
    for table, said in (
        (line, "a circle at a steady feed, and this test needs 270°; measure two turns each way, as in"),
        (still, "move in 0 readings only"),
        (square, "this test needs 270°"),
        (ideal(1)[:1500], "X and Y go 21[45]° of a circle"),
    ):
        with pytest.raises(InputError, match=said):
            report_of(tmp_path, table)
    with pytest.raises(InputError, match="axes=X,Z: the linear axes in mm are X, Y; name two"):
        report_of(tmp_path, both_ways(), axes="X,Z")
    with pytest.raises(InputError, match="leave the option radius away"):
        report_of(tmp_path, both_ways(), both_ways(), radius=20)
    with pytest.raises(InputError, match=r"not all of 25 mm"):
        report_of(tmp_path, both_ways(), radius=25)


def test_the_program_on_the_mini_cnc_shows_the_friction_of_its_axes(tmp_path: Path) -> None:
    program = find_bundled("circular_test")
    PartProgram(program.path, program.machine, sample_period=0.005).run("simulation").save(tmp_path)
    report = make_report("circular", [tmp_path])
    steady = report.table("Circular test").column("steady [deg]")
    assert min(steady) > 700  # of two turns: run-in and run-out, by half circles of 10 mm, are left out
    found = causes(report)
    assert found.pop(("reversal step", "X")) == pytest.approx(42.0, abs=2.0)  # following errors of -12 and 30 µm
    assert found.pop(("reversal step", "Y")) == pytest.approx(51.0, abs=2.0)
    assert max(found.values(), default=0.0) < 2.0 and {name for name, _ in found} <= {"reversal spike"}
    beside = tmp_path / "result.json"
    beside.write_text(beside.read_text().replace('"ending": "done"', '"ending": "stopped", "verdict": "void"'))
    (tmp_path / "result.parquet").unlink()  # that holds its own description
    first, second, *_ = make_report("circular", [tmp_path / "result.csv"]).findings
    assert "its timing is void: samples were late or left out" in first and "ended early (stopped)" in second


def test_sines_that_are_a_quarter_of_a_period_apart_are_a_circle(tmp_path: Path) -> None:
    cosine, sine = ({"kind": "sinusoid", "amplitude": 10.0, "frequency": 0.2, "phase": phase} for phase in (90.0, 0.0))
    experiment = rds.Experiment(
        axis=("X", "Y"), reference=cosine, overrides={"Y": {"reference": sine}}, controller="p", duration=12.0
    )
    experiment.run().save(tmp_path / "sines.csv")
    report = make_report("circular", [tmp_path / "sines.csv"])
    (row,) = report.table("Circular test").rows
    assert row[1] == "counter-clockwise" and row[3] == pytest.approx(10.0) and row[2] >= 720
    assert "for lack of a circle clockwise" in " ".join(report.findings)


def test_a_form_that_is_another_has_no_confident_cause(tmp_path: Path) -> None:
    """The corners of a superellipse once were a reversal step of 1.8 mm, more than G itself."""
    table = both_ways()
    table[:, 1:] = RADIUS * np.sign(table[:, 1:]) * np.abs(table[:, 1:] / RADIUS) ** 0.9
    report = report_of(tmp_path, table)
    assert not causes(report)
    assert "it is noise, or has another cause" in report.findings[-1]


@pytest.mark.parametrize("change", [-10.0, 50.0])
def test_a_spiral_is_said_and_is_no_ellipse(tmp_path: Path, change: float) -> None:
    """A tenth of what its radius changes by was a scale mismatch."""
    table = both_ways()
    rate = FEED / RADIUS / (2 * pi)  # turns per second
    table[:, 1:] *= 1 + 1e-3 * change / RADIUS * rate * table[:, :1]
    report = report_of(tmp_path, table)
    assert not causes(report)
    spirals = [text for text in report.findings if "spiral" in text]
    said = [float(text.split("changes by ")[1].split(" µm in a turn")[0]) for text in spirals]
    assert said == pytest.approx([change, change], rel=0.01)


def test_a_centre_that_drifts_along_an_axis_is_no_spiral(tmp_path: Path) -> None:
    """A drift of 13 µm in a turn was a spiral of 7 µm, and what is left without that a reversal step."""
    table = ideal(1)
    table[:, 1] += np.linspace(0.0, 0.03, len(table))
    report = report_of(tmp_path, table)
    assert not any("spiral" in text for text in report.findings)
    assert not {"reversal step"} & {cause for cause, _ in causes(report)}


def test_a_reading_that_is_off_and_a_drift_are_no_friction(tmp_path: Path) -> None:
    """A spike stands at most reversals of its axis; these once were spikes of 250 and 3 µm."""
    glitch, drift = both_ways(), both_ways()
    glitch[len(glitch) // 4, 1] += 1.0
    drift[:, 1] += np.linspace(0.0, 0.02, len(drift))
    for table in (glitch, drift):
        assert not {"reversal spike"} & {cause for cause, _ in causes(report_of(tmp_path, table))}


@pytest.mark.filterwarnings("error")
def test_times_that_stand_still_are_no_steady_feed(tmp_path: Path) -> None:
    table = both_ways()
    table[:, 0] = 0.0
    with pytest.raises(InputError, match="0° of a circle at a steady feed"):
        report_of(tmp_path, table)
