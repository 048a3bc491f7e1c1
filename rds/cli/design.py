"""`rds design` and `rds machine from`: what a fitted model is for, laws for a loop with delay, and gains by a relay."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rds.cli.common import Json, print_json, refusals, writes_files

if TYPE_CHECKING:
    from rds.identification.fit.design import Linear
    from rds.machines import Machine

app = typer.Typer(
    no_args_is_help=True, help="Controllers designed from a fitted model, for a loop with delay, or by a relay."
)

Model = Annotated[Path, typer.Argument(help="A model file, as `rds fit -o` writes it.")]


@app.command()
@writes_files
def tracking(
    out: Annotated[Path, typer.Option("--out", "-o", help="The controller's file, FILE.py.")],
    model: Annotated[Path | None, typer.Argument(help="A model file, as `rds fit -o` writes it.")] = None,
    axis: Annotated[str | None, typer.Option(help="Instead of a model file: an axis by its machine's data.")] = None,
    machine: Annotated[str | None, typer.Option(help="The machine of --axis (default mini-cnc).")] = None,
    sample_period: Annotated[
        float | None, typer.Option(help="Of the loop, s (default: that of the machine of --axis, else 0.001).")
    ] = None,
    poles: Annotated[str, typer.Option(help="Two poles of the error, 1/s.")] = "-32+24j,-32-24j",
    observer_pole: Annotated[float, typer.Option(help="Of the velocity's observer, 1/s.")] = -320.0,
    voltage_range: Annotated[
        float | None, typer.Option(help="Of the converter, ± V (default: that of the machine of --axis, else 10).")
    ] = None,
    json: Json = False,
) -> None:
    """The general tracking controller with its observer, as a file of your own."""
    with refusals():
        from rds.core.errors import InputError
        from rds.identification.fit.design import write_tracking

        if voltage_range == inf:
            raise InputError("--voltage-range = inf V must be a finite number; a converter has a range")
        designed, on = _axis(model, axis, machine)
        period, volts = (0.001, 10.0) if on is None else (on.sample_period, on.converter.range)
        write_tracking(
            out,
            designed,
            sample_period=period if sample_period is None else sample_period,
            poles=_poles(poles),
            observer_pole=observer_pole,
            voltage_range=volts if voltage_range is None else voltage_range,
        )
    _warn(model, designed.doubts)
    if json:
        said = {"left_out": list(designed.left_out), "warnings": list(designed.doubts)}
        print_json({"file": str(out), "tau": designed.tau, "K": designed.K} | said)
        return
    typer.echo(f"designed for tau = {designed.tau:.6g} s, K = {designed.K:.6g} (mm/s)/V")
    for sentence in designed.left_out:
        typer.echo(f"not in the design: {sentence}")
    typer.echo(f"wrote {out}")


@app.command()
@writes_files
def lqg(
    experiment: Annotated[Path, typer.Argument(help="The experiment whose loop it is, a TOML file.")],
    delay: Annotated[float | None, typer.Option(help="The loop's delay, s; by default the experiment's own.")] = None,
    delays: Annotated[
        Path | None, typer.Option(help="Measured delays, as `rds network measure --out` writes them.")
    ] = None,
    axis: Annotated[str | None, typer.Option(help="Which axis; by default the experiment's first.")] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Write the controller's table, FILE.toml.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Write the margins with the delays on top as a PNG.")] = None,
    json: Json = False,
) -> None:
    """LQG control for a loop with a known delay, its gains and its margins against delay and jitter."""
    with refusals():
        from rds.core.atomic import keep_another, write_whole
        from rds.core.errors import InputError
        from rds.modes.experiment.experiment import Experiment
        from rds.network.delays import Delay
        from rds.network.loops.design import LQG, design_lqg
        from rds.network.trace import read_total

        if delay is not None and delays is not None:
            raise InputError("give one of --delay and --delays")
        if out is not None:
            keep_another(out, LQG, "controller of `rds design lqg`")
        known = None if delay is None else Delay.named("constant", delay=delay)
        known = known if delays is None else Delay.recorded(read_total(delays))
        designed = design_lqg(Experiment.from_toml(experiment), known, axis)
        if out is not None:
            write_whole(out, designed.table().encode())
        if plot is not None:
            write_whole(plot, designed.plot().png())
    if json:
        print_json(designed.to_json())
        return
    typer.echo(str(designed))
    typer.echo(designed.table() if out is None else f"wrote {out}")


@app.command()
@writes_files
def relay(
    run: Annotated[Path, typer.Argument(help="A saved run of the law relay: its folder or result file.")],
    axis: Annotated[str | None, typer.Option(help="Which axis; by default the first that the law drove.")] = None,
    delay: Annotated[
        int | None,
        typer.Option(min=0, max=200, help="Of the loop, samples, for the margins; by default 1 on a bus, else 0."),
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Write the controller's table, FILE.toml.")] = None,
    json: Json = False,
) -> None:
    """The gains that a run of the law relay found, as a table of a controller, and their margins by the run's model."""
    with refusals():
        from rds.core.atomic import keep_another, write_whole
        from rds.core.errors import InputError
        from rds.identification.robustness.relay import RELAY, relay_gains

        if out is not None:
            if out.suffix != ".toml":
                raise InputError("the table of a controller is TOML; give it a name that ends in .toml", str(out))
            keep_another(out, RELAY, "controller of `rds design relay`")
        found = relay_gains(run, axis, delay)
        if out is not None:
            write_whole(out, found.table().encode())
    if json:
        print_json(found.to_json())
        return
    typer.echo(str(found))
    typer.echo(found.table() if out is None else f"wrote {out}")


