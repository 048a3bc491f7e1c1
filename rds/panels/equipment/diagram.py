"""What will run, as blocks and the signals between them: the data of the block diagram of an experiment."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from rds.machines import Axis, Machine
from rds.modes import load_mode


@dataclass(frozen=True)
class Block:
    """One block: `title` and lines under it; `row` 0 is what acts, row 1 what runs beside; `column` from the left."""

    name: str
    title: str
    lines: tuple[str, ...]
    column: int
    row: int = 0
    quiet: bool = False  # its data are not used


@dataclass(frozen=True)
class Link:
    """A signal from one block to another, with its name and unit. `back`: a feedback, drawn underneath."""

    start: str
    end: str
    label: str
    back: bool = False


@dataclass(frozen=True)
class Diagram:
    """Blocks and links, with a sentence that says the same."""

    blocks: tuple[Block, ...]
    links: tuple[Link, ...]
    sentence: str


def diagram(table: Mapping[str, Any], machine: Machine, words: Mapping[str, str]) -> Diagram:
    """The diagram of an experiment's `table`; `words` names what was chosen ("controller", "model") for people."""
    axis, mode = machine.axes[table["axis"]], load_mode(str(table["mode"]))
    controlled = "reference" in table
    blocks = [_source(table, axis, controlled)]
    links = []
    acting = "source"
    if controlled:
        blocks.append(Block("controller", "Controller", _controller(table, words), 1))
        links.append(Link("source", "controller", f"r [{axis.unit}]"))
        acting = "controller"
    column = len(blocks)
    board = machine.converter
    converter = (f"± {board.range:g} V", f"{board.bits} bit")
    model = Block("model", f"Model of {axis.name}", _model(table, axis, words), column + 1)
    encoder = Block("encoder", "Encoder", (f"{axis.resolution:g} {axis.unit} per count",), column + 2)
    measured = f"y [{axis.unit}]"
    if mode.moves_machine:
        blocks += [
            Block("converter", "CAN command", (f"node {axis.node}", *converter), column),
            Block("machine", f"Machine, {_name(axis)}", _travel(axis), column + 1),
            encoder,
        ]
        links += [Link(acting, "converter", "u [V]"), Link("converter", "machine", "V"), Link("machine", "encoder", "")]
        if mode.modelled:
            blocks.append(Block("model", model.title, model.lines, column + 1, row=1))
            links.append(Link("converter", "model", "same voltage [V]"))
            blocks.append(Block("beside", "Recorded beside", (f"{mode.followed} [{axis.unit}]",), column + 2, row=1))
            links.append(Link("model", "beside", ""))
    else:
        blocks += [Block("converter", "Converter", converter, column), model, encoder]
        links += [Link(acting, "converter", "u [V]"), Link("converter", "model", "V"), Link("model", "encoder", "")]
        if mode.real_time:
            blocks.append(
                Block("drivers", "CAN drivers", ("run and timed,", "data not used"), column + 1, row=1, quiet=True)
            )
            links.append(Link("converter", "drivers", "frames"))
    if controlled:
        links.append(Link("encoder", "controller", measured, back=True))
    else:
        blocks.append(Block("record", "Record", (measured,), column + 3))
        links.append(Link("encoder", "record", ""))
    return Diagram(tuple(blocks), tuple(links), _sentence(blocks, mode.name, table["sample_period"]))


def _source(table: Mapping[str, Any], axis: Axis, controlled: bool) -> Block:
    shape = table["reference" if controlled else "signal"]
    unit = axis.unit if controlled else "V"
    if shape["kind"] == "user":
        lines: tuple[str, ...] = (str(shape["file"]).rpartition("/")[2],)
    else:
        offset = f"about {shape['offset']:g} {unit}" if shape.get("offset") else ""
        lines = (shape["kind"], f"{shape['amplitude']:g} {unit}, {shape['frequency']:g} Hz", offset)
    return Block("source", "Reference" if controlled else "Voltage signal", tuple(filter(None, lines)), 0)


def _model(table: Mapping[str, Any], axis: Axis, words: Mapping[str, str]) -> tuple[str, ...]:
    """The student's file, or the machine's own model with its numbers."""
    own = axis.model
    if "model" in table or "name" not in own:
        given = table.get("model", {}).get("params", {})
        return (words.get("model", "default"), *(f"{name} {value:g}" for name, value in given.items()))[:4]
    numbers = [f"τ {float(own['tau']) * 1e3:.3g} ms"] if "tau" in own else []
    numbers += [f"K {float(own['K']):.4g}"] if "K" in own else []
    return (str(own["name"]).replace("-", " "), ", ".join(numbers))


def _controller(table: Mapping[str, Any], words: Mapping[str, str]) -> tuple[str, ...]:
    given = {name: value for name, value in table["controller"].items() if name not in ("name", "file")}
    poles = given.pop("poles", None)
    given |= given.pop("params", {})  # of a student's file
    lines = [words.get("controller", "")]
    if poles:
        lines.append(f"poles {poles[0][0]:g} ± {abs(poles[0][1]):g}i 1/s")
    lines += [f"{name.replace('_', ' ')} {value:g}" for name, value in given.items()]
    return tuple(lines[:4])


def _travel(axis: Axis) -> tuple[str, ...]:
    low, high = axis.travel
    return (f"{low:g} to {high:g} {axis.unit}",)


def _name(axis: Axis) -> str:
    return axis.name if axis.unit == "rev/min" else f"{axis.name} axis"


def _sentence(blocks: Iterable[Block], mode: str, T: float) -> str:
    said = ", then ".join(f"{block.title} ({'; '.join(block.lines)})" for block in blocks if block.row == 0)
    beside = [f"{block.title} ({' '.join(block.lines)})" for block in blocks if block.row]
    return f"{mode}, every {T * 1e3:g} ms: {said}" + (f"; beside it {', '.join(beside)}" if beside else "")
