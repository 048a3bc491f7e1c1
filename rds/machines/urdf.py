"""URDF, the robot description that simulators and ROS read: machines written in it, and read from it.

Lengths are in m and angles in radians there. Its origin `rpy` is equation (1): turned about z, y and x.

Our own, because `yourdfpy` and its like load meshes, too; six numbers of each joint are wanted, which Python's
own XML reader gives.
"""

from __future__ import annotations

from math import degrees, inf, radians
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from rds.core.errors import InputError
from rds.core.toml_text import toml_text
from rds.machines.kinematics.build import resolved, steps_of
from rds.machines.kinematics.chain import Joint
from rds.machines.kinematics.transform import numbers_of, transformation
from rds.machines.link_table import BED, ChainEnd

if TYPE_CHECKING:
    from rds.machines.machine import Machine

TIP, ZERO = "tool_tip", "work_zero"
_FLANGE = "tool0"
_TURN = 360.0  # degrees: limits of a joint of type continuous
_MM = 1000.0
_SAME = 1e-12


def urdf_text(machine: Machine) -> str:
    """The machine's links as URDF; joints have the names of their axes. InputError for a machine without links."""
    if not machine.links:
        raise InputError(f"machine {machine.name!r} has no links; add [[link]] tables, as in docs/machines.md")
    robot = ElementTree.Element("robot", name=machine.name)
    ElementTree.SubElement(robot, "link", name=BED)
    numbers = {name: number for number, name in enumerate(machine.axes)}
    names = list(machine.axes)
    for link in map(resolved, machine.links):
        steps = steps_of(link, numbers)
        if not link.axis:
            _joint(robot, f"{link.name}_fixed", "fixed", link.parent, link.name, _matrix(steps[0]))
            continue
        before, joint, after = steps
        assert isinstance(joint, Joint)
        whole = np.abs(_matrix(after) - np.eye(4)).max() < _SAME
        moved = link.name if whole else f"{link.name}_moved"
        kind = "revolute" if joint.turns else "prismatic"
        made = _joint(robot, names[joint.number], kind, link.parent, moved, _matrix(before))
        along = [joint.sign if k == joint.along else 0 for k in range(3)]
        ElementTree.SubElement(made, "axis", xyz=_shown(along))
        low, high = link.limits or machine.axes[link.axis].travel
        scale = radians(1.0) if joint.turns else 1.0 / _MM
        limits = machine.axes[link.axis].limits
        speed = limits.velocity * scale if limits else 0.0
        ElementTree.SubElement(
            made, "limit", lower=f"{low * scale!r}", upper=f"{high * scale!r}", effort="0", velocity=f"{speed!r}"
        )
        if not whole:
            _joint(robot, f"{link.name}_fixed", "fixed", moved, link.name, _matrix(after))
    for name, end in ((TIP, machine.tool or ChainEnd(machine.links[-1].name)), (ZERO, machine.work or ChainEnd())):
        if any(link.name == name for link in machine.links):
            if end.link != name or any([*end.angles, *end.offset]):
                raise InputError(
                    f"in a URDF {name!r} is the end of the chain; give this link of the machine another name"
                )
            continue
        _joint(robot, f"{name}_fixed", "fixed", end.link, name, transformation([*end.angles, *end.offset]))
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode", xml_declaration=True) + "\n"


def machine_text_of_urdf(text: str, name: str, path: str = "") -> str:
    """The machine's file of a URDF, as TOML. Its links `tool_tip` and `work_zero` are tool and work; without them
    `tool0` (so it is called at robots), else the last link is the tool, and the root the work. InputError for what is
    no such chain."""
    if "<!DOCTYPE" in text.upper():
        raise InputError("a URDF has no DOCTYPE; remove it", path)
    try:
        robot = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise InputError(f"is no XML: {error}", path) from None
    if any("xacro" in str(element.tag) for element in robot.iter()):
        raise InputError("is a xacro, from which a URDF is made: `xacro FILE.xacro > FILE.urdf`; name that", path)
    joints = robot.findall("joint")
    if robot.tag != "robot" or not joints:
        raise InputError("is no URDF with joints: <robot> with <link> and <joint> is needed", path)
    children = [_named(joint, "child", path) for joint in joints]
    for what, names in (("joints are called", [joint.get("name", "") for joint in joints]), ("joints move", children)):
        for each in names:
            if names.count(each) > 1:
                raise InputError(f"two {what} {each!r}; give each its own", path)
    roots = [link.get("name", "") for link in robot.findall("link") if link.get("name") not in children]
    if len(roots) != 1:
        raise InputError(f"its links must hang on one root; roots are {', '.join(roots) or 'none'}", path)
    axes: dict[str, Any] = {}
    links: list[dict[str, Any]] = []
    frames = {roots[0]: BED}
    left = list(joints)
    while left:
        ready = [joint for joint in left if _named(joint, "parent", path) in frames]
        if not ready:
            raise InputError(f"joint {left[0].get('name')!r} hangs on no link that leads to {roots[0]}", path)
        for joint in ready:
            _read_joint(joint, frames, links, axes, path)
            left.remove(joint)
    if not axes:
        raise InputError("no joint moves: types prismatic, revolute and continuous do", path)
    table = {"name": name, "title": f"From the URDF of {robot.get('name', name)}", "sample_period": 0.001, "axis": axes}
    tool = next((frames[end] for end in (TIP, _FLANGE) if end in frames), links[-1]["name"])
    ends = {"tool": tool, "work": frames.get(ZERO, BED)}
    about = "Nodes, encoders and sample period are chosen; yours to add: axis.NAME.model and axis.NAME.limits."
    links, frames_only = _without_frames(links, set(ends.values()))
    if frames_only:
        about += f"\nFrames of the URDF that carry nothing are left out: {', '.join(frames_only)}."
    return toml_text(table | {key: {"link": link} for key, link in ends.items()} | {"link": links}, about)


