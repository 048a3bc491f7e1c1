"""Kinematics as numbers: LinuxCNC's 5-axis tables, the inverse of every machine, the Jacobian, singular poses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from machines.machine_text import link, machine

from rds.core.errors import InputError
from rds.machines import Machine, load_machine, machine_names
from rds.machines.configuration import verdict
from rds.machines.kinematics import identity_of
from rds.machines.kinematics.kinematics import pose

MACHINES = {name: load_machine(name) for name in machine_names()}


def turned(axis: int, degrees: float) -> np.ndarray:
    """The rotation about x, y or z."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    first, second = (axis + 1) % 3, (axis + 2) % 3
    made = np.eye(3)
    made[first, first] = made[second, second] = c
    made[second, first], made[first, second] = s, -s
    return made


@settings(max_examples=30, deadline=None)
@given(
    joints=st.tuples(*[st.floats(-100, 100)] * 3, st.floats(-100, 100), st.floats(-350, 350)),
    tilting=st.sampled_from(["xyzac", "xyzbc"]),
)
def test_the_five_axis_tables_move_as_linuxcnc_s_with_conventional_directions(
    joints: tuple[float, ...], tilting: str
) -> None:
    """Its trtfuncs.c in vectors: the slides' place, seen from the tilting centre, turned, and turned with the table.

    p = r + Rz(c)(Rx(a)(j - d - t - r) + d), with rot-point r, offset d and tool length t; LinuxCNC adds t again, as it
    subtracts the tool's length elsewhere.
    """
    rotation_point, length = np.array([0.0, 0.0, -80.0]), np.array([0.0, 0.0, 50.0])
    offset = np.array([0.0, 20.0, 10.0]) if tilting == "xyzac" else np.array([20.0, 0.0, 10.0])
    slides = np.array(joints[:3])
    tilt, table = turned(0 if tilting == "xyzac" else 1, joints[3]), turned(2, joints[4])
    expected = rotation_point + table @ (tilt @ (slides - offset - length - rotation_point) + offset)
    got = MACHINES[tilting].kinematics.forward(np.array(joints))
    np.testing.assert_allclose(got[:3, 3], expected, atol=1e-9)
    np.testing.assert_allclose(got[:3, :3], table @ tilt, atol=1e-12)


@settings(max_examples=20, deadline=None)
@given(shoulder=st.floats(-170, 170), elbow=st.floats(20, 150), quill=st.floats(-100, 100))
def test_a_scara_arm_of_links_moves_as_linuxcnc_s_scarakins(
    tmp_path_factory: pytest.TempPathFactory, shoulder: float, elbow: float, quill: float
) -> None:
    """Forward in closed form, x = 150 cos a + 120 cos (a + c); the numerical inverse returns to the joints near by."""
    links = link(name="shoulder", axis="A", joint="ZA", offset=[0.0, 0.0, 200.0])
    links += link(name="elbow", axis="C", joint="ZA", offset=[150.0, 0.0, 0.0])
    links += link(name="quill", axis="Z", joint="Z", offset=[120.0, 0.0, 0.0])
    tables = '[tool]\nlink = "quill"\nangles = [180.0, 0.0, 0.0]\n[work]\nlink = "bed"\n'
    kinematics = machine(tmp_path_factory.mktemp("scara"), "ACZ", links + tables).kinematics
    joints = {"A": shoulder, "C": elbow, "Z": quill}
    tip = kinematics.forward(joints)[..., :3, 3].ravel()
    a, both = np.radians(shoulder), np.radians(shoulder + elbow)
    place = [150 * np.cos(a) + 120 * np.cos(both), 150 * np.sin(a) + 120 * np.sin(both), 200 + quill]
    np.testing.assert_allclose(tip, place, atol=1e-9)
    found = kinematics.inverse(kinematics.forward(joints), near={name: q + 3.0 for name, q in joints.items()})
    ordered = [joints[name] for name in kinematics.joints]
    np.testing.assert_allclose(np.ravel(found), ordered, atol=1e-6)


def test_the_oracle_is_linuxcnc_s_formula() -> None:
    """The first component of xyzacKinematicsForward, written out as there with con = 1, for one pose."""
    x, y, z, a, c = 31.0, -17.0, 60.0, np.radians(35.0), np.radians(-70.0)
    dy, dz, z_rot = 20.0, 10.0 + 50.0, -80.0
    p = np.cos(c) * x - np.sin(c) * np.cos(a) * (y - dy) + np.sin(c) * np.sin(a) * (z - dz - z_rot) - np.sin(c) * dy
    got = MACHINES["xyzac"].kinematics.forward({"X": 31.0, "Y": -17.0, "Z": 60.0, "A": 35.0, "C": -70.0})
    assert got[0, 3] == pytest.approx(p, abs=1e-12)


