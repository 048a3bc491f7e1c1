"""Error compensation by the host (oacs-thesis, 7.2): deviations that stay are taken out of what is sent next."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rds
from rds.core.errors import InputError
from rds.nc.run.run import PartProgram

TIME = 0.1


def run(compensation: dict[str, float] | None, **words: Any) -> rds.Result:
    """A P controller on an axis with friction lags behind a speed, and stops short of a target."""
    given: dict[str, Any] = {"controller": {"name": "p", "Pgain": 20.0}, "duration": 3.0}
    given |= {"reference": {"kind": "triangle", "amplitude": 5.0, "frequency": 0.1}}
    return rds.Experiment(axis="X", error_compensation=compensation, **given | words).run()


def test_what_stays_goes_with_the_time_constant() -> None:
    plain, made = run(None), run({"time": TIME, "most": 2.0})
    error = {name: (each["X_reference"] - each["X_measured"]) for name, each in (("plain", plain), ("made", made))}
    late = plain["time"] > 10.0 * TIME
    late &= plain["time"] < 2.4  # the triangle turns at 2.5 s
    assert np.abs(error["plain"][late]).min() > 0.05, "the lag of a P controller"
    assert np.abs(error["made"][late]).max() < 0.02 * np.abs(error["plain"][late]).min()
    c = made["X_compensation"]
    k = np.flatnonzero(late)[:500]
    assert c[k + 1] == pytest.approx(c[k] + 0.001 / TIME * error["made"][k], abs=1e-12), "the equation of the module"
    assert np.array_equal(plain["X_reference"], made["X_reference"]), "what was programmed is recorded"


def test_it_goes_no_further_than_it_may() -> None:
    made = run({"time": TIME, "most": 0.01})
    assert np.abs(made["X_compensation"]).max() == 0.01


def test_a_controller_with_signals_keeps_them() -> None:
    made = run({"time": TIME}, controller={"name": "cascade"})
    assert "X_compensation" in made and made.units["X_compensation"] == "mm"


@pytest.mark.parametrize("signals, answer, says", [
    ("", "1.0", r"returned 1.0 at t = 0.000 s \(axis X\); it must return \(voltage, next_state\) with"),
    ("", "(1.0, state, {'a': 1.0})", r"must return \(voltage, next_state\), unless the file declares the third part"),
    ("{'a': 'mm'}", "(1.0, state)", r"as signals declares a, it must return \(voltage, next_state, \{'a': ...\}\)"),
    ("{'a': 'mm'}", "(1.0, state, 5.0)", r"the signals are 5.0; it must return \(voltage, next_state, \{'a': ...\}\)"),
    ("{'a': 'mm'}", "(1.0, state, {})", r"the signals \{\} lack 'a'; it must return"),
], ids=["no state", "not declared", "none told", "no table", "one lacks"])  # fmt: skip
def test_what_the_law_answers_wrongly_is_said_of_the_law(tmp_path: Path, signals: str, answer: str, says: str) -> None:
    """The signal `compensation` is not its business."""
    declared = f"signals = {signals}\n" if signals else ""
    (tmp_path / "law.py").write_text(f"{declared}def control(t, r, y, state, params):\n    return {answer}\n")
    experiment = rds.Experiment(
        reference=rds.sinusoid(1.0, 1.0), controller=tmp_path / "law.py", error_compensation={}, duration=0.01
    )
    with pytest.raises(rds.ContractError, match=says) as refused:
        experiment.run()
    assert "compensation" not in str(refused.value)


def test_a_part_program_is_compensated_online(tmp_path: Path) -> None:
    (tmp_path / "part.ngc").write_text("G21 G90 G94 G61\nG1 X4 F200\nG1 X0\nM2\n")
    words = 'controller = "p"\n[error_compensation]\ntime = 0.05\n'
    (tmp_path / "plain.toml").write_text(words.partition("[")[0])
    (tmp_path / "made.toml").write_text(words)
    plain, made = (
        PartProgram(tmp_path / "part.ngc", experiment=tmp_path / f"{name}.toml").run() for name in ("plain", "made")
    )
    rms = [each.meta["program"]["following_error"]["X"]["rms"] for each in (plain, made)]
    assert rms[1] < 0.5 * rms[0]
    assert not any(name.startswith("spindle_comp") for name in made.columns), "a spindle's speed is left to its law"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ({"error_compensation": {"time": 0.0}}, "time"),
        ({"error_compensation": {"often": 1.0}}, "unknown key 'often'"),
        ({"error_compensation": {}, "controller": None, "reference": None, "signal": 1.0}, "a controller: remove"),
    ],
)
def test_what_will_not_do_is_refused(words: dict[str, Any], says: str) -> None:
    given: dict[str, Any] = {"controller": {"name": "p"}, "reference": rds.sinusoid(1.0, 1.0)} | words
    if "signal" in given:
        given |= {"signal": {"kind": "constant", "value": 1.0}, "mode": "system-test"}
    with pytest.raises(InputError, match=says):
        rds.Experiment(axis="X", **given)
