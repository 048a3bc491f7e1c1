"""The machine as the page draws it: its kinematics are those of the kernel, what it cuts is what it should be."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rds.machines import load_machine, machine_names
from rds.machines.kinematics.kinematics import TIP, ZERO
from rds.panels.scene import scene
from rds.panels.scene.bodies import scene_of

STATIC = Path(scene.__file__).parent / "static"
LINKED = [name for name in machine_names() if load_machine(name).links]


@pytest.fixture
def script(new_page: Callable[..., Any]) -> Any:
    """A page that has the scene's scripts, and nothing else."""
    page = new_page(400, 300)
    page.set_content("<html></html>")
    text = "\n".join((STATIC / name).read_text(encoding="utf-8") for name in ("frames.js", "draw.js", "stock.js"))
    page.add_script_tag(content=f"{text}\nwindow.made = {{ framesOf, tipOf, Stock }};")
    return page


def test_every_body_of_every_machine_is_where_the_kinematics_have_it(script: Any) -> None:
    for name in LINKED:
        machine = load_machine(name)
        looks = json.loads(json.dumps(scene_of(machine)))
        q = machine.kinematics.random(3, seed=4)
        found = [script.evaluate("([scene, q]) => made.framesOf(scene, q)", [looks, values.tolist()]) for values in q]
        for body, frames in machine.kinematics.frames(q).items():
            for k in range(3):
                assert np.reshape(found[k][body], (4, 4)) == pytest.approx(frames[k], abs=1e-9), (name, body)
        drawn = {each["frame"] for each in looks["solids"]} | {
            each[end] for each in looks["arms"] for end in ("from", "to")
        }
        assert drawn <= set(looks["frames"]) and {TIP, ZERO} <= set(looks["frames"])


def test_the_tip_of_a_mill_without_links_is_where_the_axes_are_on_the_work(script: Any) -> None:
    looks = scene_of(load_machine("mini-cnc"))
    assert script.evaluate("(scene) => made.tipOf(scene, [3, -4, 5])", looks) == pytest.approx([3, -4, 5])


def test_a_slot_takes_its_volume_and_a_fault_of_the_depth_is_told_but_not_one_of_a_wall(script: Any) -> None:
    slot = """([depth, off]) => {
        const stock = new made.Stock({ low: [-20, -10, -5], high: [20, 10, 0] }), tool = { diameter: 4, ball: false };
        stock.cut([-10, off, -depth], [10, off, -depth], tool);
        stock.intend(new Float32Array([-10, 0, -2, 10, 0, -2]), tool);
        return [stock.numbers(), stock.cell];
    }"""
    whole, cell = script.evaluate(slot, [2.0, 0.0])
    assert whole["gone"] == pytest.approx(2.0 * (20 * 4 + np.pi * 4), rel=0.05)  # a grid of 0.25 mm
    assert whole["over"] == whole["under"] == 0.0
    beside, _ = script.evaluate(slot, [2.0, 0.9 * cell])
    assert beside["over"] == beside["under"] == 0.0
    deep, _ = script.evaluate(slot, [2.1, 0.0])
    assert deep["over"] == 0.0 and deep["under"] == pytest.approx(0.1, abs=1e-5)
    shallow, _ = script.evaluate(slot, [1.5, 0.0])
    assert shallow["under"] == 0.0 and shallow["over"] == pytest.approx(0.5, abs=1e-5)


def test_a_ball_leaves_its_own_shape(script: Any) -> None:
    dent = """() => {
        const stock = new made.Stock({ low: [-8, -8, -5], high: [8, 8, 0] });
        stock.cut([0, 0, 1], [0, 0, -1], { diameter: 6, ball: true });
        return [stock.numbers().gone, Math.min(...stock.heights)];
    }"""
    gone, lowest = script.evaluate(dent)
    assert lowest == pytest.approx(-1.0, abs=0.01)
    assert gone == pytest.approx(np.pi * 1.0**2 * (3 - 1.0 / 3), rel=0.03)  # a cap of a ball of radius 3, 1 high
