"""A law that says for which sample period its numbers were made, in a run of another one."""

from __future__ import annotations

from pathlib import Path

import pytest

from rds import Experiment
from rds.identification.fit.design import linear_axis_of_machine, write_tracking
from rds.machines import load_machine

TOLD = "law.py says that it is made for a sample period of 0.001 s, and the run has 0.01 s"


def notes(file: Path, period: float) -> list[str]:
    reference = {"kind": "sinusoid", "amplitude": 5.0, "frequency": 0.2}
    experiment = Experiment(controller=file, reference=reference, sample_period=period, duration=1.0)
    return [note for note in experiment.run().meta["notes"] if "is made for" in note]


@pytest.mark.parametrize(("period", "told"), [(0.001, 0), (0.01, 1)])
def test_a_designed_law_tells_a_run_of_another_period(tmp_path: Path, period: float, told: int) -> None:
    axis = linear_axis_of_machine(load_machine("mini-cnc"), "X")
    found = notes(write_tracking(tmp_path / "law.py", axis, sample_period=0.001), period)
    assert len(found) == told and all(note.startswith(TOLD) for note in found)


@pytest.mark.parametrize(("line", "told"), [("sample_period = 1e-3", 1), ("", 0), ("def sample_period(): pass", 0)])
def test_a_law_of_ones_own_may_say_it(tmp_path: Path, line: str, told: int) -> None:
    law = f"{line}\n\n\ndef control(t, r, y, state, params):\n    return 30.0 * (r.position - y), state\n"
    (tmp_path / "law.py").write_text(law)
    assert len(notes(tmp_path / "law.py", 0.01)) == told
