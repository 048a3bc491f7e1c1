"""The machine of the page, drawn from its links: every body is where the kinematics have it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rds.machines import load_machine, machine_names
from rds.panels.equipment.machine_view import LinksView, MachineView, bars_of, view_of
from rds.panels.machine.library_view import LibraryView
from rds.panels.page.shell import Shell
from rds.panels.session.session import Session

LINKED = [name for name in machine_names() if load_machine(name).links]


@pytest.mark.parametrize("name", LINKED)
def test_bodies_follow_the_joints(name: str) -> None:
    machine = load_machine(name)
    view = view_of(machine)
    assert isinstance(view, LinksView)
    q = machine.kinematics.random(1, seed=4)[0]
    view.begin([(f"{axis}_measured", "") for axis in machine.kinematics.joints])
    view.show(np.array([0.1, *q]))
    frames = machine.kinematics.frames(q[None])
    for body, frame in frames.items():
        assert view._bodies[body].model_matrix == pytest.approx(frame[0], abs=1e-3)
    ends = view._lines.vertices.reshape(-1, 2, 3)
    for (parent, child), (low, high) in zip(bars_of(machine), ends, strict=True):
        assert high == pytest.approx(frames[child][0, :3, 3], abs=1e-3)
        assert parent == "bed" or low == pytest.approx(frames[parent][0, :3, 3], abs=1e-3)
    assert machine.kinematics.joints[0] in view.words.value


def test_a_machine_without_links_is_the_mill_that_it_was() -> None:
    assert type(view_of(load_machine("mini-cnc"))) is MachineView


def test_a_machine_by_hand_without_a_browser(tmp_path: Path) -> None:
    """The panel's own view: modules mounted, refused, taken out, moved, and written as a machine that loads."""
    view = LibraryView(Shell(Session(tmp_path, "mrmt-oacs")))
    assert view._write.disabled and "begin with a cutting head" in view.notice.value

    def mount(*names: str) -> None:
        for name in names:
            view.choices.set("module", name)
            view.mount()

    mount("oacs-drill", "oacs-x")
    assert view._write.disabled and "does not fit on" in view.notice.value
    view._remove(1)
    mount("oacs-range-arm", "oacs-x", "oacs-z")
    assert view._write.disabled
    view._move(3, -1)
    assert view.order == ["oacs-drill", "oacs-range-arm", "oacs-z", "oacs-x"] and not view._write.disabled
    view.write()
    assert load_machine(str(tmp_path / "by-hand.toml")).kinematics.joints == ("X", "Z")
