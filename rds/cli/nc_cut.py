"""`rds nc cut`: what a program, or a run of it, makes of a block of material."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, BinaryIO

import typer

from rds.cli.common import Json, picture_kind, print_json, progress_bars, refusals, writes_files
from rds.cli.nc_options import MachineName, MaxJumps, Parameters, Program, ProgramOptions, With

if TYPE_CHECKING:
    import numpy as np

    from rds.machines import Machine
    from rds.nc.path_block import PathBlock
    from rds.nc.stock.cut import Carving
    from rds.nc.stock.stock import Stock

_UNDER = 1.0  # mm of stock below the deepest cut, where nobody says how thick it is


@writes_files
def cut(
    file: Program,
    library: Annotated[Path, typer.Option("--tools", help="The tool library (.toml), with the shapes of the tools.")],
    stock: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z,X,Y,Z",
            help="Lower and upper corner of the material, mm, machine coordinates of the tool's tip; by default as "
            "large as what is cut, with its top at Z 0.",
        ),
    ] = None,
    cell: Annotated[float, typer.Option(help="Of the grid of heights, mm.")] = 0.1,
    part: Annotated[
        Path | None, typer.Option(help="The intended part: an STL model, or heights of another cut (--save).")
    ] = None,
    tolerance: Annotated[float, typer.Option(min=0.0, help="Of the part, mm.")] = 0.02,
    measured: Annotated[
        Path | None, typer.Option(help="Cut along the measured positions of a run of FILE: its folder.")
    ] = None,
    machine: MachineName = "mini-cnc",
    parameters: Parameters = None,
    with_: With = None,
    max_jumps: MaxJumps = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The picture: png, svg or pdf; by default FILE's name -cut.png.")
    ] = None,
    save: Annotated[Path | None, typer.Option(help="Keep the heights (.npz), as the --part of another cut.")] = None,
    json: Json = False,
) -> None:
    """Cut a program in simulation: rapids, shank and holder in material, loads of each tool, what is left of the part.

    The exit code is 1 where something goes through material that must not, or the part is missed by more than the
    tolerance.
    """
    with refusals():
        from rds.core.atomic import write_files
        from rds.core.errors import InputError
        from rds.machines import load_machine
        from rds.nc.check import motion
        from rds.nc.language.tool_library import read_library
        from rds.nc.stock.cut import Carving, Difference
        from rds.nc.stock.pictures import picture

        if library.suffix.lower() != ".toml":
            raise InputError("is no tool library; a cut needs the shapes of the tools, in a .toml file", str(library))
        path = out or file.parent / f"{file.stem}-cut.png"
        kind = picture_kind(path)
        of, what = load_machine(machine), ProgramOptions(library, parameters, with_, max_jumps).setup()
        tools = {tool.number: tool for tool in read_library(library)}
        with progress_bars() as bar:
            blocks = list(motion(file, of, what, bar("read")))
        block = _stock(stock, cell, blocks, tools)
        carving = Carving(block, tools)
        before = block.volume
        if measured is None:
            carving.program(blocks)
        else:
            _along(measured, carving, blocks, of)
        difference = wanted = None
        if part is not None:
            wanted = block.part(part)
            difference = Difference.of(block, wanted, tolerance)
        shown = picture(block, f"{file.name}{' as measured' if measured else ''}", wanted)
        writers: dict[Path, Callable[[BinaryIO], Any]] = {path: lambda stream: shown.savefig(stream, format=kind)}
        if save is not None:
            writers[save] = block.save
        write_files(writers)
    missed = difference is not None and max(difference.highest, difference.deepest) > tolerance
    found: dict[str, Any] = {
        "program": str(file),
        "stock_mm": [block.x0, block.extent[1], block.y0, block.extent[3], block.floor],
        "cell_mm": cell,
        "removed_mm3": before - block.volume,
        "tools": [load.to_json() for load in carving.loads.values()],
        "faults": [{"line": fault.line, "kind": fault.kind, "value": fault.value} for fault in carving.faults],
        "part": None if difference is None else difference.to_json(),
        "picture": str(path),
    }
    if json:
        print_json(found)
    else:
        _tell(found, carving, tolerance)
    raise typer.Exit(1 if carving.faults or missed else 0)


def _stock(text: str | None, cell: float, blocks: list[PathBlock], tools: Any) -> Stock:
    import numpy as np

    from rds.core.errors import InputError
    from rds.nc.extent import extents
    from rds.nc.stock.stock import Stock

    if text is not None:
        try:
            corners = [float(word) for word in text.split(",")]
        except ValueError:
            corners = []
        if len(corners) != 6:
            raise InputError(f"--stock {text!r} is not six numbers with commas between them: X,Y,Z,X,Y,Z")
        return Stock.block(corners[:3], corners[3:], cell)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for block in blocks:
        feeds = block.segments[~block.segments["rapid"]]
        tool = tools.get(block.tool)
        if not len(feeds) or tool is None:
            continue
        reach = np.array([tool.diameter / 2.0, tool.diameter / 2.0, 0.0])
        a, b = extents(feeds)
        length = np.array([0.0, 0.0, tool.length])
        low = np.minimum(low, a[:, :3].min(axis=0) - reach - length)
        high = np.maximum(high, b[:, :3].max(axis=0) + reach - length)
    if not np.isfinite(low).all() or low[2] >= 0.0:
        raise InputError("the program cuts nothing below Z 0; say where the material is (--stock)")
    return Stock.block([low[0], low[1], low[2] - _UNDER], [high[0], high[1], 0.0], cell)


def _along(folder: Path, carving: Carving, blocks: list[PathBlock], machine: Machine) -> None:
    """Cut along what was measured in a run: each sample with the tool and the kind of move of its place in the plan."""
    import numpy as np

    from rds.core.errors import InputError
    from rds.results import open_result

    result = open_result(folder)
    needed = ("program_sample", "program_line")
    if any(name not in result for name in needed):
        raise InputError("is no run of a part program with planned motion; make one with `rds nc run`", str(folder))
    missing = [name for name in "XYZ" if f"{name}_measured" not in result]
    if len(missing) == 3:
        raise InputError("has no measured positions of X, Y and Z", str(folder))
    points = np.column_stack(
        [result[f"{name}_measured"] if name not in missing else np.zeros(len(result)) for name in "XYZ"]
    )
    tool, rapid = _moves_of(blocks, machine, np.round(result["program_sample"]).astype(int))
    for number, rows in _stretches(tool):
        if number in carving.tools:
            T = float(result["time"][1] - result["time"][0])
            line = result["program_line"][rows].astype(int)
            carving.positions(carving.tool(number), points[rows], line, rapid[rows], T)


def _moves_of(blocks: list[PathBlock], machine: Machine, sample: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The tool's number, and whether the move is a rapid, of each planned sample (n) of a program's motion."""
    import numpy as np

    from rds.interpolators.motion.limits import Limits
    from rds.interpolators.motion.planner import plan

    tool = np.concatenate([np.zeros(0, int), *(np.full(len(block), block.tool) for block in blocks)])
    rapid = np.concatenate([np.zeros(0, bool), *(block.segments["rapid"] for block in blocks)])
    if not len(tool):
        return np.zeros(len(sample), int), np.zeros(len(sample), bool)
    planned = plan(blocks, Limits.of(machine), machine.sample_period, start=np.zeros(6))
    segment = np.concatenate([np.zeros(0, int), *(block.segment for block in planned)])
    of = segment[np.clip(sample, 0, len(segment) - 1)].clip(0, len(tool) - 1)
    return tool[of], rapid[of]


