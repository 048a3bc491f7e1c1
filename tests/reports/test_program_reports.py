"""Reports on part programs: hand calculations, a circle and a square of runs, what does not belong together refused."""

from __future__ import annotations

from math import cos, pi, sin
from pathlib import Path

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.machines import load_machine
from rds.nc.bundled import find_bundled
from rds.nc.run.serial_methods import run_method
from rds.nc.run.serial_motion import serial_motion
from rds.nc.run.serial_records import write_records
from rds.results.reports import make_report
from rds.results.reports.gauges import GAUGES, PATH
from rds.results.reports.unsynchronized_rapids import by_formula

CIRCLE = [0, 5, 0, 0, 10, 0, 0, 10, 0, 0, 0, 0, 0, 360]  # of 10 mm about zero
RAPID = [0, 2, 1, -1, 0, 0, 0, 70, 20, 0, 0, 0, 0, 0]


def files(folder: Path, path: list[list[float]], rows: list[list[float]], name: str = "gauges-A.csv") -> list[Path]:
    for file, headings, table in (("path.csv", PATH, path), (name, GAUGES, rows)):
        (folder / file).write_text("\n".join(",".join(map(str, row)) for row in [headings, *table]) + "\n")
    return [folder / "path.csv", folder / name]


def test_an_egg_is_out_of_round_by_what_was_put_in(tmp_path: Path) -> None:
    rows: list[list[float]] = []
    for k in range(400):
        angle, radius = 2 * pi * k / 400, 10.0 + 0.02 * cos(2 * 2 * pi * k / 400) + 0.005
        rows.append([0.01 * k, radius * cos(angle), radius * sin(angle), 0.0, 0])
    table = make_report("path-error", files(tmp_path, [CIRCLE], rows)).table("Path error")
    assert table.column("mean deviation [µm]")[0] == pytest.approx(5.0, abs=1e-6)
    assert table.column("largest [µm]") == pytest.approx([25.0, 120.0])  # and the thesis's
    assert table.column("mean of amounts [µm]")[1] == 35.0
    assert table.column("out of round or straight [µm]")[0] == pytest.approx(40.0, abs=1e-2)
    assert table.column("std [µm]")[0] == pytest.approx(20.0 / 2**0.5, rel=2e-3)


def test_a_corner_is_overshot_or_cut(tmp_path: Path) -> None:
    path = [
        [0, 5, 0, -1, 0, 0, 0, 10, 0, 0, 0, 0, 0, 0],
        [1, 6, 0, -1, 10, 0, 0, 10, 10, 0, 0, 0, 0, 0],
    ]
    rows = [[0, 0, 0, 0, 0], [1, 9.9, 0.01, 0, 0], [2, 10.03, 0.04, 0, 1], [3, 10.0, 10, 0, 1]]
    report = make_report("path-error", files(tmp_path, path, rows))
    corners = report.table("Corners")
    assert corners.column("turn [deg]") == pytest.approx([90.0])
    assert corners.column("overshoot [µm]") == pytest.approx([30.0])
    assert corners.column("cut off [µm]") == pytest.approx([50.0])
    assert report.table("Path error").column("largest [µm]") == pytest.approx([10.0, 30.0])
    assert report.findings == ["A: 30.0 µm at most, in line 6."]
    path[1][1] = 5  # both of one line, as in a loop of the program
    rows[1][2], rows[2][2] = 0.1, 10.0
    report = make_report("path-error", files(tmp_path, path, rows))
    assert report.findings == ["A: 100.0 µm at most, in line 5."]


def test_each_axis_for_itself_leaves_the_line_by_the_formula(tmp_path: Path) -> None:
    rows = [[0.01 * k, min(0.2 * k, 70), min(0.2 * k, 20), 0, 0] for k in range(351)]
    report = make_report("unsynchronized-rapids", files(tmp_path, [RAPID], rows))
    table = report.table("Rapids")
    # at the arrival of Y both have gone 20 mm, 50 mm of X are left: 50 sin(atan(2/7)) off the line
    assert by_formula(np.array([70.0, 20.0, 0.0])) == pytest.approx(50 * 20 / (70**2 + 20**2) ** 0.5)
    assert table.column("off the line [mm]") == pytest.approx(table.column("by formula [mm]"))
    assert table.column("X arrives [s]") == pytest.approx([3.5], abs=0.011)
    assert table.column("Y arrives [s]") == pytest.approx([1.0], abs=0.011)
    assert report.findings == ["A, line 2: Y arrives 2.50 s before X; 13.74 mm off the line."]


def test_the_return_error_is_where_it_ends_less_where_it_began(tmp_path: Path) -> None:
    path = [RAPID, [1, 3, 1, -1, 70, 20, 0, 0, 0, 0, 0, 0, 0, 0]]
    rows = [[0, 0, 0, 0, 0], [1, 70, 20, 0, 0], [2, 0.03, -0.04, 0, 1]]
    report = make_report("return-error", files(tmp_path, path, rows))
    table = report.table("Return error")
    assert table.column("together [µm]") == pytest.approx([50.0])
    assert table.column("return error Y [µm]") == pytest.approx([-40.0])
    assert report.findings == ["A: it comes back to 50.0 µm, more than the 5 µm allowed."]
    with pytest.raises(InputError, match="does not come back to its start: it ends X 70, Y 20, Z 0 mm from it; end"):
        make_report("return-error", files(tmp_path, [RAPID], rows[:2]))