def _axis(model: Path | None, axis: str | None, machine: str | None) -> tuple[Linear, Machine | None]:
    """What is designed for, and the machine that it is an axis of where that was named."""
    from rds.core.errors import InputError
    from rds.identification.fit.design import linear_axis_of, linear_axis_of_machine
    from rds.machines import load_machine

    if (model is None) == (axis is None):
        raise InputError("give one of a model file and --axis (with --machine, if it is not the mini-cnc)")
    if model is not None:
        if machine is not None:
            raise InputError("--machine is for --axis; a model file says what the axis is")
        return linear_axis_of(model), None
    on = load_machine("mini-cnc" if machine is None else machine)
    return linear_axis_of_machine(on, str(axis)), on


def _warn(model: Path | None, doubts: Iterable[str]) -> None:
    """Repeat what the fit said against using its parameters, or some of them."""
    for sentence in doubts:
        typer.echo(f"warning: {model}: {sentence}", err=True)


def _poles(text: str) -> list[complex]:
    from rds.core.errors import InputError

    try:
        return [complex(part.strip().replace("i", "j").replace(" ", "")) for part in text.split(",")]
    except ValueError as error:
        raise InputError(f"--poles {text!r} must be two poles, as in -32+24j,-32-24j or -40,-50 (1/s)") from error


@writes_files
def machine_from(
    model: Model,
    axis: Annotated[str, typer.Option(help="Which axis it is a model of.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The machine's file, FILE.toml.")],
    base: Annotated[
        str | None, typer.Option(help="The machine that it is an axis of: a name or a file (default mini-cnc).")
    ] = None,
    alone: Annotated[bool, typer.Option("--alone", help="A machine of this axis alone, as the logs tell it.")] = False,
    measured: Annotated[
        bool, typer.Option("--measured", help="Travel, speed and resolution of the logs that were fitted.")
    ] = False,
    per_volt: Annotated[
        float | None, typer.Option(help="Of a model commanded in A, N, Nm or %: how much the drive makes of 1 V.")
    ] = None,
    json: Json = False,
) -> None:
    """A machine file whose axis is what was estimated; the rest is that of a known machine, and is said."""
    with refusals():
        from rds.core.errors import InputError
        from rds.identification.fit.machine_file import write_machine
        from rds.identification.fit.model_file import read_model
        from rds.machines import load_machine

        file = read_model(model)
        if alone and base is not None:
            raise InputError("--alone is a machine without --base; leave one of them out")
        if per_volt is not None and not 0.0 < abs(per_volt) < inf:
            raise InputError(f"--per-volt {per_volt:g} must be a finite number other than 0")
        known = None if alone else base or "mini-cnc"
        said = write_machine(out, file, known, axis, measured=measured, per_volt=per_volt).said
        made = load_machine(str(out)).axis(axis)
    doubts = file.doubts()
    _warn(model, doubts)
    if json:
        print_json(
            {"file": str(out), "axis": axis, "model": made.model, "machine": made.machine, "warnings": doubts}
            | {"notes": said}
        )
    else:
        typer.echo(f"wrote {out}: axis {axis} as in {model}" + (f", the rest of {known}" if known else ""))
        for sentence in said:
            typer.echo(f"note: {sentence}")
