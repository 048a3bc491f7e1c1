"""`rds nc methods`: interpolators beside each other, by numbers that closed forms know."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.nc.run.methods import COLUMNS, compare_methods

CIRCLE = 'start = [0.0, 0.0]\nfeed = 600\n[[segment]]\nkind = "arc"\nend = [0.0, 0.0]\ncentre = [2.0, 0.0]\n'
HALVES = """
from math import ceil, dist


def interpolate(segment, T, params):
    samples = ceil(dist(segment.start, segment.end) / (segment.feed_rate * T) - 1e-9)
    for k in range(1, samples + 1):
        share = k / samples
        at = [a + (b - a) * share for a, b in zip(segment.start, segment.end)]
        yield at, [(b - a) / (samples * T) for a, b in zip(segment.start, segment.end)], [0.0] * len(at)
"""


def test_the_library_along_a_circle(tmp_path: Path) -> None:
    path = tmp_path / "circle.toml"
    path.write_text(CIRCLE)
    found = {each.name: each for each in compare_methods(path, sample_period=0.002)}
    number = {name: dict(zip(COLUMNS[1:], each.numbers, strict=False)) for name, each in found.items()}
    assert "straight moves only" in found["linear"].refused and not found["linear"].numbers
    circular = number["circular"]
    # a point on the circle at each sample, N of them in a turn: speed = N chords over N T; jerk = v³/r²
    assert circular["path error, max [µm]"] < 1e-6 and circular["feed ripple [%]"] < 0.2
    assert circular["jerk, max [mm/s³]"] == pytest.approx(10.0**3 / 2.0**2, rel=0.02)
    # reference word: one BLU (10 µm) is kept
    for name in ("euler", "improved-euler", "taylor", "tustin", "improved-tustin"):
        assert 1.0 < number[name]["path error, max [µm]"] <= 10.0 + 1e-6, name
    assert all(each["compute, median [µs]"] > 0.0 for each in number.values() if each)
    assert 1.0 < circular["contour error, RMS [µm]"] < circular["contour error, max [µm]"] < 100.0


def test_the_axes_are_those_behind_the_bus(tmp_path: Path) -> None:
    """What is commanded is the same; the machine's gains, play and delay are in what is measured."""
    path = tmp_path / "circle.toml"
    path.write_text(CIRCLE)
    built, model = (
        {each.name: each.numbers for each in compare_methods(path, sample_period=0.005, as_built=as_built)}
        for as_built in (True, False)
    )
    assert built["tustin"][2:5] == model["tustin"][2:5] and built["tustin"][:2] != model["tustin"][:2]
    assert built["tustin"][1] > model["tustin"][1]
    refused = CliRunner().invoke(app, ["nc", "methods", str(path), "--plant", "real"])
    assert refused.exit_code == 2 and "--plant 'real' must be machine or model" in refused.output


def test_a_method_of_one_kind_is_refused_where_the_other_comes(tmp_path: Path) -> None:
    """In the middle of the path, by the loop; the others are compared all the same."""
    path = tmp_path / "both.toml"
    path.write_text(CIRCLE + '[[segment]]\nkind = "line"\nend = [0.5, 0.0]\n')
    refused = {each.name: each.refused for each in compare_methods(path, sample_period=0.01) if each.refused}
    assert set(refused) == {"linear", "circular"}
    assert "straight moves only" in refused["linear"] and "arcs only" in refused["circular"]


def test_a_program_is_read_with_its_tools_and_options(tmp_path: Path) -> None:
    program, table = tmp_path / "short.ngc", tmp_path / "tools.tbl"
    program.write_text("G21 G90\nT1 M6\nF600\nG1 X0.1 Y0.1\n")
    table.write_text("T1 P1 Z0 D3\n")
    options = ["nc", "methods", str(program), "--json", "--period", "0.01", "--with", "open-end"]
    told = json.loads(CliRunner().invoke(app, [*options, "--tools", str(table)]).stdout)
    assert "linear" in str(told["tables"])
    without = CliRunner().invoke(app, options)
    assert without.exit_code == 2 and "the tool table has no tool 1" in without.output
    path = tmp_path / "circle.toml"
    path.write_text(CIRCLE)
    with pytest.raises(InputError, match="are of part programs; leave them out"):
        compare_methods(path, setup={"tools": table})


def test_an_own_file_stands_beside_them_and_the_page_is_written(tmp_path: Path) -> None:
    (tmp_path / "line.toml").write_text('start = [0.0]\nfeed = 600\n[[segment]]\nkind = "line"\nend = [2.0]\n')
    (tmp_path / "halves.py").write_text(HALVES)
    words = ["nc", "methods", str(tmp_path / "line.toml"), "--add", str(tmp_path / "halves.py"), "--period", "0.002"]
    ran = CliRunner().invoke(app, [*words, "--acceleration", "linear", "--out", str(tmp_path / "out"), "--json"])
    assert ran.exit_code == 0, ran.output
    told = json.loads(ran.stdout)
    rows = {row[0]: row for row in told["tables"][0]["rows"]}
    assert rows["halves.py"][1:4] == pytest.approx(rows["constant-velocity"][1:4])
    assert (tmp_path / "out" / "interpolators.html").is_file()
    assert (tmp_path / "out" / "interpolators-methods.png").stat().st_size > 10_000


def test_what_is_wrong_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such path or part program"):
        compare_methods(tmp_path / "none.toml")
    (tmp_path / "line.toml").write_text('start = [0.0]\nfeed = 600\n[[segment]]\nkind = "line"\nend = [2.0]\n')
    with pytest.raises(InputError, match="there is no file"):
        compare_methods(tmp_path / "line.toml", ["none.py"])
