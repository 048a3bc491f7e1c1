"""The files that a set-up ends with: a machine of one axis, and an experiment that moves it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rds.core.toml_text import toml_key, toml_value


@dataclass
class Choices:
    """What was found and chosen; `write` are objects that are written before each run."""

    name: str  # of the machine
    axis: str
    unit: str
    travel: tuple[float, float]
    period: float  # s
    mode: str
    node: int
    counts: float
    eds: str | None = None
    direction: int = 1
    fixed_mapping: bool = False
    torque_limit: int = 1000
    write: list[tuple[int, int, int]] = field(default_factory=list)

    @property
    def motion(self) -> str:
        """What the experiment tracks: a sine, or steps where the drive moves by profiles of its own."""
        return "steps" if self.mode == "pp" else "sine"


def cia402_table(choices: Choices, **instead: Any) -> dict[str, Any]:
    """The `[bus.cia402]` table; `instead` replaces keys of the axis."""
    axis: dict[str, Any] = {"node": choices.node, "counts": choices.counts}
    if choices.eds is not None:
        axis["eds"] = choices.eds
    if choices.direction != 1:
        axis["direction"] = choices.direction
    if choices.fixed_mapping:
        axis["mapping"] = "fixed"
    if choices.torque_limit != 1000:
        axis["torque_limit"] = choices.torque_limit
    if choices.write:
        axis["write"] = [list(entry) for entry in choices.write]
    return {"mode": choices.mode, "axis": {choices.axis: axis | instead}}


def machine_text(choices: Choices, about: str) -> str:
    """A machine file. The model and the limits are assumptions, and say so."""
    low, high = choices.travel
    speed = round((high - low) / 4.0, 6)
    axis = toml_key(choices.axis)
    return f"""# Set up by `rds drive setup`: {"".join(letter for letter in about if letter.isprintable())}

name = {toml_value(choices.name)}
title = {toml_value(f"{choices.name}, one drive")}
sample_period = {choices.period!r}          # s

[converter]
range = 10.0                   # V; in mode cst they are the rated torque
bits = 16

[axis.{axis}]
node = {choices.node}
unit = {toml_value(choices.unit)}
travel = [{low!r}, {high!r}]         # {choices.unit}
resolution = {1.0 / choices.counts!r}     # {choices.unit} per count: {choices.counts:g} counts per {choices.unit}

[axis.{axis}.model]            # assumed, for simulation; fit it to the axis before designing for mode cst
name = "linear-axis"
tau = 0.01                     # s
K = {speed / 10.0!r}
friction_plus = 0.0
friction_minus = 0.0

[axis.{axis}.limits]           # assumed: a quarter of the travel in a second
velocity = {speed!r}
acceleration = {speed * 10.0!r}
jerk = {speed * 500.0!r}
"""


def experiment_text(choices: Choices, machine: str, bus: Mapping[str, Any]) -> str:
    """An experiment file: a slow sine, or steps, of a tenth of the travel, on the drive."""
    low, high = choices.travel
    amplitude = round(min(abs(low), abs(high)) / 10.0, 6)
    lines = [
        f"title = {toml_value(('A sine' if choices.motion == 'sine' else 'Steps') + f' on {choices.axis}')}",
        f"machine = {toml_value(machine)}",
        f"axis = {toml_value(choices.axis)}",
        'mode = "implementation"',
        "duration = 8.0                 # s",
        "",
        "[reference]",
        f'kind = "{"sinusoid" if choices.motion == "sine" else "square"}"',
        f"amplitude = {amplitude!r}                # {choices.unit}",
        "frequency = 0.25               # Hz",
        "",
        "[bus]",
        'dialect = "cia402"',
        *(f"{key} = {toml_value(value)}" for key, value in bus.items()),
        "",
    ]
    table = cia402_table(choices)
    lines += ["[bus.cia402]", f'mode = "{table["mode"]}"', "", f"[bus.cia402.axis.{toml_key(choices.axis)}]"]
    axis = dict(table["axis"][choices.axis])
    writes = [f"[0x{index:04X}, {subindex}, {value}]" for index, subindex, value in axis.pop("write", ())]
    lines += [f"{key} = {toml_value(value)}" for key, value in axis.items()]
    if writes:
        lines.append(f"write = [{', '.join(writes)}]  # object, sub-index, value; before each run")
    return "\n".join(lines) + "\n"
