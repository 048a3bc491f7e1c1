"""`rds nc make` as its user sees it."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from rds.cli.main import app
from rds.nc.paths import arc, outline, picture, spiral_cone
from rds.nc.paths.drawing import parse_text_drawing
from tests.paths.programs import agreed

DRAWING = "......\n.####.\n.####.\n.##...\n......\n"
MAKERS: dict[str, list[str]] = {
    "line": ["--start", "-5,0", "--end", "10,5,-2"],
    "quad": ["--corner", "0,0", "--corner", "9,0", "--corner", "9,9", "--corner", "0,9"],
    "arc": ["--centre", "-1,2.5", "--radius", "5", "--start-angle", "-30", "--sweep", "-90", "--depth", "1"],
    "cone": [
        "--centre",
        "0,0",
        "--radius",
        "9",
        "--height",
        "3",
        "--step-height",
        "1",
        "--step-width",
        "1",
        "--tolerance",
        "0.01",
    ],
    "points": ["points.csv", "--close", "--depth", "1", "--tolerance", "0.01"],
    "outline": [
        "blob.txt",
        "--pixel",
        "0.5",
        "--tolerance",
        "0.2",
        "--arcs",
        "--depth",
        "2",
        "--passes",
        "2",
        "--at",
        "10,-20",
    ],
}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "blob.txt").write_text(DRAWING)
    (tmp_path / "points.csv").write_text("x [mm], y [mm]\n0,0\n0,0\n10,0\n10,10\n")
    return tmp_path


def make(*words: str) -> Any:
    return CliRunner().invoke(app, ["nc", "make", *words])


@pytest.mark.parametrize("kind", MAKERS)
def test_each_maker_writes_a_program_that_a_machine_can_run(kind: str) -> None:
    done = make(kind, *MAKERS[kind], "-f", "300", "--safe", "5", "--spindle", "900", "-o", "a.ngc", "--plot", "a.png")
    assert done.exit_code == 0, done.output
    assert done.stdout.startswith("a.ngc: ") and done.stdout.endswith("picture: a.png\n")
    text = Path("a.ngc").read_text()
    assert re.match(rf"\(rds nc make: (spiral )?{kind}", text)
    agreed(text)
    assert CliRunner().invoke(app, ["nc", "check", "a.ngc"]).exit_code == 0
    assert Path("a.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("kind", MAKERS)
def test_json_says_it_in_numbers(kind: str) -> None:
    done = make(kind, *MAKERS[kind], "-f", "300", "--safe", "5", "-o", "a.ngc", "--json")
    found = json.loads(done.stdout)
    assert found["file"] == "a.ngc" and found["picture"] is None
    assert found["lines"] + found["arcs"] > 0 and found["pieces"] == 1
    assert found["cutting_time_s"] == pytest.approx(found["length_mm"] / 5)  # 300 mm/min
    assert set(found["extent_mm"]) == set("XYZ")
    if "--tolerance" in MAKERS[kind]:
        assert 0 <= found["deviation_mm"] <= found["tolerance_mm"]
    if kind == "points":
        assert found["points"] == 3 and found["repeated_points_left_out"] == 1
    if kind == "outline":
        assert found["closed"] and found["outlines"] == 1 and found["specks_left_out"] == 0
        assert found["extent_mm"]["X"][0] > 10 and found["extent_mm"]["Y"][1] < -17


def test_repeated_points_and_specks_are_told() -> None:
    assert (
        "left out, as they repeat the one before: 1 point\n"
        in make("points", "points.csv", "-f", "1", "-o", "a").stdout
    )
    Path("dusty.txt").write_text(DRAWING + "....#.\n......\n")
    done = make("outline", "dusty.txt", "--pixel", "1", "--specks", "1", "-f", "1", "-o", "a")
    assert "left out, as islands or holes of few pixels: 1 speck\n" in done.stdout


@pytest.mark.parametrize(
    "words, said",
    [
        (
            ["line", "--start", "0;0", "--end", "1,1"],
            "--start '0;0' is not numbers with commas between them, as in 10,-2.5",
        ),
        (["line", "--start", "0,0", "--end", "0,0"], "--start and --end are the same point"),
        (["quad", "--corner", "0,0", "--start", "1,1"], "give --corner four times, or --start and --move three times"),
        (["quad", "--move", "0,1"], "--move needs a corner to begin at; give --start"),
        (["quad"], "give --corner four times"),
        (["quad", "--corner", "0,0"], "1 corners; a quadrilateral has 4"),
        ([*MAKERS["arc"][:-2], "--depth", "nan"], "--depth = nan must be a finite number"),
        (["cone", *MAKERS["cone"], "--step-angle", "2"], "--step-angle and --tolerance both say"),
        (["points", "none.csv"], "none.csv: cannot be read: No such file"),
        (["points", "points.csv", "--unit", "in"], "points.csv:1: unit 'mm', where 'in' is given already"),
        (["outline", "none.png", "--pixel", "1"], "none.png: cannot be read"),
        (["outline", "blob.txt", "--pixel", "1", "--trace", "edge"], "--trace = 'edge' must be one of: contour, blob"),
        (["outline", "blob.txt", "--pixel", "-1"], "blob.txt: --pixel = -1.0 must be more than 0"),
        (["outline", "blob.txt", "--pixel", "1", "--arcs"], "--arcs needs a --tolerance"),
        (["line", "--start", "0,0", "--end", "1,1", "--safe", "-1"], "--safe = -1 mm is not above the path"),
        (["line", "--start", "0,0", "--end", "1,1", "--plot", "a.jpg"], "a picture is a PNG file"),
    ],
)
def test_refusals_have_exit_code_2_and_write_nothing(words: list[str], said: str, folder: Path) -> None:
    words = ["arc", *words] if words[0] == "--centre" else words
    done = make(*words, "-f", "300", "-o", "a.ngc")
    assert done.exit_code == 2, done.output
    assert said in " ".join(done.stderr.split())
    assert sorted(path.name for path in folder.iterdir()) == ["blob.txt", "points.csv"]


def test_the_file_that_is_read_is_not_written_over() -> None:
    for words in (
        ["points", "points.csv", "-o", "./points.csv"],
        ["outline", "blob.txt", "--pixel", "1", "-o", "blob.txt"],
    ):
        done = make(*words, "-f", "300")
        assert done.exit_code == 2 and "is the file to read from" in done.stderr
    assert Path("blob.txt").read_text() == DRAWING


def test_pictures_show_start_direction_and_units() -> None:
    cone = picture(spiral_cone((0, 0), 20, 10, 2, 3, 5.0), "a cone")
    plan, height = cone.axes
    assert plan.get_aspect() == 1.0
    assert (plan.get_xlabel(), plan.get_ylabel()) == ("X [mm]", "Y [mm]")
    assert (height.get_xlabel(), height.get_ylabel()) == ("distance cut [mm]", "Z [mm]")
    lines = {line.get_label(): line for line in plan.get_lines()}
    assert np.allclose(lines["start"].get_xydata(), [[20, 0]]) and np.allclose(lines["end"].get_xydata(), [[5, 0]])
    for arrow in plan.texts:  # along a counter-clockwise path every head points that way
        (x, y), (dx, dy) = arrow.xy, np.subtract(arrow.xy, arrow.xyann)
        assert x * dy - y * dx > 0
    assert len(plan.texts) >= 10
    (flat,) = picture(arc((0, 0), 1, 0, 90, 5.0)).axes
    assert flat.get_title() == ""
    traced = outline(parse_text_drawing(DRAWING), 2.0, 5.0, at=(1, 1))
    (over,) = picture(traced.segments, drawing=traced).axes
    assert list(over.images[0].get_extent()) == [1, 13, 1, 11]
