"""Cutting force and joint loads along part programs, by hand where one can."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.machines import load_machine
from rds.machines.forces.cut_file import cut_of, read_cut
from rds.machines.forces.milling import cut
from rds.nc.run.forces import ProgramForces, program_forces
from rds.nc.run.prepare import prepare
from rds.nc.run.run import PartProgram

CUT = {"depth": 2.0, "teeth": 2, "diameter": 6.0, "speed": 500.0}
SQUARE = "G21 G90 G94 G61\nG0 X-5 Y-5\nG1 X5 F300\nY5\nX-5 F150\nY-5\nG0 X0 Y0\nM2\n"
FULL = 602.0 * 2.0 * (300.0 / (500.0 * 2)) ** 0.75  # N


def forces_of(tmp_path, text, machine="mini-cnc", T=0.005, **words) -> ProgramForces:
    path = tmp_path / "part.ngc"
    path.write_text(text)
    of = load_machine(machine)
    return program_forces(prepare(path, of, T=T), of, cut_of({**CUT, **words}))


def test_the_force_of_a_square_by_hand(tmp_path):
    found = forces_of(tmp_path, SQUARE)
    worst = {one.name: one for one in found.worst}
    assert worst["force"].value == pytest.approx(FULL, rel=1e-3)
    assert (worst["X"].value, worst["X"].line) == (pytest.approx(-FULL, rel=1e-3), 3)  # against the motion
    assert (worst["Y"].value, worst["Y"].line) == (pytest.approx(-FULL, rel=1e-3), 4)
    assert found.loads[found.line == 5, 0].max() == pytest.approx(FULL * 0.5**0.75, rel=1e-3)  # half the feed, back
    assert found.units == ("N", "N", "N")


def test_rapids_cut_nothing(tmp_path):
    found = forces_of(tmp_path, SQUARE)
    assert not found.force[(found.line == 2) | (found.line == 7)].any()
    assert found.force[found.line == 3].any()


def test_the_axial_share_is_along_the_tool(tmp_path):
    found = forces_of(tmp_path, SQUARE, axial=0.3)
    z = found.loads[:, found.joints.index("Z")]
    assert np.abs(z) == pytest.approx(0.3 * found.force, abs=1e-9)
    assert z.max() > 0.0  # into the tool, which is up


def test_the_force_is_where_the_user_says(tmp_path):
    """Along +X at line 3: the force against it is -X; a quarter turn on, seen from the spindle, it is -Y."""
    found = forces_of(tmp_path, SQUARE, direction=90.0)
    x, y = (found.loads[found.line == 3, found.joints.index(name)] for name in "XY")
    assert np.abs(x).max() < 1e-9 * FULL and y.min() == pytest.approx(-FULL, rel=1e-3)
    oblique = forces_of(tmp_path, SQUARE, direction=-30.0)
    assert np.hypot(oblique.loads[:, 0], oblique.loads[:, 1]) == pytest.approx(oblique.force, abs=1e-9 * FULL)
    assert oblique.loads[oblique.line == 3, 1].max() == pytest.approx(0.5 * FULL, rel=1e-3)


def test_the_spindles_power_along_a_program(tmp_path):
    """Equations 5.4 to 5.6 of dcs-thesis at 0.3 mm a tooth; the override brings the power to the limit."""
    own = {"width": 1.0, "rake": 14.0, "efficiency": 0.9}
    by_hand = cut(speed=500.0, teeth=2, feed=0.3, depth=2.0, diameter=6.0, kc11=700.0, mc=0.25, **own)
    limit = 0.6 * 1e3 * by_hand.power
    found = forces_of(tmp_path, SQUARE, **own, limits={"power": limit})
    worst = {one.name: one for one in found.worst}["power"]
    assert (worst.value, worst.unit) == (pytest.approx(1e3 * by_hand.power, rel=1e-3), "W")
    assert worst.share == pytest.approx(1 / 0.6, rel=1e-3)
    assert found.override().min() == pytest.approx(0.6 ** (1.0 / 0.75), rel=1e-3)
    (said,) = found.warnings()
    assert said.startswith("line 3") and f"and the spindle has {limit:g} W" in said
    assert "and in 1 more line" in said, "line 4 as fast; half the feed takes 0.59 of the power"
    assert "power" not in {one.name for one in forces_of(tmp_path, SQUARE).worst}
    mill = forces_of(
        tmp_path, "G21 G90 G94 G61\nS2000 M3\nG1 X15 F1100\nM2\n", "starmill", **{**own, "width": 5.0, "depth": 6.0}
    )
    assert "and the spindle has 160 W" in mill.warnings()[0], "table 5.1 of dcs-thesis, which no cut need name"
    at_160 = forces_of(tmp_path, SQUARE, **own, limits={"power": limit}).cut.limits
    assert at_160 == {"power": limit} and mill.cut.limits == {"power": 160.0}
    with pytest.raises(InputError, match="W is a limit of a power that does not follow: width is missing"):
        forces_of(tmp_path, SQUARE, limits={"power": 10.0})
    part = PartProgram(tmp_path / "part.ngc", "mini-cnc", cut=cut_of({**CUT, **own, "limits": {"power": limit}}))
    assert any("the feed is lowered there" in note for note in part.prepared.notes)


def test_a_table_that_turns_bears_a_torque(tmp_path):
    """Tangential cutting at the radius r of the table: r F about it."""
    machine = load_machine("mrm-mill-4").kinematics
    (table,) = (name for name, turns in zip(machine.joints, machine.turns, strict=True) if turns)
    text = f"G21 G90 G94 G61\nG1 X4 Y7 F300\nG1 {table}20 F300\nM2\n"
    found = forces_of(tmp_path, text, "mrm-mill-4")
    rows = np.flatnonzero((found.line == 3) & (found.force > 0.5 * found.force[found.line == 3].max()))
    load = found.loads[rows, found.joints.index(table)]
    # the joint alone moves: its load does the work that the force takes, M ω = F v
    prepared = prepare(tmp_path / "part.ngc", load_machine("mrm-mill-4"), T=0.005)
    program = prepared.program
    q = np.array([[row[program.axes.index(name)] for name in found.joints] for row in program.position[rows]])
    lever = np.linalg.norm(machine.jacobian(q)[:, :3, found.joints.index(table)], axis=1) / 1000.0  # m
    assert np.abs(load) == pytest.approx(found.force[rows] * lever, rel=1e-9)
    assert lever.min() > 0.0


def test_the_override_keeps_the_limits(tmp_path):
    found = forces_of(tmp_path, SQUARE, limits={"force": 200.0, "Y": 150.0})
    override = found.override()
    kept = found.force * override**0.75
    assert kept.max() <= 200.0 * (1 + 1e-9)
    assert (np.abs(found.loads[:, 1]) * override**0.75).max() <= 150.0 * (1 + 1e-9)
    assert override.min() == pytest.approx((150.0 / FULL) ** (1 / 0.75), rel=1e-3)
    assert (override[found.force < 100.0] == 1.0).all()


def test_what_will_not_do_is_refused(tmp_path):
    with pytest.raises(InputError, match="line 3 cuts while the spindle stands"):
        path = tmp_path / "part.ngc"
        path.write_text(SQUARE)
        of = load_machine("mini-cnc")
        program_forces(prepare(path, of), of, cut_of({k: v for k, v in CUT.items() if k != "speed"}))
    with pytest.raises(InputError, match="mini-cnc has no joint 'C' to limit; there are force, power, X, Y, Z"):
        forces_of(tmp_path, SQUARE, limits={"C": 3.0})
    with pytest.raises(InputError, match="depth is missing"):
        cut_of({"diameter": 6.0})
    (tmp_path / "cut.toml").write_text("depth = 2.0\ndiameter = 6.0\nwidht = 3.0\n")
    with pytest.raises(InputError, match="line 3: unknown key 'widht'"):
        read_cut(tmp_path / "cut.toml")


def test_the_command(tmp_path):
    path, out = tmp_path / "part.ngc", tmp_path / "forces.png"
    path.write_text(SQUARE)
    words = ["forces", "mini-cnc", str(path), "--depth", "2", "--teeth", "2", "--diameter", "6", "--speed", "500"]
    told = CliRunner().invoke(app, [*words, "--limit", "Y=150", "--out", str(out), "--json"])
    assert told.exit_code == 1, told.output
    found = json.loads(told.stdout)
    assert found["loads"]["Y"]["line"] == 4 and found["loads"]["Y"]["share"] > 1.0
    assert found["least_override"]["line"] in (4, 6)
    assert out.read_bytes().startswith(b"\x89PNG")
    told = CliRunner().invoke(app, [*words, "--limit", "Y=150"])
    assert "exceeded: joint Y; a feed of" in told.stdout
    (tmp_path / "cut.toml").write_text("depth = 2.0\nteeth = 2\ndiameter = 6.0\nspeed = 500\n[limits]\nY = 900.0\n")
    words = ["forces", "mini-cnc", str(path), "--cut", str(tmp_path / "cut.toml")]
    assert CliRunner().invoke(app, words).exit_code == 0
    for option, value in (("--limit", "Y=1"), ("--coefficients", "mine.toml")):
        told = CliRunner().invoke(app, [*words, option, value])
        assert told.exit_code == 2 and f"{option} belongs into the file of --cut" in told.stderr