@pytest.mark.parametrize("name", MACHINES)
def test_forward_and_inverse_return_to_where_they_started(name: str) -> None:
    kinematics = MACHINES[name].kinematics
    assert kinematics.structure.form, "each machine that is shipped has a closed form"
    q = kinematics.random(500, seed=3)
    poses = kinematics.forward(q)
    np.testing.assert_allclose(kinematics.inverse(poses, near=q), q, atol=1e-7)
    again = kinematics.forward(kinematics.inverse(poses))
    np.testing.assert_allclose(again[:, :3, 2:], poses[:, :3, 2:], atol=1e-6)


@pytest.mark.parametrize("name", MACHINES)
def test_the_numeric_inverse_agrees_with_the_closed_form(name: str) -> None:
    from rds.machines.kinematics.inverse import _numeric

    kinematics = MACHINES[name].kinematics
    q = kinematics.random(5, seed=4)
    found = _numeric(kinematics, kinematics.forward(q), None, kinematics.limits)
    np.testing.assert_allclose(kinematics.forward(found)[:, :3, 2:], kinematics.forward(q)[:, :3, 2:], atol=1e-6)


@pytest.mark.parametrize("name", MACHINES)
def test_the_jacobian_is_the_derivative_of_forward(name: str) -> None:
    kinematics = MACHINES[name].kinematics
    q, h = kinematics.random(20, seed=5), 1e-5
    poses, jacobian = kinematics.forward(q), kinematics.jacobian(q)
    for number, turns in enumerate(kinematics.turns):
        step = np.zeros(len(kinematics.joints))
        step[number] = h
        change = (kinematics.forward(q + step) - kinematics.forward(q - step)) / (2.0 * (np.radians(h) if turns else h))
        spin = change[:, :3, :3] @ poses[:, :3, :3].swapaxes(1, 2)
        np.testing.assert_allclose(jacobian[:, :3, number], change[:, :3, 3], atol=1e-4)
        np.testing.assert_allclose(
            jacobian[:, 3:, number], np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], 1), atol=1e-5
        )


def ucx(tmp_path: Path) -> Machine:
    """A drill on U, on a rotary table's slide: U turns with C, X does not."""
    chain = link(axis="X", joint="X") + link(axis="C", joint="ZA") + link(axis="U", joint="X", offset=[5.0, 0.0, 0.0])
    return machine(tmp_path, "UCX", chain)


def test_a_chain_without_closed_form_is_solved_numerically(tmp_path: Path) -> None:
    """X + (5 + U) cos C, (5 + U) sin C: by hand. U-C-X is redundant in nothing, though U is parallel to X at C = 0."""
    kinematics = ucx(tmp_path).kinematics
    assert kinematics.structure.form == ""
    assert kinematics.forward({"X": 3.0, "C": 30.0, "U": 15.0})[:2, 3] == pytest.approx(
        [3 + 20 * np.cos(np.pi / 6), 10]
    )
    q = kinematics.random(10, seed=6)
    poses = kinematics.forward(q)
    np.testing.assert_allclose(kinematics.inverse(poses, near=q), q, atol=1e-9)
    np.testing.assert_allclose(kinematics.forward(kinematics.inverse(poses))[:, :3, 3], poses[:, :3, 3], atol=1e-5)


def test_an_arm_of_five_turning_joints_finds_the_way_to_where_it_was(tmp_path: Path) -> None:
    """Far from where the search begins, and beside limits of the joints."""
    links = (
        link(name="swivel", axis="A1", joint="ZA", offset=[0.0, 0.0, 300.0], limits=[-170.0, 170.0])
        + link(name="lower", axis="A2", joint="YA", offset=[75.0, 0.0, 0.0], limits=[-60.0, 140.0])
        + link(name="upper", axis="A3", joint="YA", offset=[0.0, 0.0, 300.0], limits=[-140.0, 180.0])
        + link(name="wrist", axis="A4", joint="YA", offset=[320.0, 0.0, 75.0], limits=[-120.0, 120.0])
        + link(name="hand", axis="A5", joint="ZA", offset=[80.0, 0.0, 0.0])
        + '[tool]\nlink = "hand"\noffset = [0.0, 0.0, 30.0]\nangles = [0.0, 90.0, 0.0]\n'
    )
    kinematics = machine(tmp_path, ["A1", "A2", "A3", "A4", "A5"], links).kinematics
    poses = kinematics.forward(kinematics.random(30, seed=8)[[0, 29]])
    for wanted in poses:
        found = kinematics.forward(kinematics.inverse(wanted))
        np.testing.assert_allclose(found[:3, 2:], wanted[:3, 2:], atol=1e-5)


def test_what_cannot_be_reached_is_nan() -> None:
    mill = MACHINES["mrm-mill"].kinematics
    assert np.isnan(mill.inverse(pose([[0.0, 0.0, 0.0]], (0.0, 0.1, 1.0)))).all()  # it cannot tilt
    assert np.isnan(mill.inverse(pose([[0.0, 0.0, 101.0]]))).all()  # beyond the travel
    five = MACHINES["xyzac"].kinematics
    assert np.isnan(five.inverse(pose([[0.0, 0.0, 0.0]], (0.0, 0.0, -1.0)))).all()  # A is limited to ±110 degrees


