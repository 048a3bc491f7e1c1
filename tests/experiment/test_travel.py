"""A run whose axis was beyond its travel, or whose voltage was at its limit, says so: mistakes of a first week."""

from __future__ import annotations

from pathlib import Path

import pytest

from rds import Experiment

LAW = """params = {{"Kp": 30.0}}
initial_state = []


def control(t, r, y, state, params):
    return params["Kp"] * ({error}), state
"""


@pytest.mark.parametrize(("error", "is_told"), [("y - r.position", True), ("r.position - y", False)])
def test_a_run_that_leaves_the_travel_is_told(tmp_path: Path, error: str, is_told: bool) -> None:
    (tmp_path / "law.py").write_text(LAW.format(error=error))
    reference = {"kind": "sinusoid", "amplitude": 5.0, "frequency": 0.2}
    result = Experiment(controller=tmp_path / "law.py", reference=reference, duration=10.0).run()
    told = [note for note in result.meta["notes"] if "beyond its travel of -75 to 75 mm" in note]
    assert bool(told) is is_told
    assert bool(abs(result["X_measured"]).max() > 75.0) is is_told


def test_where_no_law_drives_the_signal_is_to_be_looked_at() -> None:
    result = Experiment(signal={"kind": "constant", "value": 5.0}, duration=10.0).run()
    assert [note.rpartition("look at ")[2] for note in result.meta["notes"]] == ["the signal"]


MODEL = """initial_state = [0.0]


def derivatives(t, x, u, params):
    return [(1000.0 * u[0] {sign} x[0]) / 0.08]
"""


@pytest.mark.parametrize(("sign", "is_told"), [("+", True), ("-", False)])
def test_a_model_of_ones_own_that_is_unstable_is_told(tmp_path: Path, sign: str, is_told: bool) -> None:
    (tmp_path / "model.py").write_text(MODEL.format(sign=sign))
    signal = {"kind": "constant", "value": 2.0}
    result = Experiment(axis="spindle", signal=signal, model=tmp_path / "model.py", duration=3.0).run()
    told = [note for note in result.meta["notes"] if "beyond its range of -10000 to 10000 rev/min" in note]
    assert bool(told) is is_told
    assert all(note.endswith("look at the signal, and at whether your model is stable (`rds check`)") for note in told)


@pytest.mark.parametrize(("gain", "is_told"), [(30000.0, True), (200.0, False), (20.0, False)])
def test_a_voltage_that_is_at_its_limit_for_long_is_told(tmp_path: Path, gain: float, is_told: bool) -> None:
    (tmp_path / "law.py").write_text(LAW.format(error="r.position - y"))
    reference = {"kind": "sinusoid", "amplitude": 2.0, "frequency": 1.0}
    own = {"file": str(tmp_path / "law.py"), "params": {"Kp": gain}}
    result = Experiment(controller=own, reference=reference, duration=1.0).run()
    share = 100.0 * float((abs(result["X_voltage"]) > 9.99).mean())
    said = f"X: the converter limited the voltage to ±10 V in {share:.0f} % of the samples"
    assert any(note.startswith(said) for note in result.meta["notes"]) is is_told
    assert (share >= 20.0) is is_told


def test_a_law_of_the_wrong_sign_is_not_told_to_lower_its_gains(tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text(LAW.format(error="y - r.position"))
    reference = {"kind": "sinusoid", "amplitude": 2.0, "frequency": 1.0}
    (note,) = Experiment(controller=tmp_path / "law.py", reference=reference, duration=2.0).run().meta["notes"]
    assert note.startswith("X: the law drives the axis off") and "turn its sign" in note