def test_runs_leave_what_the_reports_read(tmp_path: Path) -> None:
    machine = load_machine("starmill")
    program = tmp_path / "part.ngc"
    program.write_text("G21 G17 G90 F300 G61\nG0 X2 Y1\nG1 X3\nG3 X3 Y1 I-1 J0\nG0 X0 Y0\nM2\n")
    for synchronized, off in ((True, 0.1), (False, 0.3)):
        motion = serial_motion(program, machine, motion="constant", synchronized=synchronized)
        made = write_records([run_method("C", motion, machine)], tmp_path / str(synchronized))
        assert [file.name for file in made] == ["path.csv", "gauges-C.csv"]
        rapids = make_report("unsynchronized-rapids", made).table("Rapids")
        assert (max(rapids.column("off the line [mm]")) < off) is synchronized  # steps that are lost leave it too
        assert rapids.column("by formula [mm]") == pytest.approx([1 / 5**0.5, 2 / 10**0.5])
        assert make_report("return-error", made).findings
    circle = make_report("path-error", made).table("Path error")
    assert circle.column("nominal [mm]")[1] == pytest.approx(1.0)


def test_a_face_is_the_lowest_that_the_tool_went(tmp_path: Path) -> None:
    """Two strokes 5 mm apart, the second one 0.04 mm higher; a lift and a rapid leave nothing behind."""
    strokes = [[-0.5, 0, 0, 20, 0, -0.5], [-0.5, 0, 5, 20, 5, -0.5]]
    path = [[k, k, 0, -1, x, y, z, x2, y2, z2, 0, 0, 0, 0] for k, (z, x, y, x2, y2, z2) in enumerate(strokes)]
    path.append([2, 9, 1, -1, 0, 0, -9, 20, 5, -9, 0, 0, 0, 0])
    rows: list[list[float]] = [[0.0, 0.0, 0.0, 2.0, 0]]
    rows += [[1 + k, k, 0.0, -0.5, 0] for k in range(21)]
    rows += [[30 + k, k, 5.0, -0.46, 1] for k in range(21)]
    rows += [[60, 10.0, 0.0, -9.0, 2]]
    table = make_report("flatness", files(tmp_path, path, rows), {"tool": 4.0}).table("Flatness")
    assert table.column("readings") == [10, None]
    assert table.column("largest relative error [mm]") == pytest.approx([0.04, 0.126])
    assert table.column("slope in y [mm/m]")[0] == pytest.approx(8.0)
    for grid in (0.05, 1e-9):
        with pytest.raises(InputError, match="can be shown; take more"):
            make_report("flatness", files(tmp_path, path, rows), {"grid": grid})
    with pytest.raises(InputError, match="no level feed moves"):
        make_report("flatness", files(tmp_path, [[0, 2, 0, -1, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0]], rows[:2]))


def test_what_does_not_belong_together_is_refused(tmp_path: Path) -> None:
    path, gauges = files(tmp_path, [CIRCLE], [[0, 1, 1, 0, 0], [1, 1, 1, 0, 3]])
    for given, said in (
        ([path], "there is a path and no readings"),
        ([gauges], "none of the files is a path"),
        ([path, gauges], "speaks of segment 3, and the path has 1"),
    ):
        with pytest.raises(InputError, match=said):
            make_report("path-error", given)
    path, gauges = files(tmp_path, [CIRCLE], [[1, 1, 1, 0, 0], [0, 1, 1, 0, 0]])
    with pytest.raises(InputError, match="times do not grow"):
        make_report("path-error", [path, gauges])
    with pytest.raises(InputError, match="no rapid of several axes"):
        make_report("unsynchronized-rapids", files(tmp_path, [CIRCLE], [[0, 1, 1, 0, 0], [1, 1, 1, 0, 0]]))
    path = tmp_path / "path.csv"
    path.write_text(path.read_text().replace("0,5,0,0", "0,5,0,7"))
    with pytest.raises(InputError, match="in plane 7"):
        make_report("path-error", [path, gauges])


def test_z_cannot_follow_the_pyramid_without_ramps_and_can_with(tmp_path: Path) -> None:
    """The thesis's last experiment, figure 5.22, on one face of the pyramid."""
    whole = find_bundled("pyramid").text()
    program = tmp_path / "face.ngc"
    program.write_text(whole.split("O100 CALL [0] [1]")[0].replace("REPEAT [6]", "REPEAT [2]") + "M2\n")
    machine = load_machine("starmill")
    errors = {}
    for motion in ("plan", "constant"):
        run = run_method("C", serial_motion(program, machine, motion=motion), machine)
        errors[motion] = run.error.max()
        assert bool(run.lost["Z"]) is (motion == "constant") and not run.lost["X"]
    assert errors["plan"] < 0.01 < 0.1 < errors["constant"]  # mm
