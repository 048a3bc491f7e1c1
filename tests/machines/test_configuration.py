"""The verdict on configurations: the papers' machines pass; each fault is found, with the module and the reason."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
from machines.machine_text import link, machine

import rds
from rds.core.toml_text import toml_text
from rds.machines import load_machine, machine_names
from rds.machines.configuration import Verdict, verdict
from rds.machines.kinematics.workspace import regularity, singularities, workspace


@pytest.mark.parametrize("name", machine_names())
def test_the_machines_that_are_shipped_are_machines(name: str) -> None:
    found = verdict(load_machine(name))
    assert found.ok, str(found)


def judge(tmp_path: Path, axes: str, links: str) -> Verdict:
    return verdict(machine(tmp_path, axes, links))


def test_u_c_x_is_a_machine(tmp_path: Path) -> None:
    """U is parallel to X where C is 0, and nowhere else."""
    head = link(module="milling-head")
    chain = link(axis="X", module="slide-x") + link(axis="C", module="rotary-c") + link(axis="U", module="slide-u")
    found = judge(tmp_path, "UCX", chain + head)
    assert found.ok, str(found)
    assert "numerically" in str(found)


def test_the_range_arm_is_where_it_may_be(tmp_path: Path) -> None:
    own = load_machine("mrmt-oacs")
    assert [link.module for link in own.links] == ["oacs-a", "oacs-x", "oacs-z", "oacs-range-arm", "oacs-drill"]
    tables = tomllib.loads(Path(own.path).read_text(encoding="utf-8"))["link"]
    bare = [each for each in tables if each.get("module") != "oacs-range-arm"]
    bare[-1]["parent"] = "Z"
    found = judge(tmp_path, "XZA", toml_text({"link": bare}))
    assert found.ok, str(found)


SLIDE_SQUARE = link(axis="X", module="slide-x") + link(module="drilling-head")
HEAD, ARM = link(module="milling-head"), link(module="extension-arm")
MILL = "".join(link(axis=name, module=f"slide-{name.lower()}") for name in "XYZ")


@pytest.mark.parametrize(
    ("axes", "links", "at", "says"),
    [
        ("X", SLIDE_SQUARE, "drilling-head", "works along its axis, and no slide moves it so: X shift it square to"),
        (
            "XZA",
            link(axis="X", module="oacs-x") + link(axis="A", module="oacs-a"),
            "A",
            "'A' (oacs-a: male work table 200 mm (table)) does not fit on 'X' (male column foot 250 mm (base))",
        ),
        ("Z", link(axis="Z", module="oacs-z") + link(module="oacs-x"), "oacs-x", "does not fit on 'Z'"),
        ("XYZ", MILL, "Z", "the tool is on 'Z', a module of kind linear (slide-z); mount a cutting head on it"),
        (
            "XYZ",
            MILL + link(module="milling-head") + link(module="vice"),
            "milling-head",
            "is a cutting head (milling-head) in the middle of the chain",
        ),
        (
            "XU",
            link(axis="X", module="slide-x") + link(axis="U", module="slide-u") + link(module="milling-head"),
            "X",
            "X shifts the tool in a direction in which the modules nearer to the tool do already",
        ),
        (
            "XYZ",
            link(module="bed") + link(module="extension-arm") + link(module="milling-head"),
            "extension-arm",
            "may be mounted on a linear or rotary module, not on a frame (bed)",
        ),
        (
            "XYZ",
            MILL + link(module="riser") + link(module="milling-head"),
            "milling-head",
            "'riser' (riser) may carry a table or a rotary, not a head",
        ),
        ("XYZ", MILL + ARM, "extension-arm", "the tool is on 'extension-arm', a module of kind accessory"),
        ("XYZ", MILL + HEAD + link(module="vice", parent="bed"), "milling-head", "in the middle"),
        (
            "XYZ",
            MILL + link(module="milling-head") + '[tool]\nlink = "Y"\n',
            "Z",
            "link 'Z' leads neither to the tool nor to the work",
        ),
        ("X", link(name="a", offset=[0.0, 0.0, 1.0]), "", "there must be one axis at least"),
        ("X", link(axis="X", joint="X") + '[work]\nlink = "X"\n', "X", "tool and work are both on X"),
        (
            "XY",
            link(module="bed") + "".join(link(axis=n, module=f"slide-{n.lower()}", parent="bed") for n in "XY"),
            "Y",
            "'Y' and 'X' are both on interface table of 'base'",
        ),
        (
            "X",
            link(axis="X", module="slide-x", interface="top"),
            "X",
            "'X' (slide-x) has no interface 'top'; it has base, end",
        ),
    ],
)  # fmt: skip
def test_what_is_no_machine(tmp_path: Path, axes: str, links: str, at: str, says: str) -> None:
    links = links.replace('[[link]]\nmodule = "bed"', '[[link]]\nname = "base"\nmodule = "bed"')
    if "both on interface" in says:
        links = links.replace('parent = "bed"', 'parent = "base"')
    found = judge(tmp_path, axes, links)
    assert not found.ok
    assert (at, True) in [(fault.link, says in fault.text) for fault in found.faults], str(found)
    assert found.checks[-1].name == "identity" and found.checks[-1].passed  # always


def test_a_machine_without_links_is_not_judged() -> None:
    found = verdict(load_machine("mini-cnc"))
    assert [(check.name, check.passed) for check in found.checks] == [("chain", None), ("identity", True)]
    assert found.to_json()["ok"] is True


def test_a_limit_of_velocity_that_the_model_does_not_reach_is_noted(tmp_path: Path) -> None:
    """X of the mini CNC does 1.764 (mm/s)/V at 10 V."""
    text = Path(load_machine("mini-cnc").path).read_text()
    (tmp_path / "fast.toml").write_text(text.replace("velocity = 13.0", "velocity = 17.65", 1))
    (tmp_path / "part.ngc").write_text("G21 G90 F60\nG1 X1\nM2\n")
    found = load_machine(tmp_path / "fast.toml")
    (note,) = found.too_fast(found.axes)
    assert "of axis X, 17.65 mm/s, is more than its model reaches at 10 V, 17.64 mm/s" in note
    result = rds.PartProgram(tmp_path / "part.ngc", machine=str(tmp_path / "fast.toml")).run()
    assert result.meta["notes"].count(note) == 1
    for name in machine_names():
        known = load_machine(name)
        assert known.too_fast(known.axes) == known.unlinked() == []


def test_an_axis_that_moves_no_link_is_noted() -> None:
    mill = load_machine("mrm-mill")
    bare = replace(mill, links=tuple(replace(link, axis="" if link.axis == "Y" else link.axis) for link in mill.links))
    (note,) = bare.unlinked()
    assert note.startswith("axis Y moves no link")


def test_workspaces() -> None:
    """The mill's is its travel; the thesis's is a ring of 233.5 mm about the table's axis, 600 mm high."""
    mill = workspace(load_machine("mrm-mill").kinematics)
    assert (mill.high - mill.low).tolist() == pytest.approx([200.0] * 3)
    thesis = workspace(load_machine("mrmt-oacs").kinematics, n=50_000)
    assert abs(thesis.points[:, :2]).max() == pytest.approx(83.5 + 150.0, rel=1e-2)
    assert thesis.high[2] - thesis.low[2] == pytest.approx(600.0)
    assert workspace(load_machine("xyzac").kinematics).tilt == pytest.approx(110.0)  # as A is limited


def test_virtual_limits_make_the_operational_workspace_smaller(tmp_path: Path) -> None:
    kinematics = machine(tmp_path, "X", link(axis="X", joint="X", limits=[-5.0, 10.0])).kinematics
    reachable, operational = workspace(kinematics, "travel"), workspace(kinematics)
    assert (reachable.low[0], reachable.high[0]) == (-100.0, 100.0)
    assert (operational.low[0], operational.high[0]) == (-5.0, 10.0)


def test_singular_poses_are_found() -> None:
    """By hand: the tool along C where A is 0; the tip on the table's axis where X is -83.5 (583 - 54.5 - 370 - 75)."""
    assert singularities(load_machine("xyzac").kinematics) == [{"A": 0.0}]
    assert singularities(load_machine("mrmt-oacs").kinematics) == [{"X": -83.5}]
    assert singularities(load_machine("mrm-mill").kinematics) == []
    five = load_machine("xyzac").kinematics
    at = five.values({"A": 0.0}), five.values({"A": 30.0})
    assert [round(float(regularity(five, each)[0]), 6) for each in at] == [0.0, pytest.approx(0.4, abs=0.2)]
