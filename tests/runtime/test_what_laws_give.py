"""What a run makes of a controller's state, parameters and answers, whatever they are."""

from __future__ import annotations

from typing import Any

import pytest

import rds
from rds.core.errors import ContractError


def tracked(controller: Any, axis: Any = "X", coupled: bool = False) -> rds.Experiment:
    """0.2 s of a sine under the controller."""
    given = {"file": controller, "coupled": True} if coupled else controller
    return rds.Experiment(axis=axis, duration=0.2, reference=rds.sinusoid(2.0, 5.0), controller=given)


def integrating(t: float, r: Any, y: float, state: Any, params: Any) -> Any:
    """It changes its state and its parameters in place, as many first programs do."""
    state[0] += 1e-3 * (r.position - y)
    params["calls"][0] += 1
    return 20.0 * (r.position - y) + 50.0 * state[0] + 1e-3 * params["calls"][0], state


def test_a_state_that_is_changed_in_place_is_each_run_s_and_each_axis_s_own() -> None:
    controller = rds.Controller(integrating, [0.0], {"calls": [0]})
    alone = tracked(controller).run()
    both = tracked(controller, ["X", "Y"])
    first, second = both.run(), both.run()
    for result in (first, second):
        assert (result["X_command"] == alone["X_command"]).all()
    assert (first["Y_command"] == second["Y_command"]).all()
    assert (controller.initial_state, controller.params) == ([0.0], {"calls": [0]})


ANSWERS = {
    "a dict": "{5.0: 0, 1e9: 2}",
    "a set": "{1.0, 2.0}",
    "an array": "np.array([5.0, 0.0])",
    "two letters": "'12'",
}


@pytest.mark.parametrize("answer", ANSWERS.values(), ids=ANSWERS)
def test_what_is_no_pair_is_not_taken_apart(answer: str, tmp_path: Any) -> None:
    law = tmp_path / "law.py"
    law.write_text(f"import numpy as np\ndef control(t, r, y, state, params):\n    return {answer}\n")
    with pytest.raises(ContractError, match=r"it must return \(voltage, next_state\)"):
        tracked(str(law)).run()


@pytest.mark.parametrize("voltage", ["['1', '2']", "[True, False]", "[1j, 0]", "[1.0]", "None"])
def test_a_coupled_law_s_voltages_are_numbers(voltage: str, tmp_path: Any) -> None:
    law = tmp_path / "law.py"
    law.write_text(f"def control(t, r, y, state, params):\n    return {voltage}, state\n")
    with pytest.raises(ContractError, match="the voltage 2 finite numbers in V, one for each axis"):
        tracked(str(law), ["X", "Y"], coupled=True).run()


def test_an_int_beyond_all_floats_is_a_parameter_like_any_other_but_no_live_value(tmp_path: Any) -> None:
    law = tmp_path / "law.py"
    law.write_text("params = {'n': 10**400, 'P': 20.0}\ndef control(t, r, y, state, params):\n    return 0.5, state\n")
    assert {channel.name for channel in tracked(str(law)).plan().channels()} == {"X.P", "stop"}
    assert len(tracked(str(law)).run()) == 200
