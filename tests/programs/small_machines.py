"""Machines of any axes: with one axis, a run has few pictures to draw."""

from __future__ import annotations

from pathlib import Path

AXIS = """
[axis.{name}]
node = {node}
unit = "{unit}"
travel = [-400.0, 400.0]
resolution = 0.001
[axis.{name}.model]
name = "linear-axis"
tau = 0.01
K = {gain}
[axis.{name}.limits]
velocity = {velocity}
acceleration = {acceleration}
jerk = {jerk}
"""
LINEAR = {"unit": "mm", "gain": 1.8, "velocity": 13.0, "acceleration": 200.0, "jerk": 10000.0}
ROTARY = {"unit": "deg", "gain": 10.0, "velocity": 60.0, "acceleration": 600.0, "jerk": 30000.0}


def machine(folder: Path, axes: str) -> Path:
    tables = [
        AXIS.format(name=name, node=node, **(LINEAR if name in "XYZ" else ROTARY)) for node, name in enumerate(axes, 2)
    ]
    file = folder / f"{axes}.toml"
    file.write_text("sample_period = 0.001\n" + "".join(tables))
    return file