def _stretches(tool: np.ndarray) -> Iterable[tuple[int, slice]]:
    """Where the same tool cuts, one stretch after another."""
    import numpy as np

    edges = [0, *(np.flatnonzero(np.diff(tool)) + 1).tolist(), len(tool)]
    return [(int(tool[a]), slice(a, b)) for a, b in pairwise(edges) if b > a]


def _tell(found: dict[str, Any], carving: Carving, tolerance: float) -> None:
    x0, x1, y0, y1, floor = found["stock_mm"]
    typer.echo(
        f"{found['program']}: {found['removed_mm3']:.1f} mm³ cut from X {x0:.4g} to {x1:.4g}, Y {y0:.4g} to {y1:.4g}, "
        f"down to Z {floor:.4g} mm, in cells of {found['cell_mm']:g} mm"
    )
    for load in carving.loads.values():
        teeth = f", {load.feed_per_tooth:.3g} mm per tooth" if load.feed_per_tooth else ""
        typer.echo(
            f"tool {load.tool.number} ({load.tool.said}): {load.volume:.1f} mm³ in {load.seconds:.1f} s, deepest "
            f"{load.depth:.3g} mm, at most {load.rate:.3g} mm³/s (line {load.rate_line}){teeth}"
        )
    for fault in carving.faults:
        typer.echo(str(fault))
    if found["part"] is not None:
        part = found["part"]
        for what, volume, most, at in (
            ("left above", "left_mm3", "highest_mm", "highest_at_mm"),
            ("cut below", "gouged_mm3", "deepest_mm", "deepest_at_mm"),
        ):
            x, y = part[at]
            typer.echo(
                f"{what} the part: {part[volume]:.3g} mm³ beyond {tolerance:g} mm, at most {part[most]:.3g} mm at "
                f"X {x:.4g} Y {y:.4g}"
            )
    typer.echo(f"picture: {found['picture']}")
