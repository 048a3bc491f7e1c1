"""What will run, as blocks and the signals between them: the data of the block diagram of an experiment."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

from rds.machines import Axis, Machine
from rds.modes import load_mode
from rds.panels.equipment.fields import SIZES


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
    axes = [machine.axes[name] for name in table.get("axes") or [table["axis"]]]
    axis, mode = axes[0], load_mode(str(table["mode"]))
    names = ", ".join(each.name for each in axes)
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
    model = Block("model", f"Model of {names}", _of_each(axes, lambda each: _model(table, each, words)), column + 1)
    resolution = _of_each(axes, lambda each: (f"{each.resolution:g} {each.unit} per count",))
    encoder = Block("encoder", "Encoder", resolution, column + 2)
    measured, moved = f"y [{axis.unit}]", f"x [{axis.unit}]"
    if mode.moves_machine:
        blocks += [
            Block("converter", "CAN command", (_nodes(axes), *converter), column),
            Block("machine", f"Machine, {_name(axes)}", _of_each(axes, _travel), column + 1),
            encoder,
        ]
        links += [
            Link(acting, "converter", "u [V]"),
            Link("converter", "machine", "V"),
            Link("machine", "encoder", moved),
        ]
        if mode.modelled:
            blocks.append(Block("model", model.title, model.lines, column + 1, row=1))
            links.append(Link("converter", "model", "same voltage [V]"))
            blocks.append(Block("beside", "Recorded beside", (f"{mode.followed} [{axis.unit}]",), column + 2, row=1))
            links.append(Link("model", "beside", ""))
    else:
        blocks += [Block("converter", "Converter", converter, column), model, encoder]
        links += [Link(acting, "converter", "u [V]"), Link("converter", "model", "V"), Link("model", "encoder", moved)]
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
    if shape["kind"] == "path":
        lines: tuple[str, ...] = _path_lines(shape)
    elif shape["kind"] == "user":
        lines = (str(shape["file"]).rpartition("/")[2],)
    else:
        offset = f"about {shape['offset']:g} {unit}" if shape.get("offset") else ""
        sizes = [f"{shape['amplitude']:g} {unit}"] if "amplitude" in shape else []
        sizes += [f"{shape['frequency']:g} Hz"] if "frequency" in shape else []
        others = [f"{name} {value}" for name, value in shape.items() if name not in ("kind", *SIZES)]
        lines = (shape["kind"], ", ".join(sizes), offset, *others)
    return Block("source", "Reference" if controlled else "Voltage signal", tuple(filter(None, lines)), 0)


def _path_lines(shape: Mapping[str, Any]) -> tuple[str, ...]:
    """The path, and who makes its samples."""
    if "file" in shape:
        path = str(shape["file"]).rpartition("/")[2]
    else:
        path = f"circle of {2.0 * shape['segment'][0]['centre'][0]:g} mm"
    feed = (f"{shape['feed']:g} mm/min",) if "feed" in shape else ()
    if "profile" in shape:
        return path, *feed, str(shape["profile"])
    name = str(shape["interpolator"]).rpartition("/")[2]
    if "arc_interpolator" in shape:
        name += f", {str(shape['arc_interpolator']).rpartition('/')[2]}"
    return (path, *feed, name, *([f"{shape['acceleration']['name']} filter"] if "acceleration" in shape else []))


def _of_each(axes: Sequence[Axis], lines: Callable[[Axis], tuple[str, ...]]) -> tuple[str, ...]:
    """Each line once where it is the same for all axes, else with the names of the axes."""
    told: list[str] = []
    for of_axes in zip_longest(*map(lines, axes), fillvalue=""):
        same = all(each == of_axes[0] for each in of_axes)
        told += [of_axes[0]] if same else [f"{axis.name}: {each}" for axis, each in zip(axes, of_axes, strict=True)]
    return tuple(told)


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
    lines = [words.get("controller", ""), *(["all axes together"] if given.pop("coupled", False) else [])]
    if poles:
        lines.append(f"poles {poles[0][0]:g} ± {abs(poles[0][1]):g}i 1/s")
    lines += [f"{name.replace('_', ' ')} {_shown(value)}" for name, value in given.items()]
    return tuple(lines[:4])


def _shown(value: Any) -> str:
    return f"{value:g}" if isinstance(value, int | float) else str(value)


def _travel(axis: Axis) -> tuple[str, ...]:
    low, high = axis.travel
    return (f"{low:g} to {high:g} {axis.unit}",)


def _name(axes: Sequence[Axis]) -> str:
    if len(axes) > 1:
        return f"axes {', '.join(axis.name for axis in axes)}"
    return axes[0].name if axes[0].is_spindle else f"{axes[0].name} axis"


def _nodes(axes: Sequence[Axis]) -> str:
    return f"node{'s' * (len(axes) > 1)} {', '.join(str(axis.node) for axis in axes)}"


def _sentence(blocks: Iterable[Block], mode: str, T: float) -> str:
    said = ", then ".join(f"{block.title} ({'; '.join(block.lines)})" for block in blocks if block.row == 0)
    beside = [f"{block.title} ({' '.join(block.lines)})" for block in blocks if block.row]
    return f"{mode}, every {T * 1e3:g} ms: {said}" + (f"; beside it {', '.join(beside)}" if beside else "")
