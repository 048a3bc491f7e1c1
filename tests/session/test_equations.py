"""The equations of what runs, with the numbers in them."""

from __future__ import annotations

from typing import Any

import pytest

from rds.modes.experiment.experiment import Experiment
from rds.panels.equipment.equations import equations, equations_html


def lines(controller: dict[str, Any], axis: str = "X") -> dict[str, list[str]]:
    reference = {"kind": "sinusoid", "amplitude": 5.0, "frequency": 0.2}
    words = {"machine": "mini-cnc", "axis": axis, "mode": "simulation", "duration": 1.0, "reference": reference}
    return dict(equations(Experiment.from_table(words | {"controller": controller}).plan()))


def test_the_model_has_the_machine_s_numbers() -> None:
    found = lines({"name": "p", "Pgain": 10.0})
    assert found["Controller of X"] == ["u = 10 e V,   e = r − y [mm]"]
    assert found["Model of X"] == [
        "0.009943 ẍ + ẋ = 1.764 u − F   [mm/s, u in V]",
        "F = 0.539 mm/s while ẋ > 0, −0.222 mm/s while ẋ < 0",
    ]


@pytest.mark.parametrize(
    ("controller", "said"),
    [
        ({"name": "pid", "Pgain": 3.0, "Igain": 2.0, "Dgain": 0.0, "FF1": -0.5}, "u = 3 e + 2 ∫e dt − 0.5 ṙ"),
        (
            {"name": "modified-pid", "Pgain": 3.0, "Igain": 2.0, "Dgain": 0.1, "b": 0.5, "c": 0.0},
            "u = 3 (0.5 r − y) + 2",
        ),
        ({"name": "tracking", "poles": [[-40.0, 0.0], [-40.0, 0.0]]}, "u = 0.005637 (r̈ + 1600 (r − y)"),
        ({"name": "cascade"}, "w_r = "),
    ],
)
def test_the_laws_have_theirs(controller: dict[str, Any], said: str) -> None:
    assert lines(controller)["Controller of X"][0].startswith(said)


def test_what_a_law_adds_is_told_whole() -> None:
    assert "+ 0.2 dr̈/dt V" in lines({"name": "pid", "FF3": 0.2})["Controller of X"][0]
    assert lines({"name": "cascade"}, "spindle")["Controller of spindle"][0] == "w_r = r rev/min"


def test_the_tracking_law_of_a_spindle_has_its_speed() -> None:
    said = lines({"name": "tracking"}, "spindle")["Controller of spindle"]
    assert said == ["u = 8e−05 (ṙ + 19.5 (r − y)) + 0.001 r V   [rev/min]"]


def test_what_is_the_student_s_is_named_and_escaped() -> None:
    shown = equations_html([("Controller of X", ["a<b.py: Kp = 20"])])
    assert "a&lt;b.py: Kp = 20" in shown and "<b.py" not in shown
