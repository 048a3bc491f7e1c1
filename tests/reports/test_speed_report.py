"""The report on a speed loop: the responses of mrm-control's figure 8, made by the examples."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rds
from rds.core.errors import InputError
from rds.results.reports import make_report

EXAMPLES = Path(__file__).parents[2] / "examples"


def rows(tmp_path, name, **options):
    rds.Experiment.from_toml(EXAMPLES / name).run("simulation", out=tmp_path / "run")
    report = make_report("speed", [tmp_path / "run" / "result.csv"], {"pulse": 0.005, **options})
    return report, report.tables[0].rows


def test_the_step_to_1200_pulses_rises_in_400_ms_with_less_than_5_percent_overshoot(tmp_path):
    report, (row,) = rows(tmp_path, "speed_step.toml")
    _, start, level, rise, overshoot, mean, error = row
    assert (start, level) == (0.0, pytest.approx(1200.0))
    assert rise == pytest.approx(0.4, abs=0.01)  # s; the paper's 400 ms
    assert overshoot < 5.0
    assert mean == pytest.approx(1200.0, rel=0.005)  # the paper's mean error
    assert abs(error) < 0.5
    assert "rise time" in report.findings[0] and "overshoot" in report.findings[0]


def test_the_ramps_to_400_and_1200_pulses_are_followed(tmp_path):
    _, (low, high) = rows(tmp_path, "speed_ramps.toml")
    assert (low[2], high[2]) == (pytest.approx(400.0), pytest.approx(1200.0))
    assert high[1] == pytest.approx(4.5, abs=0.01)
    for row in (low, high):
        assert row[3] == pytest.approx(0.56, abs=0.1)  # s: 80 % of a ramp of 700 ms
        assert row[4] < 5.0
        assert abs(row[6]) < 0.5


def table(path, times, velocity, position):
    lines = ["time [s],X_reference_velocity [mm/s],X_measured [mm]"]
    lines += [f"{t:.6f},{v:.9g},{x:.9g}" for t, v, x in zip(times, velocity, position, strict=True)]
    path.write_text("\n".join(lines))
    return path


def test_a_first_order_response_has_its_own_rise_time(tmp_path):
    """v = 1 - e^(-t/τ): from 10 % to 90 % in τ ln 9; and twice as fast a second level."""
    tau, t = 0.1, np.arange(0.0, 2.0, 1e-3)
    file = table(tmp_path / "run.csv", t, np.ones_like(t), t - tau * (1.0 - np.exp(-t / tau)))
    row = make_report("speed", [file], {"window": 0.002}).tables[0].rows[0]
    assert row[3] == pytest.approx(tau * np.log(9.0), abs=2e-3)
    assert row[4] == pytest.approx(0.0, abs=0.01)


def test_a_table_without_a_level_is_refused(tmp_path):
    t = np.arange(0.0, 2.0, 1e-2)
    with pytest.raises(InputError, match=r"stays nowhere for 0\.5 s other than at 0"):
        make_report("speed", [table(tmp_path / "run.csv", t, np.sin(t), t)])
    (tmp_path / "other.csv").write_text("a,b\n1,2\n3,4\n")
    with pytest.raises(InputError, match="no columns time and X_reference_velocity"):
        make_report("speed", [tmp_path / "other.csv"])
    with pytest.raises(InputError, match="axis = 'Q' is not in the table; it has X"):
        make_report("speed", [table(tmp_path / "run.csv", t, np.ones_like(t), t)], {"axis": "Q"})
