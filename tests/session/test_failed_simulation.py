"""A simulation that fails keeps everything up to the fault, in Python and in the panels, as a real-time run does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rds
from rds.core.errors import ContractError
from rds.modes.experiment.experiment import FailedRun
from rds.panels.equipment.state import Equipment
from rds.panels.equipment.strip import end_marks
from rds.panels.session import Session
from rds.panels.session.kept_runs import State
from rds.results.plots import response

# line 3 fails, but not before 0.25 s
LATE = """def control(t, r, y, state, params):
    if t > 0.25:
        return undefined, state
    return 9.0 * (r.position - y), state
"""


def test_the_samples_up_to_the_fault_are_saved_and_marked(tmp_path: Path) -> None:
    (tmp_path / "late.py").write_text(LATE)
    experiment = rds.Experiment(
        duration=1.0, reference=rds.sinusoid(2.0, 1.0), controller={"file": str(tmp_path / "late.py")}
    )
    with pytest.raises(FailedRun, match=r"late\.py, line 3.*the samples up to then are in .*out") as failed:
        experiment.run(out=tmp_path / "out")
    kept = rds.open_result(tmp_path / "out")
    assert len(kept) == 251 and kept.meta["ending"] == "fault" and "line 3" in kept.meta["ending_reason"]
    assert np.array_equal(kept["X_measured"], failed.value.result["X_measured"])
    (line,) = [line for line in response(kept).axes[0].lines if line.get_label() == "fault"]
    assert line.get_xdata()[0] == kept["time"][-1] == pytest.approx(0.25)
    with pytest.raises(ContractError, match="line 3"):  # nobody asked for files
        experiment.run()


@pytest.mark.usefixtures("nothing_drawn")
def test_a_panel_shows_the_run_up_to_its_fault(tmp_path: Path) -> None:
    (tmp_path / "late.py").write_text(LATE.replace("0.25", "0.4"))
    equipment = Equipment(Session(tmp_path), "control")
    for name, value in {"controller": "user", "controller_file": "late.py", "duration": 1.0}.items():
        equipment.choices.set(name, value)
    run = equipment.run()
    run._prepare = None  # the check of the file would find the fault before it runs
    run.start()
    assert run.wait(60) and run.result is not None and "line 3" in str(run.error)
    rows = run.new_rows()
    assert rows[-1, 0] == pytest.approx(0.4) and len(rows) == 401
    assert [kept.state for kept in Session(tmp_path).runs()] == [State.WHOLE]
    assert end_marks(run.result) == [{"time": pytest.approx(0.4), "text": "fault", "fault": True}]


@pytest.mark.realtime
def test_a_panel_shows_a_run_against_the_clock_up_to_its_fault(tmp_path: Path) -> None:
    (tmp_path / "late.py").write_text(LATE)
    equipment = Equipment(Session(tmp_path), "control")
    chosen = {"mode": "emulation", "controller": "user", "controller_file": "late.py", "sample_period": 0.005}
    for name, value in (chosen | {"duration": 1.0}).items():
        equipment.choices.set(name, value)
    run = equipment.run()
    run._prepare = None  # as above
    run.start()
    assert run.wait(60) and run.result is not None and "line 3" in str(run.error) and run.unwritten is None
    assert run.result.meta["ending"] == "fault" and "line 3" in run.result.meta["ending_reason"]
    assert run.new_rows()[-1, 0] == run.result["time"][-1] == pytest.approx(0.25)
    assert end_marks(run.result) == [{"time": pytest.approx(0.25), "text": "fault", "fault": True}]
    assert (run.folder / "report.html").is_file()
    assert [kept.state for kept in Session(tmp_path).runs()] == [State.WHOLE]
