"""URDF, checked by a library that reads it: the same frames there as here, and back."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.machines import load_machine, machine_names
from rds.machines.configuration import verdict
from rds.machines.urdf import TIP, ZERO, machine_text_of_urdf, urdf_text

WITH_LINKS = [name for name in machine_names() if load_machine(name).links]


@pytest.mark.parametrize("name", WITH_LINKS)
def test_yourdfpy_sees_the_same_poses(name: str) -> None:
    yourdfpy = pytest.importorskip("yourdfpy")
    kinematics = load_machine(name).kinematics
    robot = yourdfpy.URDF.load(
        io.BytesIO(urdf_text(load_machine(name)).encode()), build_scene_graph=True, load_meshes=False
    )
    assert set(robot.actuated_joint_names) == set(kinematics.joints)
    for q in kinematics.random(10):
        scale = {n: np.pi / 180 if t else 1e-3 for n, t in zip(kinematics.joints, kinematics.turns, strict=True)}
        robot.update_cfg({n: value * scale[n] for n, value in zip(kinematics.joints, q, strict=True)})
        theirs = np.array(robot.get_transform(TIP, ZERO))
        theirs[:3, 3] *= 1000.0
        np.testing.assert_allclose(theirs, kinematics.forward(q), atol=1e-9)


@pytest.mark.parametrize("name", WITH_LINKS)
def test_a_machine_is_read_back(name: str, tmp_path: Path) -> None:
    own = load_machine(name).kinematics
    path = tmp_path / "again.toml"
    path.write_text(machine_text_of_urdf(urdf_text(load_machine(name)), "again"), encoding="utf-8")
    again = load_machine(str(path)).kinematics
    q = own.random(20)
    order = [own.joints.index(joint) for joint in again.joints]
    np.testing.assert_allclose(again.forward(q[:, order]), own.forward(q), atol=1e-9)
    np.testing.assert_allclose(again.limits, own.limits[order], atol=1e-9)
    twice = machine_text_of_urdf(urdf_text(load_machine(str(path))), "again")  # whose links are called as the ends are
    path.write_text(twice, encoding="utf-8")
    np.testing.assert_allclose(load_machine(str(path)).kinematics.forward(q[:, order]), own.forward(q), atol=1e-9)


ASKEW = """<robot name="r"><link name="base"/><link name="a"/>
<joint name="q" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 1 1"/></joint></robot>"""


LIMIT = '<limit lower="%s" upper="0"/><axis'
SECOND = """<link name="b"/>
<joint name="q2" type="fixed"><parent link="a"/><child link="b"/></joint></robot>"""