def _without_frames(links: list[dict[str, Any]], ends: set[str]) -> tuple[list[dict[str, Any]], list[str]]:
    """The links without fixed ones that carry nothing, as the frame `base` of most robots; and the names of these."""
    left_out: list[str] = []
    while True:
        carrying = {link["parent"] for link in links} | ends
        idle = [link["name"] for link in links if "axis" not in link and link["name"] not in carrying]
        if not idle:
            return links, left_out
        left_out += idle
        links = [link for link in links if link["name"] not in idle]


def _read_joint(
    joint: ElementTree.Element, frames: dict[str, str], links: list[dict[str, Any]], axes: dict[str, Any], path: str
) -> None:
    """A joint as one, two or three links: its origin, what it moves, and the way back from an axis that is askew."""
    name, kind, child = joint.get("name", ""), joint.get("type", ""), _named(joint, "child", path)
    origin = joint.find("origin")
    shift, turn = (_three(origin, key, path) for key in ("xyz", "rpy"))
    place = transformation([*map(degrees, turn), *(value * _MM for value in shift)])
    parent = frames[_named(joint, "parent", path)]
    frames[child] = child if child != BED else f"{child}_link"
    if kind == "fixed":
        links.append(_link(frames[child], parent, place))
        return
    if kind not in ("prismatic", "revolute", "continuous"):
        raise InputError(f"joint {name!r} is {kind!r}; joints are fixed, prismatic, revolute or continuous", path)
    if joint.find("mimic") is not None:  # taken for an axis of its own, it would stand still where it should follow
        raise InputError(f"joint {name!r} follows another (<mimic>), which no axis here does; make it fixed", path)
    turns = kind != "prismatic"
    low, high = (-_TURN, _TURN) if kind == "continuous" else _travel(joint, turns, path)
    along = _three(joint.find("axis"), "xyz", path) if joint.find("axis") is not None else [1.0, 0.0, 0.0]
    if not any(along):
        raise InputError(f"joint {name!r} has an <axis> without a direction; give it xyz", path)
    askew = np.eye(4)
    number, sign = int(np.argmax(np.abs(along))), 1 if max(along, key=abs) > 0 else -1
    if sum(abs(value) > _SAME for value in along) != 1:
        from rds.machines.kinematics.kinematics import pose

        askew, number, sign = pose(np.zeros(3), tuple(along))[0], 2, 1
    before = place @ askew
    if np.abs(before - np.eye(4)).max() > _SAME:
        links.append(_link(f"{name}_origin", parent, before))
        parent = f"{name}_origin"
    straight = np.abs(askew - np.eye(4)).max() < _SAME
    moved: dict[str, Any] = {"name": frames[child] if straight else f"{name}_moved", "parent": parent, "axis": name}
    moved |= {"joint": ("XA", "YA", "ZA")[number] if turns else "XYZ"[number]} | ({"sign": -1} if sign < 0 else {})
    links.append(moved)
    axes[name] = {"node": len(axes) + 2, "unit": "deg" if turns else "mm", "travel": [low, high], "resolution": 0.001}
    if not straight:
        links.append(_link(frames[child], f"{name}_moved", np.linalg.inv(askew)))


def _travel(joint: ElementTree.Element, turns: bool, path: str) -> list[float]:
    """The lowest and the highest value of a joint, in mm or degrees."""
    name, limit = joint.get("name", ""), joint.find("limit")
    given = [None if limit is None else limit.get(key) for key in ("lower", "upper")]
    if None in given:
        raise InputError(f"joint {name!r} has no <limit lower= upper=>; add its travel", path)
    try:
        low, high = (float(value or 0) for value in given)
    except ValueError:
        low = high = 0.0
    if not -inf < low < high < inf:
        said = f"lower={given[0]!r} upper={given[1]!r}"
        raise InputError(
            f"joint {name!r} has <limit {said}>: its travel must be two numbers, the lower one first", path
        )
    return [degrees(value) if turns else value * _MM for value in (low, high)]


def _link(name: str, parent: str, matrix: np.ndarray) -> dict[str, Any]:
    numbers = numbers_of(matrix)
    return {"name": name, "parent": parent, "angles": numbers[:3], "offset": numbers[3:]}


def _joint(
    robot: ElementTree.Element, name: str, kind: str, parent: str, child: str, matrix: np.ndarray
) -> ElementTree.Element:
    ElementTree.SubElement(robot, "link", name=child)
    joint = ElementTree.SubElement(robot, "joint", name=name, type=kind)
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    numbers = numbers_of(matrix)
    angles, shift = [radians(value) for value in numbers[:3]], [value / _MM for value in numbers[3:]]
    ElementTree.SubElement(joint, "origin", xyz=_shown(shift), rpy=_shown(angles))
    return joint


def _matrix(step: Any) -> np.ndarray:
    assert isinstance(step, np.ndarray)
    return step


def _shown(values: Any) -> str:
    return " ".join(f"{float(value) + 0.0!r}" for value in values)


def _named(joint: ElementTree.Element, tag: str, path: str) -> str:
    found = joint.find(tag)
    if found is None or not found.get("link"):
        raise InputError(f"joint {joint.get('name')!r} has no <{tag} link=>", path)
    return str(found.get("link"))


def _three(element: ElementTree.Element | None, key: str, path: str) -> list[float]:
    text = "0 0 0" if element is None else element.get(key, "0 0 0")
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != 3 or not np.isfinite(values).all():
        raise InputError(f"{key} = {text!r} must be three numbers", path)
    return values
