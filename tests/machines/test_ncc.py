"""The configuration script: the paper's example beside equations (2) and (3), and what is refused, with its line."""

from __future__ import annotations

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.machines import load_machine, machine_names
from rds.machines.configuration import verdict
from rds.machines.ncc import machine_of_script, machine_text_of_script, read_script, script_of, script_of_machine

PAPER = """\
N001 RF01 LN1 XA0 YA90 ZA0 X-80 Y0 Z75
N002 RF01 LN2 XA0 YA0 ZA0 X0 Y0 Z-370
N003 RF01 LN3 XA0 YA0 ZA# X0 Y0 Z-140
N004 RF02 LN3 UP180 LW-180
N005 BUILD
"""
ERRORS = """\
N006 RF03 LN1 XA0 YA0 ZA0 X0 Y0 Z-5
N007 RF03 LN3 XA0 YA0 ZA10 X0 Y0 Z0
N008 BUILD
"""


def equation_2(alpha: float, more: float = 0.0, z: float = 75.0) -> np.ndarray:
    """The product that the paper prints, with LN1 as printed: turned by -90 degrees about y."""
    c, s = np.cos(np.radians(alpha + more)), np.sin(np.radians(alpha + more))
    m3 = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, -140], [0, 0, 0, 1]])
    m2 = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -370], [0, 0, 0, 1]])
    m1 = np.array([[0, 0, -1, -80], [0, 1, 0, 0], [1, 0, 0, z], [0, 0, 0, 1]])
    return np.asarray(m3 @ m2 @ m1)


def reversed_ln1(script: str) -> str:
    return script.replace("YA90", "YA-90")


@pytest.mark.parametrize("alpha", [0.0, 35.0, -120.0])
def test_equations_2_and_3_are_met_with_ln1_reversed(alpha: float) -> None:
    two = machine_of_script(read_script(reversed_ln1(PAPER))).kinematics
    np.testing.assert_allclose(two.forward({"C": alpha}), equation_2(alpha), atol=1e-12)
    three = machine_of_script(read_script(reversed_ln1(PAPER + ERRORS))).kinematics
    np.testing.assert_allclose(three.forward({"C": alpha}), equation_2(alpha, 10.0, 70.0), atol=1e-12)


