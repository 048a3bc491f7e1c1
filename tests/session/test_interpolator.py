"""The interpolator panel's session: what it makes is what `rds interpolate` and the Python function make."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError, RdsError
from rds.core.types import ArcSegment
from rds.interpolators.interpolator import library_interpolator
from rds.interpolators.path import interpolate
from rds.interpolators.result import Interpolation
from rds.nc.bundled import find_bundled
from rds.panels.interpolator.state import Interpolating
from rds.panels.session import Session
from rds.results import open_result
from tests.documents import blocks

USERS = """
def interpolate(segment, T, params):
    import numpy as np
    start, way = np.array(segment.start), np.subtract(segment.end, segment.start)
    n = int(np.ceil(np.linalg.norm(way) / segment.feed_rate / T - 1e-9))
    for k in range(1, n + 1):
        yield start + way * k / n, way / (n * T), np.zeros(len(way))
"""


def make(folder: Path, **choices: object) -> Interpolating:
    panel = Interpolating(Session(folder))
    for name, value in choices.items():
        panel.choices.set(name.replace("__", "."), value)
    return panel


def run(panel: Interpolating) -> Interpolation:
    task = panel.run()
    assert task.wait(60)
    if task.error is not None:
        raise task.error
    assert task.result is not None
    return task.result


def command(*arguments: str) -> dict[str, object]:
    done = CliRunner().invoke(app, ["interpolate", *arguments, "--json"])
    assert done.exit_code in (0, 1), done.output
    return dict(json.loads(done.stdout))


def test_single_arc_is_that_of_python_and_of_the_command_line(tmp_path: Path) -> None:
    done = run(make(tmp_path, arc_method="improved-tustin", arc__blu=0.02))
    arc = ArcSegment((10.0, 0.0), (0.0, 10.0), (0.0, 0.0), 10.0)
    same = interpolate([arc], 0.001, library_interpolator("improved-tustin", blu=0.02))
    assert np.array_equal(done.position, same.position) and done.steps[0] is not None
    assert done.steps[0].count == same.steps[0].count  # type: ignore[union-attr]
    said = command(*("--arc", "10,0:0,10:0,0", "--feed", "600", "--method", "improved-tustin", "--option", "blu=0.02"))
    assert done.to_json() | {"method": ""} == {k: said[k] for k in done.to_json()} | {"method": ""}


def test_table_of_segments_is_that_of_the_toml_file(tmp_path: Path) -> None:
    panel = make(tmp_path, kind="both", given="several", start="0, 0", feed=1200.0, acceleration="s-shape")
    done = run(panel)
    assert done.acceleration is not None and len(done.segments) == 2
    (tmp_path / "path.toml").write_text(
        'start = [0.0, 0.0]\nfeed = 20.0\nfeed_unit = "mm/s"\n'
        '[[segment]]\nkind = "line"\nend = [30.0, 0.0]\n'
        '[[segment]]\nkind = "arc"\nend = [30.0, 20.0]\ncentre = [30.0, 10.0]\n'
    )
    said = command(str(tmp_path / "path.toml"), "--acceleration", "s-shape", "--acceleration-time", "0.02")
    assert said["samples"] == done.samples and said["path_error_mm"] == pytest.approx(done.path_error.max())


def test_the_document_s_path(tmp_path: Path) -> None:
    (block,) = (each for each in blocks("docs/interpolation.md") if each.language == "toml")
    (tmp_path / "path.toml").write_text(block.text)
    said = command(str(tmp_path / "path.toml"))
    assert said["segments"] == 2 and said["time_s"] == pytest.approx(3.0 + np.pi * 10.0 / 5.0, abs=2e-3)
    for line, why in (("feed = 600", "feed is missing"), ("end = [30.0, 0.0]", "segment 1: end = None must be")):
        (tmp_path / "path.toml").write_text(block.text.replace(line, "", 1))
        done = CliRunner().invoke(app, ["interpolate", str(tmp_path / "path.toml")])
        assert done.exit_code == 2 and why in done.stderr
    (tmp_path / "path.toml").write_text("speed = 3\n" + block.text)
    done = CliRunner().invoke(app, ["interpolate", str(tmp_path / "path.toml")])
    assert done.exit_code == 2 and "'speed'" in done.stderr


def test_part_program_is_that_of_the_command_line(tmp_path: Path) -> None:
    (tmp_path / "part.ngc").write_text("G21 G90 G17 F600\nG1 X10 Y0\nG3 X0 Y10 I-10 J0\nG4 P0.1\nG1 X0 Y0\nM2\n")
    panel = make(tmp_path, kind="both", given="program", program="part.ngc")
    done, said = run(panel), command(str(tmp_path / "part.ngc"))
    assert done.samples == said["samples"] and panel.notes == said["notes"]
    panel.choices.set("kind", "linear")
    with pytest.raises(InputError, match="segment 2 is an arc, and interpolation is linear; choose both"):
        run(panel)
    (tmp_path / "part.ngc").write_text("G21 G90 F600\nG1 X10 Q\nM2\n")
    with pytest.raises(RdsError, match=r"part.ngc"):
        run(panel)


def test_user_s_file_is_checked_first_and_its_fault_is_at_its_line(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(USERS)
    panel = make(tmp_path, kind="linear", start="0, 0", end="30, 40", line_method="user")
    with pytest.raises(InputError, match="name the file of your interpolator for lines"):
        panel.run()
    panel.choices.set("line_file", "mine.py")
    done = run(panel)
    assert done.samples == 5000 and done.path_error.max() < 1e-9
    (tmp_path / "mine.py").write_text(USERS.replace("way * k / n", "way * k / nn"))
    with pytest.raises(InputError, match=r"mine\.py, line 7"):
        run(panel)
    checked = panel.check()
    assert checked.wait(60) and checked.result is not None
    assert next(mark.line for mark in checked.result[0].marks if mark.fault) == 7


@pytest.mark.parametrize(
    ("name", "value", "why"),
    [
        ("start", "ten", "two or three positions in mm"),
        ("end", "10,5 0", "write decimals with a point"),
        ("end", "nan, 0", "two or three positions in mm"),
        ("centre", "0, 1e400", "two or three positions in mm"),
        ("end", "", "two or three positions in mm"),
        ("feed", 0.0, "more than 0"),
        ("period", "0 s", "from 1e-06 to 1000 s"),
        ("arc_method", "linear", "one of"),
        ("rows", [{"kind": "arc", "end": [1.0, 2.0]}], "segment 1: centre"),
        ("rows", [{"kind": "line", "end": [1.0, 2.0], "center": [0, 0]}], "no option 'center'"),
    ],
)
def test_what_is_refused(tmp_path: Path, name: str, value: object, why: str) -> None:
    with pytest.raises(InputError, match=why):
        make(tmp_path).choices.set(name, value)


def test_a_part_program_without_a_name_is_asked_for(tmp_path: Path) -> None:
    panel = make(tmp_path, given="program")
    with pytest.raises(InputError, match=r"name the part program \(in .*\); the Program panel writes one"):
        run(panel)


def test_what_a_check_warns_of_is_a_note(tmp_path: Path) -> None:
    """As on the command line: velocities that are none of the positions."""
    (tmp_path / "mine.py").write_text(USERS.replace("way / (n * T), np", "0.0 * way, np"))
    panel = make(tmp_path, kind="linear", line_method="user", line_file="mine.py", end="5, 0", start="0, 0")
    run(panel)
    assert any(note.startswith("mine.py: ") and "differ from the change of position" in note for note in panel.notes)


def test_arc_that_does_not_close_says_so(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="move end or centre so that both are on one circle"):
        run(make(tmp_path, end="0, 11"))


def test_another_unit_is_the_same_speed(tmp_path: Path) -> None:
    panel = make(tmp_path)
    panel.choices.set("feed_unit", "in/min")
    assert panel.choices["feed"] == pytest.approx(600.0 / 25.4)
    assert panel.segments()[0].feed_rate == pytest.approx(10.0)
    again = Interpolating(Session(tmp_path))  # as kept in the folder
    assert again.choices["feed"] == panel.choices["feed"] and again.segments() == panel.segments()


def test_feeds_of_segments_are_the_same_speed_in_another_unit(tmp_path: Path) -> None:
    rows = [{"kind": "line", "end": [20.0, 0.0], "feed": 300.0}, {"kind": "line", "end": [30.0, 0.0]}]
    panel, other = make(tmp_path), make(tmp_path)
    for name, value in {"kind": "linear", "given": "several", "rows": rows, "feed_unit": "mm/s"}.items():
        panel.choices.set(name, value)
    assert [each.feed_rate for each in panel.segments()] == [5.0, 10.0]
    other.session.refresh()
    assert other.choices.values() == panel.choices.values()


def test_long_work_ends_when_it_is_asked_to(tmp_path: Path) -> None:
    panel = make(tmp_path, kind="linear", end="150, 0", feed=600.0, period=1e-5)
    task = panel.run()
    task.stop()
    assert task.wait(20) and task.stopped


def test_saved_samples_can_be_opened_and_are_not_replaced(tmp_path: Path) -> None:
    panel = make(tmp_path)
    done = run(panel)
    path = panel.save(done)
    assert np.allclose(open_result(path)["X_reference"], done.position[:, 0])
    with pytest.raises(InputError, match="there is such a file already"):
        panel.save(done)


def test_magnified_errors_are_as_many_times_as_large(tmp_path: Path) -> None:
    from rds.interpolators.deviation import path_deviations
    from rds.interpolators.plots import magnified

    done = run(make(tmp_path, arc_method="improved-tustin", arc__blu=0.05))
    nearest, off = path_deviations(done.segments, done.position, done.segment, done.segment)
    assert np.allclose(np.linalg.norm(off, axis=1), done.path_error) and np.allclose(nearest + off, done.position)
    drawn = magnified(done, 100.0).axes[0].lines[1].get_xydata()[::2]
    assert np.allclose(drawn, nearest + 100.0 * off)


@pytest.mark.parametrize("kind", ["circular", "linear", "both"])
def test_several_segments_begin_with_a_table_that_can_be_interpolated(tmp_path: Path, kind: str) -> None:
    assert len(run(make(tmp_path, kind=kind, given="several")).segments) == 2


def test_a_table_of_ones_own_is_kept_when_the_kind_changes(tmp_path: Path) -> None:
    own = [{"kind": "line", "end": [12.0, 0.0]}]
    panel = make(tmp_path, kind="linear", given="several", rows=own)
    panel.choices.set("kind", "both")
    assert panel.choices["rows"] == own


@pytest.mark.parametrize(("kind", "name"), [("linear", "square"), ("circular", "quadrants"), ("both", "pocket")])
def test_each_kind_has_a_default_program(kind: str, name: str, tmp_path: Path) -> None:
    panel = make(tmp_path, kind=kind, given="bundled", period=0.01)
    assert panel.choices["bundled"] == f"{name}.ngc"
    assert "bundled" in panel.shown and "program" not in panel.shown and "feed" not in panel.shown
    done = run(panel)
    said = command(str(find_bundled(name).path), "--period", "0.01")
    assert said["samples"] == done.samples and said["path_error_mm"] == pytest.approx(done.path_error.max())


def test_a_path_of_rds_is_in_the_list(tmp_path: Path) -> None:
    panel = make(tmp_path, kind="both", given="bundled", bundled="pocket.toml", period=0.01)
    done = run(panel)
    said = command(str(find_bundled("pocket.toml").path), "--period", "0.01")
    assert said["samples"] == done.samples and len(done.segments) == 21


def test_programs_of_rds_are_read_with_the_machine_that_they_were_made_for(tmp_path: Path) -> None:
    panel = Interpolating(Session(tmp_path, machine="mrmt-oacs"))  # which has no Y
    for name, value in {"kind": "linear", "given": "bundled", "period": 0.01}.items():
        panel.choices.set(name, value)
    assert tuple(run(panel).axes) == ("X", "Y", "Z")


def test_a_program_of_lines_is_refused_where_arcs_are_interpolated(tmp_path: Path) -> None:
    panel = make(tmp_path, kind="circular", given="bundled", bundled="square.ngc")
    with pytest.raises(InputError, match="segment 1 is a line, and interpolation is circular"):
        run(panel)
