"""Equipment control with several axes: a path together, a coupled controller, an interpolator of one's own."""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rds
from rds.core.errors import InputError
from rds.panels.equipment.diagram import diagram
from rds.panels.equipment.state import Equipment
from rds.panels.session import Session
from rds.panels.session.as_file import as_python, as_toml
from rds.panels.session.live_values import LiveValues

EXAMPLES = Path(__file__).parents[2] / "examples"
MINE = """from math import ceil, dist

params = {}


def interpolate(segment, T, params):
    n = ceil(dist(segment.start, segment.end) / (segment.feed_rate * T))
    for k in range(1, n + 1):
        at = [a + (b - a) * k / n for a, b in zip(segment.start, segment.end)]
        yield at, [(b - a) / (n * T) for a, b in zip(segment.start, segment.end)], [0.0] * len(at)
"""
PATH = 'start = [0.0, 0.0]\nfeed = 600\n[[segment]]\nkind = "line"\nend = [2.0, 1.0]\n'


def control(folder: Path, **values: Any) -> Equipment:
    shutil.copy(EXAMPLES / "cross_coupled.py", folder)
    (folder / "mine.py").write_text(MINE)
    (folder / "path.toml").write_text(PATH)
    (folder / "part.ngc").write_text("G21 G90 F600\nG1 X2\nG1 Y1 Z-1\nM2\n")
    equipment = Equipment(Session(folder), "control")
    for name, value in values.items():
        equipment.choices.set(name, value)
    return equipment


def coupled(folder: Path, **values: Any) -> Equipment:
    chosen = {"system": "X+Y", "controller": "user", "controller_file": "cross_coupled.py", "coupled": True}
    return control(folder, **(chosen | values))


def finished(equipment: Equipment) -> Any:
    run = equipment.run().start()
    assert run.wait(60) and run.error is None and run.result is not None, run.error
    return run


def test_the_panel_says_what_the_shipped_example_says(tmp_path: Path) -> None:
    """A circle under cross-coupled control: the same numbers as `rds run examples/contour.toml`."""
    equipment = coupled(tmp_path, shape="circle", interpolator="tustin", sample_period=0.001)
    table = equipment.table()
    assert "duration" not in table and table["axes"] == ["X", "Y"]
    assert tomllib.loads(as_toml(table)) == table and '"coupled": True' in as_python(table)
    run = finished(equipment)
    example = rds.Experiment.from_toml(EXAMPLES / "contour.toml").run()
    for name in example.columns:
        assert np.array_equal(example[name], run.result[name]), name
    assert (run.folder / "program.html").is_file() and (run.folder / "report.html").is_file()
    assert run.traces()[-1] == ("contour_error", "mm")
    rows = run.new_rows()
    assert rows.shape[1] == 1 + len(run.traces()) and 0.0 < rows[:, -1].max() < 0.05


@pytest.mark.usefixtures("nothing_drawn")
@pytest.mark.parametrize(
    ("values", "end"),
    [
        ({"system": "X+Y", "shape": "path", "path_file": "path.toml"}, (2.0, 1.0)),
        (
            {
                "system": "X+Y",
                "shape": "path",
                "path_file": "path.toml",
                "interpolator": "user",
                "interpolator_file": "mine.py",
                "acceleration": "none",
            },
            (2.0, 1.0),
        ),
        ({"system": "X+Y+Z", "shape": "path", "path_file": "part.ngc", "controller": "pid"}, (2.0, 1.0, -1.0)),
        ({"system": "X+Y+Z", "shape": "circle", "radius": 1.0, "laps": 1}, (0.0, 0.0, 0.0)),
    ],
)
def test_several_axes_follow_a_path_to_its_end(tmp_path: Path, values: dict[str, Any], end: tuple[float, ...]) -> None:
    run = finished(control(tmp_path, **values))
    assert tuple(run.result[f"{axis}_reference"][-1] for axis in "XYZ"[: len(end)]) == end
    assert run.result.meta["program"]["completed"]


