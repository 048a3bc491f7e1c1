"""The part programs that come with the package: valid on their machine, run there, listed, copied, and in examples/."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from documents import ROOT
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.machines import load_machine
from rds.nc.bundled import Bundled, bundled, find_bundled
from rds.nc.check import Setup, motion
from rds.nc.run.run import PartProgram

PROGRAMS = bundled()


def copied(program: Bundled, folder: Path) -> Path:
    file = folder / program.file
    file.write_text(program.text())
    return file


def test_there_are_those_of_the_paper_and_of_the_theses() -> None:
    assert set(PROGRAMS) == {
        f"{name}.ngc"
        for name in (
            "square",
            "circle",
            "quadrants",
            "pocket",
            "pyramid",
            "face",
            "hemisphere",
            "dcs-table-5-2",
            "oacs-p001",
        )
    }
    assert PROGRAMS["pyramid.ngc"].machine == "starmill"
    assert PROGRAMS["oacs-p001.ngc"].machine == "mrmt-oacs"
    with pytest.raises(InputError, match="there are circle, dcs-table-5-2"):
        find_bundled("star")


@pytest.mark.parametrize("program", PROGRAMS.values(), ids=PROGRAMS)
def test_it_is_valid_and_runs_in_simulation(program: Bundled, tmp_path: Path) -> None:
    file = copied(program, tmp_path)
    done = CliRunner().invoke(app, ["nc", "check", str(file), "--machine", program.machine, "--json"])
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert found["ok"] and found["warnings"] == [] and found["segments"] > 0
    part = PartProgram(file, program.machine, sample_period=0.005)  # coarser than the machine, to be quick
    result = part.run("simulation")
    assert result.meta["program"]["completed"]
    assert result.meta["program"]["contour_error"]["max"] < 0.5  # mm
    for name in part.prepared.program.axes:
        assert result[f"{name}_measured"][-1] == pytest.approx(result[f"{name}_reference"][-1], abs=0.1)


def path(name: str) -> np.ndarray:
    program = find_bundled(name)
    return np.concatenate([block.segments for block in motion(program.path, load_machine(program.machine), Setup())])


def test_the_shapes_are_what_their_titles_say() -> None:
    square = path("square")
    assert square["length"][~square["rapid"]] == pytest.approx([40.0] * 4)
    (circle,) = path("circle")
    assert circle["length"] == pytest.approx(2 * np.pi * 20)
    arcs = path("quadrants")
    assert np.degrees(arcs["sweep"]) == pytest.approx([90.0] * 4 + [-90.0] * 4)
    assert np.all(arcs["plane"] >= 0)
    middle = arcs["centre"][:, :2] + 0.5 * (arcs["start"] + arcs["end"])[:, :2] - arcs["centre"][:, :2]
    sides = np.sign(middle - arcs["centre"][:, :2]).astype(int).tolist()
    assert sides[:4] == [[1, 1], [-1, 1], [-1, -1], [1, -1]]
    strokes = [row["end"] - row["start"] for row in path("pyramid") if row["start"][2] == -6.0 and row["end"][2] == 0.0]
    assert len(strokes) == 24 and all(np.all(stroke[:3] != 0.0) for stroke in strokes)  # three axes at once
    pocket = path("pocket")
    cut = pocket[~pocket["rapid"]]
    assert np.ptp(cut["end"][:, 0]) == 40.0 and np.ptp(cut["end"][:, 1]) == 30.0 and cut["end"][-1, 2] == -1.0


def test_the_examples_are_the_same() -> None:
    folder = ROOT / "examples" / "programs"
    assert {file.name: file.read_text() for file in folder.iterdir()} == {
        name: program.text() for name, program in PROGRAMS.items()
    }


def test_the_command_lists_and_copies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    listed = json.loads(CliRunner().invoke(app, ["nc", "bundled", "--json"]).stdout)["programs"]
    assert {each["name"] + ".ngc": each["machine"] for each in listed} == {
        name: program.machine for name, program in PROGRAMS.items()
    }
    assert "pocket" in CliRunner().invoke(app, ["nc", "bundled"]).stdout
    done = CliRunner().invoke(app, ["nc", "bundled", "circle"])
    assert done.exit_code == 0 and Path("circle.ngc").read_text() == PROGRAMS["circle.ngc"].text()
    for words, said in (
        (["circle"], "is there already"),
        (["star"], "no part program 'star'"),
        (["-o", "x.ngc"], "none is named"),
    ):
        refused = CliRunner().invoke(app, ["nc", "bundled", *words])
        assert refused.exit_code == 2 and said in refused.output
