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
from rds.nc.language.tool_library import ShapedTool
from rds.nc.stock.stock import Stock
from rds.panels.program.stock import drawn
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
        const made_of = { low: [-20, -10, -5], high: [20, 10, 0], cell: 0.25, columns: 160, rows: 80 };
        const stock = new made.Stock(made_of), meant = new made.Stock(made_of), tool = { radius: 2, profile: [0, 0] };
        stock.cut([-10, off, -depth], [10, off, -depth], tool);
        meant.cut([-10, 0, -2], [10, 0, -2], tool);
        stock.intend(meant.heights);
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


@pytest.mark.parametrize("shape", ["flat", "ball", "bull", "vee", "drill"])
def test_each_shape_leaves_in_the_page_what_the_command_cuts(script: Any, shape: str) -> None:
    tool = ShapedTool(1, 6.0, shape, corner_radius=1.0 if shape == "bull" else 0.0, angle=90.0)
    stock = Stock.block((-8.0, -8.0, -5.0), (8.0, 8.0, 0.0), 0.1)
    way = np.array([[-2.0, 0.0, -2.0], [2.0, 1.0, -2.0]])
    stock.cut(tool, way, np.zeros(2, int), np.zeros(2, bool), 1)
    given = {"low": [-8, -8, -5], "high": [8, 8, 0], "cell": 0.1, "columns": 160, "rows": 160}
    cut = """([given, tool, a, b]) => {
        const stock = new made.Stock(given);
        stock.press(a, tool, stock.heights);
        stock.cut(a, b, tool);
        return [...stock.heights];
    }"""
    found = script.evaluate(cut, [given, drawn({1: tool})["1"], *way.tolist()])
    heights = np.reshape(found, (160, 160))
    off = np.abs(heights - stock.heights)
    # the page steps by a cell and the command by half of one: walls may be off by cells, depths are the same
    assert heights.min() == pytest.approx(stock.heights.min(), abs=0.02)
    assert np.mean(off > 0.1) < 0.01 and off.mean() < 0.01
