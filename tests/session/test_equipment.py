"""The choices of the equipment panels, and the experiments that they say."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rds
from rds.core.errors import InputError
from rds.panels.equipment.diagram import diagram
from rds.panels.equipment.state import Equipment
from rds.panels.kit.diagram import diagram_svg
from rds.panels.session import Session
from rds.panels.session.as_file import as_python, as_toml, write_toml
from rds.panels.texts import exchanger

CONTROLLER = """params = {"Kp": 20.0}


def control(t, r, y, state, params):
    return params["Kp"] * (r.position - y), state
"""


def choose(equipment: Equipment, **values: Any) -> Equipment:
    for name, value in values.items():
        equipment.choices.set(name.replace("__", "."), value)
    return equipment


def test_the_first_sine_is_a_sine_on_x_whatever_was_chosen(tmp_path: Path) -> None:
    equipment = Equipment(Session(tmp_path), "control")
    first = equipment.table()
    choose(equipment, system="spindle", mode="implementation", shape="square", duration=2.0)
    choose(equipment, controller="pid", controller__Pgain=3.0)
    equipment.first_sine()
    assert equipment.table() == first
    assert first["axis"] == "X" and first["reference"] == {"kind": "sinusoid", "amplitude": 5.0, "frequency": 0.2}


def test_a_spindle_is_not_offered_what_it_cannot_have(tmp_path: Path) -> None:
    equipment = Equipment(Session(tmp_path), "control")
    choose(equipment, system="spindle")
    assert "feedforward" not in equipment.choices.fields["controller"].options
    assert equipment.parameters == ["controller.speed_pole"]
    assert equipment.table()["controller"] == {"name": "tracking", "speed_pole": -32.0}
    assert equipment.choices.fields["amplitude"].unit == "rev/min"
    choose(equipment, system="X", controller="tracking")
    assert equipment.parameters == ["controller.pole", "controller.pole_imaginary", "controller.observer_pole"]


def test_a_following_error_is_watched_where_one_is_given(tmp_path: Path) -> None:
    equipment = Equipment(Session(tmp_path), "control")
    assert "following_error" not in equipment.table()
    choose(equipment, ferror="0,5")
    assert equipment.table()["following_error"] == {"ferror": 0.5}
    choose(equipment, system="spindle")
    assert "ferror" not in equipment.shown and "following_error" not in equipment.table()
    choose(equipment, system="X")
    equipment.first_sine()
    assert "following_error" not in equipment.table()


@pytest.mark.parametrize(("machine", "law"), [("mini-cnc", "tracking"), ("starmill", "pid")])
def test_the_law_that_is_offered_first_suits_the_machine(tmp_path: Path, machine: str, law: str) -> None:
    """A stepper follows within a sample of 10 ms, and shows the observer of tracking no velocity."""
    equipment = Equipment(Session(tmp_path, machine), "control")
    assert equipment.table()["controller"]["name"] == law
    equipment.first_sine()
    assert equipment.table()["controller"]["name"] == law


@pytest.mark.parametrize("amplitude", [50.0, 300.0])  # rev/min: within an axis's range in mm, and beyond it
def test_what_was_kept_for_a_spindle_is_there_when_the_page_is_opened_again(tmp_path: Path, amplitude: float) -> None:
    choose(Equipment(Session(tmp_path), "control"), system="spindle", amplitude=amplitude, offset=400.0)
    session = Session(tmp_path)
    again = Equipment(session, "control")
    assert again.table()["axis"] == "spindle"
    assert again.table()["reference"] == {"kind": "sinusoid", "amplitude": amplitude, "frequency": 0.2, "offset": 400.0}
    assert not session.messages


@pytest.mark.parametrize("system", ["W", 3, ["X"], None])
def test_a_kept_system_that_is_not_there_is_the_first(tmp_path: Path, system: Any) -> None:
    (tmp_path / "session.json").write_text(json.dumps({"equipment control": {"system": system}}))
    assert Equipment(Session(tmp_path), "control").table()["axis"] == "X"


def test_a_system_test_has_no_model_to_choose(tmp_path: Path) -> None:
    equipment = Equipment(Session(tmp_path), "model")
    choose(equipment, mode="system-test", model="user")
    assert "model" not in equipment.shown and "model" not in equipment.table()
    choose(equipment, mode="simulation")
    assert "model_file" in equipment.shown
    with pytest.raises(InputError, match="name the file of your model"):
        equipment.table()


def test_parameters_are_those_of_the_library_with_their_units(tmp_path: Path) -> None:
    from rds.controllers import controller_module

    equipment = Equipment(Session(tmp_path), "control")
    for name in ("cascade", "p", "pid", "modified-pid"):
        choose(equipment, controller=name)
        assert equipment.parameters == [f"controller.{option}" for option in controller_module(name).OPTIONS]
    assert equipment.choices.fields["controller.Pgain"].unit == "V/mm"
    with pytest.raises(InputError, match=r"Pgain.* must be at least 0 V/mm, not -1"):
        equipment.choices.set("controller.Pgain", "-1")


@pytest.mark.usefixtures("nothing_drawn")
@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("control", {}),
        ("control", {"controller": "pid", "controller__Pgain": 12.5, "system": "Y", "shape": "triangle"}),
        ("control", {"controller": "tracking", "controller__pole": -20.0, "controller__pole_imaginary": 0.0}),
        ("control", {"system": "spindle", "controller": "tracking", "controller__speed_pole": -50.0}),
        ("control", {"controller": "user", "controller_file": "mine.py", "offset": 1.0}),
        ("control", {"shape": "user", "shape_file": "2*sin(t)+t"}),
        ("control", {"shape": "chirp", "signal__highest": 5.0, "controller": "smith", "controller__law": "p"}),
        ("control", {"shape": "speed", "signal__points": "[[0.0, 0.0], [0.4, 5.0]]", "controller": "cascade"}),
        ("model", {"shape": "staircase", "amplitude": 1.0, "signal__steps": 3}),
        ("model", {"shape": "user", "shape_file": "3*(t > 0.1)", "system": "spindle"}),
        ("model", {"shape": "square", "amplitude": 1.5, "sample_period": 0.002}),
    ],
)
def test_file_and_python_are_the_panels_run_sample_for_sample(tmp_path: Path, kind: str, values: Any) -> None:
    (tmp_path / "mine.py").write_text(CONTROLLER)
    equipment = choose(Equipment(Session(tmp_path), kind), duration=0.4, **values)
    run = equipment.run().start()
    assert run.wait(60) and run.error is None and run.result is not None
    table = equipment.table()
    assert tomllib.loads(as_toml(table)) == table
    from_file = rds.Experiment.from_toml(write_toml(table, tmp_path / "again.toml")).run()
    namespace: dict[str, Any] = {}
    text = as_python(table).replace("print(result.metrics)", "").replace('"mine.py"', repr(str(tmp_path / "mine.py")))
    exec(text.replace('"signals/', f'"{tmp_path}/signals/'), namespace)
    for again in (from_file, namespace["result"]):
        for name in run.result.columns:
            assert np.array_equal(run.result[name], again[name]), name


def test_an_option_that_is_no_number_is_written_as_in_a_file(tmp_path: Path) -> None:
    equipment = choose(Equipment(Session(tmp_path), "control"), controller="feedforward")
    assert equipment.table()["controller"] == {"name": "feedforward", "observer_pole": -320.0}
    choose(equipment, controller__poles="[[-30.0, 10.0], [-30.0, -10.0]]")
    assert equipment.table()["controller"]["poles"] == [[-30.0, 10.0], [-30.0, -10.0]]
    with pytest.raises(InputError, match=r"poles.*is not a value as in a file"):
        equipment.choices.set("controller.poles", "[-30, ")
    with pytest.raises(InputError, match=r"law.*is unknown; known"):
        choose(equipment, controller="smith", controller__law="fly")
    choose(equipment, shape="constant")
    assert equipment.table()["reference"] == {"kind": "constant", "value": 1.0}
    assert not {"amplitude", "frequency", "offset"} & {*equipment.shown}


def test_params_of_a_students_file_can_be_set_before_a_run(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        'params = {\n    "Kp": 20.0,  # V/mm\n    "n": 3,\n    "big": 2 * 3,\n    "on": True,\n}\n'
    )
    (tmp_path / "other.py").write_text(CONTROLLER)
    equipment = choose(Equipment(Session(tmp_path), "control"), controller="user", controller_file="mine.py")
    assert equipment.parameters == ["controller.Kp", "controller.n"]  # what the file computes, only running it tells
    field = equipment.choices.fields["controller.Kp"]
    assert (field.label, field.when_empty) == ("Kp, V/mm", "20")
    assert equipment.table()["controller"] == {"file": "mine.py"}
    choose(equipment, controller__Kp="12,5")
    assert equipment.table()["controller"] == {"file": "mine.py", "params": {"Kp": 12.5}}
    drawn = diagram(equipment.table(), equipment.machine, equipment.words())
    assert next(block for block in drawn.blocks if block.name == "controller").lines == ("mine.py", "Kp 12.5")
    again = Equipment(Session(tmp_path), "control")
    assert again.table() == equipment.table()  # as it was left
    choose(equipment, controller_file="other.py")
    assert equipment.parameters == ["controller.Kp"]
    assert equipment.table()["controller"] == {"file": "other.py"}  # another file's value is its own
    (tmp_path / "other.py").write_text("params = {'Ki': 1}\n" + CONTROLLER.partition("\n")[2])
    equipment.fit_parameters()
    assert equipment.parameters == ["controller.Ki"]
    choose(equipment, model="user", model_file="mine.py", model__n=4)
    assert repr(equipment.table()["model"]["params"]) == "{'n': 4}"  # which range() takes
    drawn = diagram(equipment.table(), equipment.machine, equipment.words())
    assert next(block for block in drawn.blocks if block.name == "model").lines == ("mine.py", "n 4")
    choose(equipment, model="default")
    assert equipment.model_parameters == [] and "model" not in equipment.table()


def test_the_file_does_not_replace_another(tmp_path: Path) -> None:
    table = Equipment(Session(tmp_path), "control").table()
    write_toml(table, tmp_path / "a.toml")
    with pytest.raises(InputError, match="there is such a file already"):
        write_toml(table, tmp_path / "a.toml")
    with pytest.raises(InputError, match=r"ends with \.toml"):
        write_toml(table, tmp_path / "a.py")


@pytest.mark.parametrize(
    ("kind", "mode", "blocks"),
    [
        ("control", "simulation", {"source", "controller", "converter", "model", "encoder"}),
        ("control", "emulation", {"source", "controller", "converter", "model", "encoder", "drivers"}),
        ("control", "implementation", {"source", "controller", "converter", "machine", "encoder", "model", "beside"}),
        ("model", "simulation", {"source", "converter", "model", "encoder", "record"}),
        ("model", "system-test", {"source", "converter", "machine", "encoder", "record"}),
        (
            "model",
            "model-validation",
            {"source", "converter", "machine", "encoder", "record", "model", "beside"},
        ),
    ],
)
def test_the_diagram_shows_the_parts_of_each_mode(tmp_path: Path, kind: str, mode: str, blocks: set[str]) -> None:
    equipment = choose(Equipment(Session(tmp_path), kind), mode=mode)
    drawn = diagram(equipment.table(), equipment.machine, equipment.words())
    assert {block.name for block in drawn.blocks} == blocks
    assert len({(block.row, block.column) for block in drawn.blocks}) == len(blocks)  # none over another
    assert any(link.back for link in drawn.links) == (kind == "control")
    assert all({link.start, link.end} <= blocks for link in drawn.links)
    assert all(exchanger("de")(block.title) for block in drawn.blocks)
    svg = diagram_svg(drawn)
    assert svg.count("<rect") == len(blocks) and 'aria-label="' in svg
    assert svg.count('z" fill=') == len(drawn.links) and "url(" not in svg  # heads, of no part of a panel out of sight


def test_names_of_the_users_cannot_break_the_drawing(tmp_path: Path) -> None:
    equipment = choose(Equipment(Session(tmp_path), "control"), controller="user", controller_file='<b>"&.py')
    svg = diagram_svg(diagram(equipment.table(), equipment.machine, equipment.words()))
    assert "<b>" not in svg and "&lt;b&gt;" in svg