def test_an_axis_that_is_askew(tmp_path: Path) -> None:
    """By Rodrigues' formula: half a turn about (0, 1, 1) exchanges y and z, and turns x round."""
    path = tmp_path / "own.toml"
    path.write_text(machine_text_of_urdf(ASKEW, "own"), encoding="utf-8")
    turned = load_machine(str(path)).kinematics.forward({"q": 180.0})
    np.testing.assert_allclose(turned[:3, :3], [[-1, 0, 0], [0, 0, 1], [0, 1, 0]], atol=1e-12)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("<robot", "is no XML"),
        ("<!DOCTYPE a><robot/>", "no DOCTYPE"),
        ("<robot/>", "no URDF with joints"),
        (ASKEW.replace("continuous", "planar"), "joint 'q' is 'planar'"),
        (ASKEW.replace("continuous", "prismatic"), "has no <limit"),
        (ASKEW.replace("continuous", "fixed"), "no joint moves"),
        (ASKEW.replace("0 1 1", "0 1"), "must be three numbers"),
        (ASKEW.replace('<child link="a"/>', ""), "has no <child link=>"),
        (
            ASKEW.replace("continuous", "prismatic").replace("<axis", LIMIT % "-0,1"),
            "'q' has <limit lower='-0,1' upper='0'>",
        ),
        (ASKEW.replace("continuous", "revolute").replace("<axis", LIMIT % "0"), "two numbers, the lower one first"),
        (ASKEW.replace("continuous", "revolute").replace("<axis", LIMIT % "-inf"), "two numbers, the lower one first"),
        (ASKEW.replace("<axis", '<mimic joint="p"/><axis'), "'q' follows another"),
        (ASKEW.replace("0 1 1", "0 0 0"), "'q' has an <axis> without a direction"),
        (ASKEW.replace("</robot>", SECOND.replace("q2", "q")), "two joints are called 'q'"),
        (ASKEW.replace("</robot>", SECOND.replace('child link="b"', 'child link="a"')), "two joints move 'a'"),
        ('<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arm/></robot>', "is a xacro"),
        (ASKEW.replace("</robot>", '<link name="c"/></robot>'), "must hang on one root; roots are base, c"),
    ],
)
def test_what_is_no_chain(text: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        machine_text_of_urdf(text, "own", "own.urdf")


ARM = {  # joint: place in m and axis, as of an arm of six joints with a wrist
    "a1": ("0 0 0.32", "0 0 1", 3.0),
    "a2": ("0.04 0 0", "0 1 0", 1.9),
    "a3": ("0 0 0.31", "0 -1 0", 2.4),
    "a4": ("0 0 0.03", "-1 0 0", 3.3),
    "a5": ("0.32 0 0", "0 -1 0", 2.2),
    "a6": ("0.07 0 0", "-1 0 0", 6.28),
}


def arm() -> str:
    """A URDF as those of robots are: behind the root also the frame `base`, behind the wrist `flange` and `tool0`."""
    text, before = '<robot name="arm"><link name="base_link"/><link name="base"/><link name="flange"/>', "base_link"
    for name, (place, axis, limit) in ARM.items():
        text += f"""<link name="{name}"/><joint name="j{name}" type="revolute"><parent link="{before}"/>
            <child link="{name}"/><origin xyz="{place}"/><axis xyz="{axis}"/>
            <limit lower="{-limit}" upper="{limit}"/></joint>"""
        before = name
    for child, parent, turn in (("base", "base_link", "0"), ("tool0", "a6", "1.57079632679"), ("flange", "a6", "0")):
        text += f"""<joint name="f{child}" type="fixed"><parent link="{parent}"/><child link="{child}"/>
            <origin rpy="0 {turn} 0"/></joint>"""
    return text + '<link name="tool0"/></robot>'


def test_the_frames_of_a_robot_that_carry_nothing_are_no_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Such a frame was a link that leads nowhere, which made nearly all published robots no machine."""
    monkeypatch.setattr("rds.machines.configuration._POSES_NUMERIC", 2)
    path = tmp_path / "arm.toml"
    path.write_text(machine_text_of_urdf(arm(), "arm"), encoding="utf-8")
    machine = load_machine(str(path))
    assert "# Frames of the URDF that carry nothing are left out: base, flange.\n" in path.read_text(encoding="utf-8")
    assert machine.tool is not None and machine.tool.link == "tool0"
    assert verdict(machine).ok


def test_an_arm_of_six_joints_reaches_what_it_reaches(tmp_path: Path) -> None:
    """Most starts of the search end in another valley: poses within reach were called out of it, after a minute."""
    path = tmp_path / "arm.toml"
    path.write_text(machine_text_of_urdf(arm(), "arm"), encoding="utf-8")
    kinematics = load_machine(str(path)).kinematics
    poses = kinematics.forward(kinematics.random(15, seed=22)[:2])
    assert not np.isnan(kinematics.inverse(poses)).any()


def test_a_link_that_is_called_as_another_end_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    text = machine_text_of_urdf(urdf_text(load_machine("xyzac")), "own")
    path.write_text(text.replace('[tool]\nlink = "tool_tip"', '[tool]\nlink = "tool_tip"\noffset = [0.0, 0.0, 5.0]'))
    with pytest.raises(InputError, match="'tool_tip' is the end of the chain"):
        urdf_text(load_machine(str(path)))


def test_a_machine_without_links_has_no_urdf() -> None:
    with pytest.raises(InputError, match="has no links"):
        urdf_text(load_machine("mini-cnc"))