def test_as_printed_the_script_turns_ln1_the_other_way() -> None:
    """Equation (1) with 90 degrees about y, which equation (2) contradicts; places are the same."""
    kinematics = machine_of_script(read_script(PAPER)).kinematics
    pose = kinematics.forward({"C": 0.0})
    np.testing.assert_allclose(pose[:3, :3], [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=1e-15)
    np.testing.assert_allclose(pose[:3, 3], equation_2(0.0)[:3, 3])
    np.testing.assert_array_equal(kinematics.limits, [[-180.0, 180.0]])


def test_limits_change_without_build_and_blanks_and_comments_do_not_matter() -> None:
    script = read_script(PAPER.lower() + "; a comment\n\n(another) RF02 LN3UP90LW-90\n")
    assert script.links[2].limits == (-90.0, 90.0)


LINK = "RF01 LN1 XA0 YA0 ZA# X0 Y0 Z0\n"


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        ("RF01 LN2 XA0 YA0 ZA0 X0 Y0 Z0\n", 1, "LN2 out of order: LN1 is missing"),
        (PAPER.replace("LN2", "LN4"), 2, "LN4 out of order: LN2 is missing"),
        (LINK + LINK, 2, "LN1 is there already, from line 1"),
        ("RF01 LN1 XA0 YA# ZA# X0 Y0 Z0\n", 1, "YA and ZA are both variable (#)"),
        (PAPER.replace("RF02 LN3", "RF02 LN2"), 4, "LN2 is fixed (line 2 has no #)"),
        (PAPER.replace("RF02 LN3", "RF02 LN7"), 4, "there is no link LN7 (LN1 to LN3)"),
        (PAPER.replace("UP180 LW-180", "UP-180 LW180"), 4, "UP-180 must be more than LW180"),
        (PAPER.replace("UP180", "UP#"), 4, "UP# must be a number here"),
        (PAPER.replace(" Z75", ""), 1, "RF01 needs LN XA YA ZA X Y Z; Z is missing"),
        (PAPER.replace("Z75", "Z75 UP3"), 1, "RF01 has no word UP"),
        (PAPER.replace("Z75", "Z75 Z76"), 1, "Z stands twice"),
        (PAPER.replace("Z75", "Q75"), 1, "Q75 cannot be read"),
        (PAPER.replace("RF01", "RF04"), 1, "RF04 is no word of the script"),
        (PAPER.replace("LN1", "LN0"), 1, "LN0 must be a whole number from 1 on"),
        (PAPER.replace("N005 BUILD\n", ""), 4, "the end of the script before BUILD"),
        (PAPER + ERRORS.replace("N008 BUILD\n", ""), 7, "the end of the script before BUILD"),
        (PAPER.replace("N005 BUILD", "N005 G0 X1"), 5, "N005 G0 X1 before BUILD"),
        (PAPER + "G1 X5\n", 6, "and name a part program that begins with a script .ngc"),
        ("hello world\n" + PAPER, 1, "hello world is no line of a configuration script; write RF01"),
        (PAPER.replace("BUILD", "BUILD X1"), 5, "BUILD stands alone"),
        ("RF02 LN3 UP1 LW1\n", 1, "UP1 must be more than LW1"),
        ("RF02 LN3 UP1 LW-1\n" + PAPER, 2, "RF01 behind RF02 of line 1; write all links before limits"),
        ("RF02 LN3 UP1 LW-1\n" + ERRORS.replace("N008 BUILD\n", ""), 3, "the end of the script before BUILD"),
        ("BUILD\n", 1, "BUILD without links"),
        ("", 0, "there is no link"),
    ],
)
def test_what_is_wrong_in_a_script(text: str, line: int, says: str) -> None:
    with pytest.raises(InputError) as refusal:
        read_script(text, "own.ncc")
    assert says in str(refusal.value)
    assert f"own.ncc, line {line}" in str(refusal.value)


def test_a_machine_needs_limits_and_a_joint() -> None:
    with pytest.raises(InputError, match="LN1 moves and has no limits; write RF02 LN1"):
        machine_of_script(read_script(LINK + "BUILD"))
    with pytest.raises(InputError, match="nothing would move"):
        machine_of_script(read_script(LINK.replace("#", "0") + "BUILD"))


def test_axes_get_the_letters_of_their_joints() -> None:
    lines = [f"RF01 LN{n} XA0 YA0 ZA0 X{x} Y0 Z0\nRF02 LN{n} UP1 LW-1\n" for n, x in enumerate("###", 1)]
    assert list(machine_of_script(read_script("".join(lines) + "BUILD")).axes) == ["X", "U", "X2"]


@pytest.mark.parametrize("name", machine_names())
def test_a_script_is_written_of_any_machine(name: str) -> None:
    """Read again it gives the same poses, and the same verdict on its chain."""
    own = load_machine(name).kinematics
    again = machine_of_script(read_script(script_of(own)))
    assert script_of_machine(load_machine(name)) == script_of(own)
    order = [own.joints[joint.number] for joint in reversed(own.chain.joints)]
    q = own.random(20)
    names = [name for link in reversed(again.links) if (name := link.axis)]
    values = np.stack([q[:, own.joints.index(order[names.index(name)])] for name in again.kinematics.joints], 1)
    np.testing.assert_allclose(again.kinematics.forward(values), own.forward(q), atol=1e-9)
    assert verdict(again).ok


