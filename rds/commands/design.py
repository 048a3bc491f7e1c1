"""`rds design` and `rds machine from`: what a fitted model is for."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rds.commands.common import Json, print_json, refusals

app = typer.Typer(no_args_is_help=True, help="Controllers designed from a fitted model.")

Model = Annotated[Path, typer.Argument(help="A model file, as `rds fit -o` writes it.")]


@app.command()
def tracking(
    model: Model,
    out: Annotated[Path, typer.Option("--out", "-o", help="The controller's file, FILE.py.")],
    sample_period: Annotated[float, typer.Option(help="Of the loop, s.")] = 0.001,
    poles: Annotated[str, typer.Option(help="Two poles of the error, 1/s.")] = "-32+24j,-32-24j",
    observer_pole: Annotated[float, typer.Option(help="Of the velocity's observer, 1/s.")] = -320.0,
    voltage_range: Annotated[float, typer.Option(help="Of the converter, ± V.")] = 10.0,
    json: Json = False,
) -> None:
    """The general tracking controller with its observer, as a file of your own."""
    with refusals():
        from rds.identification.design import linear_axis_of, write_tracking
        from rds.identification.model_file import read_model

        file = read_model(model)
        axis = linear_axis_of(file)
        write_tracking(
            out,
            file,
            sample_period=sample_period,
            poles=_poles(poles),
            observer_pole=observer_pole,
            voltage_range=voltage_range,
        )
    if json:
        print_json({"file": str(out), "tau": axis.tau, "K": axis.K, "left_out": list(axis.left_out)})
        return
    typer.echo(f"designed for tau = {axis.tau:.6g} s, K = {axis.K:.6g} (mm/s)/V")
    for sentence in axis.left_out:
        typer.echo(f"not in the design: {sentence}")
    typer.echo(f"wrote {out}")


def _poles(text: str) -> list[complex]:
    from rds.core.errors import InputError

    try:
        return [complex(part.strip().replace("i", "j").replace(" ", "")) for part in text.split(",")]
    except ValueError as error:
        raise InputError(f"--poles {text!r} must be two poles, as in -32+24j,-32-24j or -40,-50 (1/s)") from error


def machine_from(
    model: Model,
    axis: Annotated[str, typer.Option(help="Which axis it is a model of.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The machine's file, FILE.toml.")],
    base: Annotated[str, typer.Option(help="The machine that it is an axis of: a name or a file.")] = "mini-cnc",
    json: Json = False,
) -> None:
    """A machine file whose axis is what was estimated; the rest is that of a known machine."""
    with refusals():
        from rds.identification.machine_file import write_machine
        from rds.machines import load_machine

        write_machine(out, model, base, axis)
        made = load_machine(str(out)).axis(axis)
    if json:
        print_json({"file": str(out), "axis": axis, "model": made.model, "machine": made.machine})
    else:
        typer.echo(f"wrote {out}: axis {axis} as in {model}, the rest of {base}")
