"""The part programs that come with the package: valid on their machine, run there, listed, copied, and in examples/."""

from __future__ import annotations

import json
from math import dist, pi
from pathlib import Path

import numpy as np
import pytest
from documents import ROOT
from typer.testing import CliRunner

import rds
from rds.cli.main import app
from rds.core.errors import InputError
from rds.machines import load_machine
from rds.nc.bundled import Bundled, bundled, bundled_paths, find_bundled
from rds.nc.check import motion
from rds.nc.run.run import PartProgram
from rds.nc.setup import Setup

PROGRAMS, PATHS = bundled(), bundled_paths()


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
            "circular_test",
            "quadrants",
            "pocket",
            "pyramid",
            "face",
            "hemisphere",
            "dcs-table-5-2",
            "oacs-p001",
            "slot",
            "sun",
        )
    }
    assert PROGRAMS["slot.ngc"].machine == PROGRAMS["sun.ngc"].machine == "three-axis-mill"
    assert PROGRAMS["pyramid.ngc"].machine == "starmill"
    assert PROGRAMS["oacs-p001.ngc"].machine == "mrmt-oacs"
    with pytest.raises(InputError, match="there are circle, circular_test, dcs-table-5-2"):
        find_bundled("star")


@pytest.mark.parametrize("program", PROGRAMS.values(), ids=PROGRAMS)
def test_it_is_valid_and_runs_in_simulation(program: Bundled, tmp_path: Path) -> None:
    file = copied(program, tmp_path)
    done = CliRunner().invoke(app, ["nc", "check", str(file), "--machine", program.machine, "--json"])
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert found["ok"] and found["segments"] > 0
    told = [warning["word"] for warning in found["warnings"]]
    assert told == (["S1000"] if program.file == "oacs-p001.ngc" else []), (
        "which the thesis's own program never turns on"
    )
    part = PartProgram(file, program.machine, sample_period=0.005)  # coarser than the machine, to be quick
    result = part.run("simulation")
    assert result.meta["program"]["completed"]
    assert result.meta["program"]["contour_error"]["max"] < 0.5  # mm
    for name in part.prepared.program.axes:
        assert result[f"{name}_measured"][-1] == pytest.approx(result[f"{name}_reference"][-1], abs=0.1)


def path(name: str) -> np.ndarray:
    program = find_bundled(name)
    return np.concatenate([block.segments for block in motion(program.path, load_machine(program.machine), Setup())])


def test_the_programs_of_the_theses_are_for_their_machines() -> None:
    assert {PROGRAMS[f"{name}.ngc"].machine for name in ("dcs-table-5-2", "face", "pyramid")} == {"starmill"}
    assert PROGRAMS["oacs-p001.ngc"].machine == "mrmt-oacs"


def test_stepper_axes_follow_rapids_within_two_steps_by_the_law_that_nobody_names() -> None:
    """Table 5.2 of dcs-thesis at 1.2 m/min: an axis that is faster than a sample shows an observer no velocity."""
    program = find_bundled("dcs-table-5-2")
    result = PartProgram(program.path, program.machine).run("simulation")
    assert result.meta["program"]["contour_error"]["max"] < 0.02  # mm; a step is 0.01
    assert result["X_measured"][-1] == pytest.approx(0.0, abs=0.02)