def test_a_singular_pose_keeps_the_joint_that_may_stand_anywhere() -> None:
    """With the tool along C the angle of C is the one it has, and with the tip on the table's axis that of A."""
    five = MACHINES["xyzac"].kinematics
    q = np.array([10.0, 20.0, 30.0, 0.0, 123.0])
    np.testing.assert_allclose(five.inverse(five.forward(q), near=q), q, atol=1e-9)
    drill = MACHINES["mrmt-oacs"].kinematics
    q = np.array([-83.5, 10.0, 77.0])
    np.testing.assert_allclose(drill.inverse(drill.forward(q), near=q), q, atol=1e-9)


def test_a_free_joint_turns_where_a_slide_would_pass_its_end(tmp_path: Path) -> None:
    """X 140 and Y 140 with the table at 45° is Y 198 with the table at 0°, and Y ends at 150."""
    kinematics = MACHINES["xyzac"].kinematics
    wanted = kinematics.forward({"X": 140.0, "Y": 140.0, "C": 45.0})
    found = kinematics.inverse(wanted)
    assert (np.abs(found[:2]) <= 150.0).all()
    np.testing.assert_allclose(kinematics.forward(found)[:3, 2:], wanted[:3, 2:], atol=1e-6)
    too_far = kinematics.forward({"Y": 215.0})  # beyond the corner, 150 √2
    assert np.isnan(kinematics.inverse(too_far)).all()

    links = link(name="X", axis="X", joint="X") + link(name="Y", axis="Y", joint="Y")
    links += link(name="Z", axis="Z", joint="Z") + link(name="table", parent="bed", axis="C", joint="ZA")
    mill = machine(tmp_path, "XYZC", links + '[tool]\nlink = "Z"\n[work]\nlink = "table"\n')
    assert verdict(mill).ok, verdict(mill)


def test_free_joints_of_many_poses_are_turned_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """All that its joints take; and none by descents, which would take 50 ms for each pose that is out of reach."""
    monkeypatch.delattr("rds.machines.kinematics.inverse._one")
    five = MACHINES["xyzac"].kinematics
    low, high = five.limits.T
    q = np.random.default_rng(3).uniform(low, high, (500, 5))
    q[:, five.joints.index("A")] = 0.0
    wanted = five.forward(q)
    found = five.inverse(wanted)
    np.testing.assert_allclose(five.forward(found)[:, :3, 2:], wanted[:, :3, 2:], atol=1e-9)
    assert ((found >= low - 1e-9) & (found <= high + 1e-9)).all()
    wanted[:, 0, 3] += 1000.0
    assert np.isnan(five.inverse(wanted)).all()


def test_whole_turns_are_added_so_that_the_joint_stays_near() -> None:
    five = MACHINES["xyzac"].kinematics
    q = np.array([10.0, 20.0, 30.0, 40.0, 350.0])
    np.testing.assert_allclose(five.inverse(five.forward(q), near=q), q, atol=1e-9)
    assert five.inverse(five.forward(q))[4] == pytest.approx(-10.0)


def test_frames_and_axes_of_the_links(tmp_path: Path) -> None:
    kinematics = ucx(tmp_path).kinematics
    frames = kinematics.frames(np.array([[15.0, 30.0, 3.0]]))
    assert list(frames) == ["X", "C", "U", "tool tip", "work zero"]
    np.testing.assert_allclose(frames["C"][0, :3, 3], [3.0, 0.0, 0.0])
    directions, points = kinematics.axes(np.array([[15.0, 30.0, 3.0]]))
    np.testing.assert_allclose(directions[0], [[np.cos(np.pi / 6), 0.5, 0], [0, 0, 1], [1, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(points[0, 1], [3.0, 0.0, 0.0])
    tool = kinematics.frames(np.array([[15.0, 30.0, 3.0]]), relative_to="tool tip")["bed"]
    np.testing.assert_allclose(tool[0] @ frames["tool tip"][0], np.eye(4), atol=1e-12)


def test_the_identity_is_always_there() -> None:
    """Each machine's axes can be moved by their letters, whatever its links are."""
    for each in MACHINES.values():
        kinematics = identity_of(each)
        q = kinematics.random(3)
        linear = [kinematics.joints.index(name) for name in "XYZ" if name in kinematics.joints]
        rows = ["XYZ".index(kinematics.joints[number]) for number in linear]
        np.testing.assert_allclose(kinematics.forward(q)[:, rows, 3], q[:, linear], atol=1e-12)


def test_what_is_no_joint_or_pose_is_said() -> None:
    mill = MACHINES["mrm-mill"].kinematics
    with pytest.raises(InputError, match="has no joint 'A'; it has X, Y, Z"):
        mill.forward({"A": 1.0})
    with pytest.raises(InputError, match=r"must be \(n, 3\): X, Y, Z"):
        mill.forward(np.zeros((2, 4)))
    with pytest.raises(InputError, match=r"must be \(n, 4, 4\)"):
        mill.inverse(np.zeros((2, 3)))
    with pytest.raises(InputError, match="there is no frame 'sledge'"):
        mill.frames(np.zeros((1, 3)), relative_to="sledge")