def test_its_machine_file_says_what_the_script_said(tmp_path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(machine_text_of_script(read_script(reversed_ln1(PAPER + ERRORS), "own.ncc"), "own"))
    machine = load_machine(str(path))
    assert [link.name for link in machine.links] == ["LN3", "LN2", "LN1"]
    np.testing.assert_allclose(machine.kinematics.forward({"C": 5.0}), equation_2(5.0, 10.0, 70.0), atol=1e-12)


def made(tmp_path, name: str, script: str, before=None):
    path = tmp_path / f"{name}.toml"
    path.write_text(machine_text_of_script(read_script(script, f"{name}.ncc"), name, before))
    return load_machine(str(path))


def test_limits_and_errors_alone_change_a_machine_that_is_there(tmp_path) -> None:
    """mrm-control, sections 5 and 6: RF02 and RF03 reconfigure without the chain constructed anew."""
    own = made(tmp_path, "own", reversed_ln1(PAPER))
    changed = made(tmp_path, "changed", "N001 RF02 LN3 UP90 LW-45\n" + ERRORS, own)
    np.testing.assert_allclose(changed.kinematics.forward({"C": 5.0}), equation_2(5.0, 10.0, 70.0), atol=1e-12)
    np.testing.assert_array_equal(changed.kinematics.limits, [[-45.0, 90.0]])
    np.testing.assert_array_equal(changed.kinematics.travel, [[-180.0, 180.0]])
    limited = made(tmp_path, "limited", "RF02 LN3 UP20 LW-20", changed)  # in force without BUILD; the errors stay
    np.testing.assert_allclose(limited.kinematics.forward({"C": 5.0}), equation_2(5.0, 10.0, 70.0), atol=1e-12)
    assert limited.kinematics.limits.tolist() == [[-20.0, 20.0]]


def test_axes_keep_their_names_where_a_machine_is_changed(tmp_path) -> None:
    """The joints of mrmt-oacs are called A, X and Z, and a script of its chain alone would call A C."""
    before = load_machine("mrmt-oacs")
    lines = script_of_machine(before).splitlines()
    (limits,) = (line for line in lines if line.startswith("RF02") and "UP180 LW-180" in line)
    changed = made(tmp_path, "narrow", limits.replace("UP180", "UP90"), before)
    assert set(changed.kinematics.joints) == set(before.kinematics.joints)
    assert changed.kinematics.limits[changed.kinematics.joints.index("A"), 1] == 90.0
    q = before.kinematics.random(10)
    order = [before.kinematics.joints.index(name) for name in changed.kinematics.joints]
    np.testing.assert_allclose(changed.kinematics.forward(q[:, order]), before.kinematics.forward(q), atol=1e-9)
    assert changed.axis("A").model == before.axis("A").model


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("RF02 LN9 UP1 LW-1", r"own.ncc, line 1: there is no link LN9 \(LN1 to LN7\); `rds machine script mrm-mill`"),
        ("\nRF02 LN1 UP1 LW-1", "own.ncc, line 2: LN1 is fixed .in mrm-mill.: limits belong to a joint"),
        ("RF02 LN6 UP900 LW800", "the limits of LN6 are outside the travel of X, -100 to 100; mend RF02"),
    ],
)
def test_what_does_not_fit_the_machine_that_is_changed(text: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        machine_text_of_script(read_script(text, "own.ncc"), "own", load_machine("mrm-mill"))


def test_changes_need_a_machine() -> None:
    with pytest.raises(InputError, match="RF02 and RF03 alone change a machine that is there: name it"):
        machine_of_script(read_script("RF02 LN3 UP90 LW-90"))


def test_a_machine_of_a_script_gives_that_script_back(tmp_path) -> None:
    own = made(tmp_path, "own", PAPER + ERRORS)
    again = read_script(script_of_machine(own))
    first = read_script(PAPER + ERRORS)
    told = [(link.numbers, link.variable, link.limits, link.errors) for link in again.links]
    assert told == [(link.numbers, link.variable, link.limits, link.errors) for link in first.links]