def test_the_shapes_are_what_their_titles_say() -> None:
    square = path("square")
    assert square["length"][~square["rapid"]] == pytest.approx([40.0] * 4)
    (circle,) = path("circle")
    assert circle["length"] == pytest.approx(2 * np.pi * 20)
    turns = path("circular_test")
    assert np.degrees(turns["sweep"][turns["plane"] >= 0]) == pytest.approx(
        [180, 360, 360, 180, -180, -360, -360, -180]
    )
    arcs = path("quadrants")
    assert np.degrees(arcs["sweep"]) == pytest.approx([90.0] * 4 + [-90.0] * 4)
    assert np.all(arcs["plane"] >= 0)
    middle = arcs["centre"][:, :2] + 0.5 * (arcs["start"] + arcs["end"])[:, :2] - arcs["centre"][:, :2]
    sides = np.sign(middle - arcs["centre"][:, :2]).astype(int).tolist()
    assert sides[:4] == [[1, 1], [-1, 1], [-1, -1], [1, -1]]
    strokes = [row["end"] - row["start"] for row in path("pyramid") if row["start"][2] == -6.0 and row["end"][2] == 0.0]
    assert len(strokes) == 24 and all(np.all(stroke[:3] != 0.0) for stroke in strokes)  # three axes at once
    slot = [row["end"] - row["start"] for row in path("slot") if not row["rapid"]]
    assert slot[1][:3] == pytest.approx(np.array([2.0, 2.0, -0.3]) * 25.4)  # inches: diagonal in XY and in XZ
    sun = path("sun")
    cut = sun[~sun["rapid"] & (np.diff([sun["start"][:, 2], sun["end"][:, 2]], axis=0)[0] == 0.0)]
    assert cut["length"] == pytest.approx(np.array([1.0, 1.5, 1.0, 1.5, 1.0]) * 25.4)  # a frame, and a bar
    assert cut["end"][-1][:2] == pytest.approx(np.array([2.0, 1.5]) * 25.4)
    pocket = path("pocket")
    cut = pocket[~pocket["rapid"]]
    assert np.ptp(cut["end"][:, 0]) == 40.0 and np.ptp(cut["end"][:, 1]) == 30.0 and cut["end"][-1, 2] == -1.0


@pytest.mark.parametrize("kind, of", [("programs", PROGRAMS), ("paths", PATHS)])
def test_the_examples_are_the_same(kind: str, of: dict[str, Bundled]) -> None:
    folder = ROOT / "examples" / kind
    assert {file.name: file.read_text() for file in folder.iterdir()} == {
        name: each.text() for name, each in of.items()
    }


@pytest.mark.parametrize(
    ("name", "length"),
    [
        ("square", 80.0),
        ("circle", 20.0 * pi),
        ("quadrants", 40.0 * pi),
        ("pocket", 8.0 + (44.0 - 16.0 + 4.0 * pi) + 4.0 + (76.0 - 16.0 + 4.0 * pi) + 12.0),
        ("dcs-table-5-2", 2 * dist((70.0, 20.0), (0.0, 0.0))),
        ("oacs-p001", dist((100.0, 25.0), (0.0, 0.0))),
    ],
)
def test_a_path_is_followed_by_the_example_of_an_interpolator(name: str, length: float) -> None:
    bundle = PATHS[f"{name}.toml"]
    reference = {"kind": "path", "file": str(bundle.path), "interpolator": str(ROOT / "examples/my_interpolator.py")}
    axes = ["X", "A"] if bundle.machine == "mrmt-oacs" else ["X", "Y"]
    experiment = rds.Experiment(
        machine=bundle.machine, axis=axes, controller="tracking", sample_period=0.01, reference=reference
    )
    result = experiment.run()
    way = np.column_stack([result[f"{axis}_reference"] for axis in axes])
    assert np.linalg.norm(np.diff(way, axis=0), axis=1).sum() == pytest.approx(length, rel=2e-3)
    about = result.meta["program"]
    assert about["path_error"]["max"] < 1e-9 and about["contour_error"]["max"] < 0.2
    assert all(share["acceleration"] < 1.0 for share in about["limit_shares"].values())


def test_the_command_lists_and_copies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    listed = json.loads(CliRunner().invoke(app, ["nc", "bundled", "--json"]).stdout)
    for kind, ending, of in (("programs", ".ngc", PROGRAMS), ("paths", "", PATHS)):
        found = {each["name"] + ending: each["machine"] for each in listed[kind]}
        assert found == {name: each.machine for name, each in of.items()}
    assert "pocket" in CliRunner().invoke(app, ["nc", "bundled"]).stdout
    done = CliRunner().invoke(app, ["nc", "bundled", "circle"])
    assert done.exit_code == 0 and Path("circle.ngc").read_text() == PROGRAMS["circle.ngc"].text()
    done = CliRunner().invoke(app, ["nc", "bundled", "circle.toml"])
    assert "path: circle.toml (for mini-cnc)" in done.stdout
    assert Path("circle.toml").read_text() == PATHS["circle.toml"].text()
    for words, said in (
        (["circle"], "is there already"),
        (["star"], "no part program or path 'star'"),
        (["-o", "x.ngc"], "none is named"),
    ):
        refused = CliRunner().invoke(app, ["nc", "bundled", *words])
        assert refused.exit_code == 2 and said in refused.output