@pytest.mark.usefixtures("nothing_drawn")
def test_lines_and_arcs_may_have_files_of_their_own(tmp_path: Path) -> None:
    """mine.py goes straight to the end of any segment, and could not go round."""
    shutil.copy(EXAMPLES / "my_interpolator.py", tmp_path / "arcs.py")
    words = {"system": "X+Y", "shape": "circle", "radius": 1.0, "laps": 1, "acceleration": "none"}
    equipment = control(tmp_path, **words, interpolator="user", interpolator_file="mine.py")
    assert "arc_interpolator" not in equipment.table()["reference"] and len(equipment.files()) == 1
    equipment.choices.set("arc_interpolator_file", "arcs.py")
    assert equipment.table()["reference"]["arc_interpolator"] == "arcs.py"
    assert [path.name for _, path in equipment.files()] == ["mine.py", "arcs.py"]
    about = finished(equipment).result.meta["program"]
    assert about["completed"] and about["path_error"]["max"] < 1e-9  # mm


@pytest.mark.usefixtures("nothing_drawn")
def test_each_axis_may_follow_the_same_signal(tmp_path: Path) -> None:
    equipment = control(tmp_path, system="X+Y", shape="sinusoid", duration=0.2)
    assert "interpolator" not in equipment.shown and "duration" in equipment.shown and "laps" not in equipment.shown
    result = finished(equipment).result
    assert np.array_equal(result["X_reference"], result["Y_reference"])


def test_one_axis_alone_has_no_path_and_no_coupled_controller(tmp_path: Path) -> None:
    equipment = coupled(tmp_path, shape="circle")
    equipment.choices.set("system", "X")
    assert "coupled" not in equipment.shown and equipment.choices["shape"] == "sinusoid"
    assert "circle" not in equipment.choices.fields["shape"].options
    assert equipment.table()["controller"] == {"file": "cross_coupled.py"}
    assert "X+Y" not in Equipment(Session(tmp_path), "model").choices.fields["system"].options


def test_what_was_kept_of_several_axes_is_there_again(tmp_path: Path) -> None:
    table = coupled(tmp_path, shape="circle", radius=2.0, interpolator="taylor").table()
    session = Session(tmp_path)
    assert Equipment(session, "control").table() == table and not session.messages


def test_build_checks_a_coupled_controller_with_its_axes_and_the_interpolator(tmp_path: Path) -> None:
    words = {"shape": "circle", "interpolator": "user", "interpolator_file": "mine.py"}
    task = coupled(tmp_path, **words).build()
    assert task.wait(60) and task.result is not None
    assert [(each.role, each.ok) for each in task.result] == [("interpolator", True), ("controller", True)]
    one_by_one = Equipment(Session(tmp_path), "control")
    one_by_one.choices.set("coupled", False)
    task = one_by_one.build()
    assert task.wait(60) and task.result is not None
    assert [each.ok for each in task.result] == [True, False]


def test_a_file_that_is_not_named_is_asked_for(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="name the file of your path, or of your part program"):
        control(tmp_path, system="X+Y", shape="path").table()
    with pytest.raises(InputError, match="name the file of your interpolator"):
        control(tmp_path, system="X+Y", shape="circle", interpolator="user").table()


def test_the_diagram_names_the_path_and_all_axes(tmp_path: Path) -> None:
    equipment = coupled(tmp_path, shape="circle", mode="implementation", interpolator="tustin")
    drawn = diagram(equipment.table(), equipment.machine, equipment.words())
    of = {block.name: block for block in drawn.blocks}
    assert of["source"].lines == ("circle of 10 mm", "300 mm/min", "tustin", "s-shape filter")
    assert of["controller"].lines == ("cross_coupled.py", "all axes together")
    assert of["machine"].title == "Machine, axes X, Y" and of["model"].lines[1].startswith("X: τ 9.94 ms")
    assert of["converter"].lines[0] == "nodes 2, 3"


@pytest.mark.realtime
@pytest.mark.usefixtures("nothing_drawn")
def test_it_is_held_and_tuned_while_it_runs(tmp_path: Path) -> None:
    equipment = coupled(tmp_path, shape="circle", mode="emulation", sample_period=0.005)
    run = equipment.run().start()
    while not run.live_values and not run.done:
        run.wait(0.05)
    live = LiveValues(run)
    assert {"hold", "override"} < set(live.fields) and any(name.startswith("controller.") for name in live.fields)
    live.set("hold", 1.0)
    while not (run.changes or run.done):
        run.wait(0.05)
    live.set("hold", 0.0)
    run.stop()
    assert run.wait(60) and run.result is not None and run.result.meta["ending"] == "stopped"
    assert run.changes[0][1] == "hold"
