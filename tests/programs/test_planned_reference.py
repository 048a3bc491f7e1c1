"""A path whose motion is planned before the run: `profile` of `[reference] kind = "path"`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import rds
from rds.cli.main import app
from rds.core.errors import InputError
from rds.interpolators.motion.profiles import PROFILES
from rds.modes.loop.execution import State
from rds.modes.loop.retimed import EXCESS
from rds.nc.run.run import PartProgram

PATH = (
    'start = [2.0, 0.0]\nfeed = 600\n[[segment]]\nkind = "arc"\nend = [2.0, 0.0]\ncentre = [4.0, 0.0]\n'
    '[[segment]]\nkind = "line"\nend = [6.0, 4.0]\n'
)
PART = "G21 G90\nF600\nG1 X3\nG4 P0.05\nG1 Y3 Z-1\nM2\n"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "path.toml").write_text(PATH)
    (tmp_path / "part.ngc").write_text(PART)
    return tmp_path


def follow(axes: tuple[str, ...] = ("X", "Y"), **words: Any) -> rds.Experiment:
    reference = {"kind": "path", "file": "path.toml", "profile": "planned", **words}
    return rds.Experiment(axis=axes, controller="tracking", reference=reference)


@pytest.mark.parametrize("profile", list(PROFILES))
def test_every_profile_leads_along_the_path_within_what_it_promises(here: Path, profile: str) -> None:
    result = follow(profile=profile).run()
    about = result.meta["program"]
    assert result.meta["ending"] == "done" and about["profile"] == profile
    assert (result["X_reference"][-1], result["Y_reference"][-1]) == (6.0, 4.0)
    assert about["path_error"]["max"] < (0.3 if profile == "blended" else 1e-6)
    assert about["contour_error"]["max"] < 0.35 and about["contour_error"]["unit"] == "mm"
    assert about["predicted_samples"] == about["moving_samples"] == len(result)
    kinds = [kind for kind in PROFILES[profile].promised if kind != "deviation"]
    assert all(about["limit_shares"][axis][kind] <= 1.0 + 1e-6 for axis in "XY" for kind in kinds)
    assert about["certificate"]["samples"] == len(result)


def test_the_axes_are_led_to_the_start_and_rest_there(here: Path) -> None:
    result = follow().run()
    assert "a straight line leads to the start of the path" in " ".join(result.meta["notes"])
    assert sorted(set(result["program_line"].astype(int))) == [0, 1, 2]
    arrived = int(np.argmax(result["X_reference"] > 2.0 - 1e-6))
    assert np.abs(result["X_reference_velocity"][arrived - 1 : arrived + 1]).max() < 0.05  # of 10 mm/s


def test_other_axes_than_the_first_two(here: Path) -> None:
    result = follow(("X", "Z")).run()
    assert result["Z_reference"][-1] == 4.0 and result.meta["program"]["path_error"]["max"] < 1e-6


def test_a_part_program_moves_as_rds_nc_run_moves_it(here: Path) -> None:
    result = follow(("X", "Y", "Z"), file="part.ngc", profile="trapezoid").run()
    planned = PartProgram("part.ngc", profile="trapezoid").run()
    for axis in "XYZ":
        assert np.array_equal(result[f"{axis}_reference"], planned[f"{axis}_reference"])
    assert (result["program_state"] == State.DWELL).sum() == (planned["program_state"] == State.DWELL).sum() > 40
    assert "the spindle stands" in " ".join(result.meta["notes"])


@pytest.mark.parametrize("file", ["path.toml", "part.ngc"])
def test_the_motion_is_planned_once_until_something_changes(here: Path, file: str) -> None:
    experiment = follow(("X", "Y", "Z")[: 2 if file == "path.toml" else 3], file=file)
    first, second = experiment.plan().program, experiment.plan("emulation").program
    assert first is not None and second is not None and second.position is first.position
    text = (here / file).read_text()
    (here / file).write_text(text.replace("X3", "X5").replace("6.0", "7.0"))
    changed = experiment.plan().program
    assert changed is not None and changed.position.max() != first.position.max()
    (here / "mine.toml").write_text(Path(rds.load_machine("mini-cnc").path).read_text().replace("200.0", "150.0"))
    slower = experiment.with_machine("mine.toml").plan().program
    assert slower is not None and slower.samples > changed.samples


def test_it_is_held_and_hurried_on_its_path(here: Path) -> None:
    result = follow().run(changes=[(0.3, "hold", 1), (0.6, "hold", 0), (0.8, "override", 1.5)])
    assert (result["program_state"] == State.HELD).sum() > 100 and result["program_override"].max() > 1.49
    assert result.meta["program"]["path_error"]["max"] < 1e-4
    shares = result.meta["program"]["limit_shares"]
    assert all(shares[axis]["acceleration"] <= 1.0 + EXCESS for axis in "XY")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"interpolator": "tustin"}, "interpolator goes with an interpolator, which makes it: give one of them"),
        ({"look_ahead": 5}, "look_ahead goes with an interpolator"),
        ({"acceleration": "linear"}, "acceleration goes with"),
        ({"profile": "plannd"}, "'plannd'.*known: planned"),
    ],
)
def test_words_that_do_not_go_together_are_refused(here: Path, words: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        follow(**words)


def test_the_command_leaves_the_picture_and_the_certificate(here: Path) -> None:
    (here / "e.toml").write_text(
        'axes = ["X", "Y"]\nsample_period = 0.002\n[reference]\nkind = "path"\nfile = "path.toml"\n'
        'profile = "planned"\n[controller]\nname = "tracking"\n'
    )
    ran = CliRunner().invoke(app, ["run", "e.toml", "--out", "out"])
    assert ran.exit_code == 0, ran.output
    text = (here / "out" / "program.html").read_text()
    assert "off the programmed path, in segment" in text and "as predicted to the sample" in text
    assert (here / "out" / "program-certificate.png").is_file()


@pytest.mark.realtime
def test_emulation_repeats_simulation(here: Path) -> None:
    emulated, simulated = follow().run("emulation", out=here / "out"), follow().run()
    for name in simulated.columns:
        assert np.array_equal(simulated[name], emulated[name]), name
