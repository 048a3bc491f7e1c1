"""`rds machine new|show|pose|joints|urdf|script|modules` and `rds check` of machines."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from machines.machine_text import link, text
from machines.test_ncc import ERRORS, PAPER
from machines.test_urdf import ASKEW
from typer.testing import CliRunner, Result

from rds.cli.main import app


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def rds(*words: str) -> Result:
    return CliRunner().invoke(app, list(words))


def told(*words: str) -> dict:
    done = rds(*words, "--json")
    assert done.exit_code == 0, done.stderr
    return json.loads(done.stdout)


def test_the_head_of_a_part_program_becomes_the_machine_that_runs_it() -> None:
    """The whole example of mrm-control, section 5, which goes on with NC code in N009."""
    Path("part.ngc").write_text(PAPER + ERRORS + "N009 G90 T1 F100\nG21 G1 C20\nM2\n")
    assert told("machine", "new", "part.ngc", "-o", "own.toml")["ok"] is True
    tip = told("machine", "pose", "own.toml", "--joints", "C=0")["position"]
    assert tip == pytest.approx([-80.0 * 0.984807753, -80.0 * 0.173648178, 70.0 - 370.0 - 140.0])  # RF03: 10 degrees
    Path("early.ngc").write_text(PAPER.replace("N005 BUILD\n", "") + "G21\nM2\n")
    assert "line 5: G21 before BUILD" in rds("machine", "new", "early.ngc", "-o", "early.toml").stderr


def test_a_script_becomes_a_machine_and_a_machine_a_script() -> None:
    Path("own.ncc").write_text(PAPER)
    done = rds("machine", "new", "own.ncc", "-o", "own.toml")
    assert done.exit_code == 0
    assert "wrote own.toml" in done.stdout and "own: a machine" in done.stdout
    assert "such a file already" in rds("machine", "new", "own.ncc", "-o", "own.toml").stderr
    assert told("check", "own.toml")["ok"] is True
    assert told("machine", "script", "own.toml", "-o", "again.ncc") == {"file": "again.ncc"}
    assert told("machine", "new", "again.ncc", "-o", "again.toml")["ok"] is True
    Path("own.ncc").write_text(PAPER.replace("LN2", "LN5"))
    done = rds("machine", "new", "own.ncc", "-o", "other.toml")
    assert done.exit_code == 2 and "own.ncc, line 2: LN5 out of order" in done.stderr
    assert not Path("other.toml").exists()


def test_a_urdf_that_is_refused_leaves_the_machine_that_was_there() -> None:
    limit = '<axis xyz="1 0 0"/><limit lower="-1" upper="1"/>'
    urdf = ASKEW.replace("continuous", "prismatic").replace('<axis xyz="0 1 1"/>', limit)
    Path("own.xml").write_text(urdf)  # by whatever name
    assert rds("machine", "new", "own.xml", "-o", "own.toml").exit_code == 0
    before = Path("own.toml").read_text()
    Path("own.urdf").write_text(urdf.replace('name="q"', 'name=""'))
    done = rds("machine", "new", "own.urdf", "-o", "own.toml", "--force")
    assert done.exit_code == 2 and "own.toml is not written" in done.stderr
    assert Path("own.toml").read_text() == before
    assert rds("machine", "new", "own.urdf", "-o", "new.toml").exit_code == 2
    assert not Path("new.toml").exists()


def test_what_is_no_machine_is_exit_code_1() -> None:
    Path("own.toml").write_text(text("X", link(axis="X", module="slide-x") + link(module="drilling-head")))
    done = rds("check", "own.toml")
    assert done.exit_code == 1
    assert "own: no machine" in done.stdout and "no slide moves it so" in done.stdout
    assert json.loads(rds("check", "own.toml", "--json").stdout)["ok"] is False


def test_poses_and_joints() -> None:
    pose = told("machine", "pose", "xyzac", "--joints", "X=10,A=30,C=45")
    where = ",".join(f"{k}={v!r}" for k, v in zip("xyz", pose["position"], strict=True))
    aim = ",".join(f"{k}={v!r}" for k, v in zip("ijk", pose["direction"], strict=True))
    found = told("machine", "joints", "xyzac", "--pose", f"{where},{aim}")["joints"]
    assert found == pytest.approx({"X": 10.0, "Y": 0.0, "Z": 0.0, "A": 30.0, "C": 45.0}, abs=1e-6)
    near = told("machine", "joints", "xyzac", "--pose", f"{where},{aim}", "--near", "A=-30,C=225")["joints"]
    assert (near["A"], near["C"]) == pytest.approx((-30.0, 225.0))
    assert told("machine", "joints", "xyzac", "--pose", "z=-50,a=20")["joints"]["A"] == pytest.approx(20.0)
    beyond = rds("machine", "joints", "mrm-mill", "--pose", "z=500")
    assert beyond.exit_code == 1 and "cannot reach" in beyond.stderr
    assert "outside its limits, -100 to 100" in rds("machine", "pose", "mrm-mill", "--joints", "X=101").stderr


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["pose", "xyzac", "--joints", "X"], "must be NAME=NUMBER"),
        (["pose", "xyzac", "--joints", "X=1,X=2"], "names X twice, 1 and 2"),
        (["pose", "xyzac", "--joints", "Q=1"], "has no joint 'Q'"),
        (["joints", "xyzac", "--pose", "q=1"], "--pose has no 'q'"),
        (["joints", "xyzac", "--pose", "i=1,a=1"], "give one of them"),
        (["new", "-o", "a.toml"], "none is given"),
        (["new", "a.ncc", "--scan", "-o", "a.toml"], "2 are given"),
        (["new", "a.ncc", "--order", "1", "-o", "a.toml"], "belong to --scan"),
        (["new", "a.ncc", "-o", "a.txt"], "must end with .toml"),
        (["show", "xyzac", "-o", "a.bmp"], "must end with .png"),
        (["urdf", "mini-cnc", "-o", "a.urdf"], "has no links"),
    ],
)
def test_what_is_refused(words: list[str], says: str) -> None:
    done = rds("machine", *words)
    assert done.exit_code == 2
    assert says in done.stderr


def test_pictures_are_drawn() -> None:
    made = told("machine", "show", "mrmt-oacs", "-o", "own.html")
    assert made["singular"] == [{"X": -83.5}]
    assert "<svg" in Path("own.html").read_text() and "tool tip" in Path("own.html").read_text()
    assert rds("machine", "show", "mrmt-oacs").exit_code == 0
    assert Path("mrmt-oacs.png").read_bytes().startswith(b"\x89PNG")


def test_the_library_is_listed() -> None:
    assert told("machine", "modules")["oacs-range-arm"]["kind"] == "accessory"
    assert "bolted head" in rds("machine", "modules").stdout
    assert told("machine", "urdf", "xyzac", "-o", "a.urdf") == {"file": "a.urdf"}


@pytest.mark.realtime
def test_a_machine_is_made_of_a_scan() -> None:
    """Served, scanned, put in order with the range arm: the thesis's machine."""
    from rds.bus.modules.server_process import end_server, start_server
    from rds.machines import load_machine

    own = load_machine("mrmt-oacs")
    server = start_server("oacs", own.path, "made-by-scan")
    try:
        made = rds(
            *("machine", "new", "--scan", "-c", "made-by-scan", "-o", "own.toml"),
            *("--order", "5,oacs-range-arm,2,4,3"),
        )
        assert made.exit_code == 0, made.stderr + made.stdout
        again, q = load_machine("own.toml").kinematics, own.kinematics.random(10)
        order = [own.kinematics.joints.index(name) for name in again.joints]
        assert abs(again.forward(q[:, order]) - own.kinematics.forward(q)).max() < 1e-3
        refused = rds("machine", "new", "--scan", "-c", "made-by-scan", "-o", "b.toml", "--order", "5,2,3,4")
        assert refused.exit_code == 2 and "does not fit on" in refused.stderr
    finally:
        end_server(server)
