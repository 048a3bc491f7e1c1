"""A picture of a machine's links with their frames, and of where its tool can be."""

from __future__ import annotations

from io import BytesIO, StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.errors import InputError
from rds.machines.kinematics.kinematics import TIP, ZERO
from rds.machines.kinematics.workspace import workspace

if TYPE_CHECKING:
    from rds.core.figure import Picture
    from rds.machines.kinematics import Kinematics
    from rds.machines.machine import Machine

FORMATS = (".png", ".svg", ".pdf", ".html")
_POINTS = 3000


def picture(machine: Machine, joints: dict[str, float] | None = None) -> Picture:
    """The links as a line from the bed to tool and work, each with its frame (x red, y green, z blue), and workspaces.

    `joints` by name; by default all at zero, or the middle of limits without it.
    """
    from rds.core.figure import BLUE, GREEN, GREY, ORANGE, VERMILLION, Picture

    kinematics = machine.kinematics
    q = kinematics.home[None] if joints is None else kinematics.values(joints)
    frames = {"bed": np.eye(4)} | {name: frame[0] for name, frame in kinematics.frames(q).items()}
    parents = {link.name: link.parent for link in machine.links}
    parents |= {TIP: machine.tool.link if machine.tool else "bed", ZERO: machine.work.link if machine.work else "bed"}
    figure = Picture(6.0)
    axes: Any = figure.add_subplot(1, 2, 1, projection="3d")
    places = np.array([frame[:3, 3] for frame in frames.values()])
    size = max(float(np.ptp(places, axis=0).max()), 100.0) / 8.0
    for name, parent in parents.items():
        axes.plot(*np.stack([frames[parent][:3, 3], frames[name][:3, 3]]).T, color="black", linewidth=2.0)
    names: dict[tuple[float, ...], list[str]] = {}  # by place: frames that coincide have one label
    for name, frame in frames.items():
        for column, colour in zip(frame[:3, :3].T, (VERMILLION, GREEN, BLUE), strict=True):
            axes.quiver(*frame[:3, 3], *(size * column), color=colour, linewidth=1.5)
        names.setdefault(tuple((frame[:3, 3].round(3) + 0.0).tolist()), []).append(name)
    for place, called in names.items():
        axes.text(*(np.array(place) + size / 6.0), ", ".join(called), fontsize=7)
    for along, low, high in zip("xyz", places.min(axis=0) - 1.5 * size, places.max(axis=0) + 1.5 * size, strict=True):
        getattr(axes, f"set_{along}lim")(low, high)
    shown = ", ".join(f"{n} {v:g}" for n, v in zip(kinematics.joints, q[0], strict=True))
    _dress(axes, f"Frames from the bed: {shown}")
    room: Any = figure.add_subplot(1, 2, 2, projection="3d")
    colours = {"travel": (GREY, "reachable"), "limits": (ORANGE, "operational")}
    if np.array_equal(kinematics.travel, kinematics.limits):
        del colours["travel"]
    for within, (colour, label) in colours.items():
        points = workspace(kinematics, within, n=_POINTS).points
        room.scatter(*points.T, s=3.0, color=colour, alpha=0.5, linewidths=0, label=f"{label} workspace")
    room.legend(loc="upper left", fontsize=7)
    _dress(room, "Where the tip can be, from the work's zero")
    figure.suptitle(machine.title or machine.name)
    return figure


def _dress(axes: Any, title: str) -> None:
    for along in "xyz":
        getattr(axes, f"set_{along}label")(f"{along} [mm]", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.set_aspect("equal")
    axes.set_title(title, fontsize=9)


def picture_file(machine: Machine, path: Path, joints: dict[str, float] | None = None) -> bytes:
    """The picture in the format that the file's name says; InputError for another one."""
    kind = path.suffix.lower()
    if kind not in FORMATS:
        raise InputError(f"{path.name!r} must end with {', '.join(FORMATS)}", str(path))
    figure = picture(machine, joints)
    if kind != ".html":
        stream = BytesIO()
        figure.savefig(stream, format=kind[1:])
        return stream.getvalue()
    text = StringIO()
    figure.savefig(text, format="svg")
    return _page(machine, machine.kinematics, text.getvalue(), joints).encode()


def _page(machine: Machine, kinematics: Kinematics, drawing: str, joints: dict[str, float] | None) -> str:
    from html import escape

    q = kinematics.home[None] if joints is None else kinematics.values(joints)
    rows = "".join(
        f"<tr><td>{escape(name)}</td>" + "".join(f"<td>{value + 0.0:.4g}</td>" for value in frame[0, :3, 3]) + "</tr>"
        for name, frame in kinematics.frames(q).items()
    )
    title = escape(machine.title or machine.name)
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title></head><body>'
        f"<h1>{title}</h1>{drawing[drawing.index('<svg') :]}<table><caption>Frames, from the bed, mm</caption>"
        f"<tr><th>frame</th><th>x</th><th>y</th><th>z</th></tr>{rows}</table></body></html>\n"
    )
