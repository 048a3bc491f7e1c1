"""The main job: the paper's experiment in three modes, with the published numbers beside ours."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

import rds
from rds.cli import demo
from rds.cli.main import app


def test_the_gains_are_those_of_table_2() -> None:
    """Within half of the last printed digit; Z's g2 is printed without its sign."""
    half = {"g1": 5.0, "g2": 0.05, "L": 0.05, "F": 0.5, "G": 50.0, "H": 0.05}
    table = demo.design_table()
    for printed, ours in zip(table["rows"][::2], table["rows"][1::2], strict=True):
        for name, theirs, mine in zip(half, printed[1:], ours[1:], strict=True):
            sign = -1.0 if (printed[0], name) == ("Z printed", "g2") else 1.0
            assert float(mine) == pytest.approx(sign * float(theirs), abs=half[name] * (1 + 1e-9)), (printed[0], name)


def test_the_steady_errors_are_the_analytic_ones() -> None:
    result = rds.Experiment(
        axis=demo.AXES,
        duration=10.0,
        reference=rds.sinusoid(5.0, 0.2),
        controller={"name": "tracking", "poles": [[-32, 24], [-32, -24]], "observer_pole": -320},
    ).run()
    rows = demo.steady_table(result)["rows"]
    assert len(rows) == 6
    assert all(abs(float(deviation)) < 1.0 for *_, deviation in rows)
    assert float(rows[0][1]) == pytest.approx(30.0, abs=0.05)  # µm, X forward


@pytest.mark.realtime
def test_the_demo(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(demo, "FREQUENCY", 0.5)  # a faster sine has its second way back sooner
    monkeypatch.setattr(demo.run_demo, "__defaults__", (3.3,))
    done = CliRunner().invoke(app, ["demo", "--out", "out", "--json"])
    said = json.loads(done.stdout)
    verdicts = {mode: outcome["verdict"] for mode, outcome in said["modes"].items()}
    assert list(verdicts) == ["simulation", "emulation", "implementation"]
    assert verdicts["simulation"] is None
    assert done.exit_code == (1 if "missed" in verdicts.values() else 0), done.stderr
    for table, title in zip(
        said["tables"],
        [
            "Controller gains and observer parameters",
            "Tracking error",
            "Error in steady motion",
            "Velocity and its estimate",
            "Timing at 1 kHz",
        ],
        strict=True,
    ):
        assert table["title"].startswith(title)
    assert all(row[2] != "nan" for row in said["tables"][2]["rows"])
    assert all((alone / path).is_file() for path in said["files"].values())
    estimates = {row[0]: float(row[2]) for row in said["tables"][3]["rows"]}
    assert set(estimates) == {f"{axis} {mode}" for axis in "XYZ" for mode in ("simulation", "emulation")}
    assert all(0.05 < rms < 0.35 for rms in estimates.values())  # mm/s: what friction does to the observer
    simulated, emulated = (rds.open_result(alone / "out" / mode) for mode in ("simulation", "emulation"))
    assert all((simulated[name] == emulated[name]).all() for name in simulated.columns)
    report = (alone / "out" / "report.html").read_text()
    assert report.count("signals of the controllers") == 3
    assert "Table 3" in report or "table 3" in report
