"""`rds forces` and `rds machine power`: what a machine's joints and its supply are loaded with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from rds.cli.common import Json, named_values, print_json, progress_bars, refusals, save_picture, writes_files
from rds.cli.nc_options import ProgramOptions


@writes_files
def forces(
    machine: Annotated[str, typer.Argument(help="A machine's name, or the path of its TOML file.")],
    program: Annotated[Path, typer.Argument(help="The part program (RS274NGC, as LinuxCNC reads it).")],
    *,
    cut: Annotated[
        Path | None, typer.Option(help="A file that says the cut and its limits; or the options below.")
    ] = None,
    material: Annotated[str | None, typer.Option(help="Of `rds cutting materials` (default aluminium-6061).")] = None,
    coefficients: Annotated[Path | None, typer.Option(help="File of coefficients instead of the package's.")] = None,
    depth: Annotated[float | None, typer.Option(help="Depth of cut, mm.")] = None,
    teeth: Annotated[int | None, typer.Option(help="Teeth of the tool (default 1: feed per revolution).")] = None,
    diameter: Annotated[float | None, typer.Option(help="Diameter of the tool, mm.")] = None,
    speed: Annotated[float | None, typer.Option(help="Spindle speed where the program says none, rev/min.")] = None,
    axial: Annotated[float | None, typer.Option(help="Force along the tool, share of the cutting force.")] = None,
    direction: Annotated[
        float | None,
        typer.Option(
            help="Of the force across the tool: 0 against the motion (default), from there counter-clockwise as seen "
            "from the spindle, degrees."
        ),
    ] = None,
    width: Annotated[float | None, typer.Option(help="Width of cut, mm, for the spindle's power.")] = None,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE", help="What is borne: force=40 (N), a joint's X=60 (N), C=2 (N m), power=160 (W)."
        ),
    ] = None,
    reading: ProgramOptions,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="A picture: png, svg or pdf.")] = None,
    json: Json = False,
) -> None:
    """The force at the tool along a program, the loads of the joints, and where they are worst.

    Every feed move cuts with the same depth; no rapid does. The exit code is 1 where a limit is exceeded.
    """
    with refusals():
        from rds.core.errors import InputError
        from rds.machines import load_machine
        from rds.machines.forces.cut_file import cut_of, read_cut
        from rds.nc.run.forces import picture, program_forces
        from rds.nc.run.prepare import prepare

        words = {"material": material, "depth": depth, "teeth": teeth, "diameter": diameter}
        words |= {"coefficients": None if coefficients is None else str(coefficients), "speed": speed, "axial": axial}
        words |= {"direction": direction, "width": width}
        given: dict[str, Any] = {key: value for key, value in words.items() if value is not None}
        if limit:
            given["limits"] = named_values(limit, "--limit", "force=40")
        if cut is not None and given:
            option = next(iter(given)) if "limits" not in given else "limit"
            raise InputError(f"--{option} belongs into the file of --cut, {cut}; write it there, or leave --cut out")
        made = read_cut(cut) if cut is not None else cut_of(given)
        of = load_machine(machine)
        with progress_bars() as bar:
            prepared = prepare(program, of, reading.setup(), progress=bar("check"))
        found = program_forces(prepared, of, made)
        if out is not None:
            save_picture(picture(found), out)
    worst = found.worst
    told = found.to_json()
    exceeded = [w for w in worst if w.share is not None and w.share > 1.0]
    if json:
        print_json({"program": str(program), "machine": of.name, **told, "picture": None if out is None else str(out)})
        raise typer.Exit(1 if exceeded else 0)
    from rds.cli.console import show_table

    rows = [
        [
            _called(w.name),
            f"{w.value:.4g} {w.unit}",
            str(w.line),
            f"{w.time:.3f}",
            "" if w.limit is None else f"{w.limit:g} {w.unit}",
        ]
        for w in worst
    ]
    note = (
        f"{made.law.material}, {made.law.tool}. A load is what the process does to a joint in its positive direction."
    )
    show_table(f"{program.name} on {of.name}", ["load", "largest", "in line", "at [s]", "limit"], rows, note)
    if exceeded:
        least = told["least_override"]
        percent = f"{100 * least['value']:.1f} %"
        names = ", ".join(_called(w.name) for w in exceeded)
        typer.echo(f"exceeded: {names}; a feed of {percent} in line {least['line']} keeps the limits")
    for warning in found.warnings():
        typer.echo(f"warning: {warning}")
    if out is not None:
        typer.echo(f"picture: {out}")
    raise typer.Exit(1 if exceeded else 0)


def _called(name: str) -> str:
    return {"force": "cutting force", "power": "spindle's power"}.get(name, f"joint {name}")


def power(
    machine: Annotated[str, typer.Argument(help="A machine's name, or the path of its TOML file.")] = "mrmt-oacs",
    json: Json = False,
) -> None:
    """What the machine's modules draw, against their supply. The exit code is 1 where they draw more."""
    with refusals():
        from rds.machines import load_machine
        from rds.machines.power import power_budget

        budget = power_budget(load_machine(machine))
    if json:
        print_json(budget.to_json())
        raise typer.Exit(0 if budget.ok else 1)
    from rds.cli.console import show_table

    rows = [[m.name, f"{m.start:.2f}", f"{m.run:.2f}", f"{m.peak:.2f}"] for m in budget.modules]
    rows.append(["all", f"{budget.start:.2f}", f"{budget.run:.2f}", f"{budget.peak:.2f}"])
    show_table(f"Currents of {budget.machine}", ["module", "start [A]", "run [A]", "largest [A]"], rows)
    typer.echo(budget.verdict())
    raise typer.Exit(0 if budget.ok else 1)
