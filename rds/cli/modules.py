"""Commands for one distributed module: its motions and tuning."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from rds.bus.modules.oacs.pid import MEANINGS
from rds.cli.buses import BusOptions
from rds.cli.common import Json, ends_as_ctrl_c, named_values, print_json, progress_bars, refusals, writes_files
from rds.cli.option_groups import grouped_options

module_app = typer.Typer(
    no_args_is_help=True, help="One distributed module (oacs dialect): information, tuning, motions, recorded steps."
)


def _refused(sentence: str) -> Exception:
    from rds.core.errors import InputError

    return InputError(sentence)


@module_app.callback()
def module(
    context: typer.Context,
    number: Annotated[int, typer.Argument(metavar="ID", help="The module's number, as `rds scan` lists it.")],
) -> None:
    """One distributed module (oacs dialect): information, tuning, motions, recorded steps."""
    context.obj = number


@contextmanager
def _module(context: typer.Context, on_bus: BusOptions) -> Iterator[Any]:
    from rds.bus.modules.oacs.remote import Module

    with refusals():
        chosen = on_bus.chosen()
        if chosen.dialect == "cia402":
            raise _refused(
                f'[bus] of {on_bus.experiment} says dialect = "cia402": drives are moved and homed by `rds jog`'
            )
        with chosen.opened() as bus:
            yield Module(bus, context.obj)


@contextmanager
def _moving(context: typer.Context, on_bus: BusOptions) -> Iterator[Any]:
    """A module that moves: Ctrl-C, a polite kill and a closed terminal stop it."""
    with ends_as_ctrl_c(), _module(context, on_bus) as module:
        try:
            yield module
        except KeyboardInterrupt:
            module.stop()
            typer.echo("rds: the module was told to stop where it is", err=True)
            raise


@module_app.command()
@grouped_options
def info(context: typer.Context, on_bus: BusOptions, json: Json = False) -> None:
    """Download what the module says of itself, and its tuning."""
    with _module(context, on_bus) as module:
        found = module.info().as_dict()
    if json:
        print_json(found)
        return

    show_info(found)


@module_app.command()
@grouped_options
def tune(
    context: typer.Context,
    *,
    controller: Annotated[str | None, typer.Option(help="P, PI or PID; P is PI with Ki = 0.")] = None,
    set_: Annotated[list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="A tuning parameter.")] = None,
    from_step: Annotated[
        Path | None, typer.Option(help="Gains by Ziegler and Nichols from a recorded step (rds module ID step).")
    ] = None,
    on_bus: BusOptions,
    json: Json = False,
) -> None:
    """Select P, PI or PID and set gains and limits; without options, show what is in force."""
    with _module(context, on_bus) as module:
        parameters = _parameters(set_ or ())
        if from_step is not None:
            controller = controller or module.tuning().controller.name  # the gains of another one would not fit it
            parameters = _gains(from_step, controller) | parameters
        changes = bool(parameters) or controller is not None
        tuning = module.tune(controller, **parameters) if changes else module.tuning()
    from dataclasses import asdict

    values = asdict(tuning) | {"controller": tuning.controller.name}
    if json:
        print_json(values)
        return

    show_tuning(values)


def _gains(path: Path, controller: str) -> dict[str, float]:
    from rds.bus.modules.oacs.tuning import gains_from_step
    from rds.results import open_result

    result = open_result(path)
    return gains_from_step(result, result.axes[0], controller)._asdict()


def _parameters(texts: Sequence[str]) -> dict[str, float]:
    """The values of --set by name."""
    if chosen := [text for text in texts if text.partition("=")[0].lower() == "controller"]:
        raise _refused(f"--set {chosen[0]}: the controller is chosen by --controller PI or --controller PID")
    return named_values(texts, "--set", "Kp=2.5")


@module_app.command()
@grouped_options
def move(
    context: typer.Context,
    *,
    by: Annotated[float | None, typer.Option(help="Distance, mm or degrees, positive clockwise.")] = None,
    to: Annotated[float | None, typer.Option(help="Point, mm or degrees.")] = None,
    on_bus: BusOptions,
    json: Json = False,
) -> None:
    """Move by a distance or to a point, and say where it stands then."""
    if (by is None) == (to is None):
        with refusals():
            given = "neither is given" if by is None else "both are given"
            raise _refused(f"{given}: move by a distance with --by, or to a point with --to, as in --by 5")
    _moved(context, on_bus, json, lambda module, show: module.move(by=by, to=to, progress=show))


@module_app.command(context_settings={"ignore_unknown_options": True})  # or -1 would be taken for an option
@grouped_options
def jog(
    context: typer.Context,
    direction: Annotated[int, typer.Argument(help="1 clockwise, -1 counter-clockwise.")],
    *,
    seconds: Annotated[float, typer.Option(help="How long, s.")] = 0.5,
    duty: Annotated[float, typer.Option(help="Share of the supply voltage, up to 1.")] = 1.0,
    on_bus: BusOptions,
    json: Json = False,
) -> None:
    """Run for a time, a tool too; it also ends if this command is killed."""
    _moved(context, on_bus, json, lambda module, show: module.jog(direction, seconds, duty))


@module_app.command()
@grouped_options
def home(context: typer.Context, on_bus: BusOptions, json: Json = False) -> None:
    """Find the zero."""
    _moved(context, on_bus, json, lambda module, show: module.home(progress=show))


def _moved(context: typer.Context, on_bus: BusOptions, json: bool, act: Any) -> None:
    with _moving(context, on_bus) as module:
        unit = module.description.unit
        with _position(f"module {context.obj}", unit) as show:
            reached = act(module, show)
    turns = unit == "rev/min"
    if json:
        print_json({"speed" if turns else "position": reached, "unit": unit})
    else:
        typer.echo(f"{'turned at' if turns else 'stands at'} {reached:g} {unit}")


@contextmanager
def _position(name: str, unit: str) -> Iterator[Any]:
    """What shows where a module stands on its way, and for how long it has been moving: a line on a terminal."""
    if not sys.stderr.isatty():
        yield lambda position: None
        return
    from time import monotonic

    from rich.console import Console
    from rich.status import Status

    began = monotonic()
    with Status(f"{name} moves", console=Console(stderr=True)) as status:
        yield lambda at: status.update(f"{name} moves: at {at:.1f} {unit} after {monotonic() - began:.0f} s")


@module_app.command()
@grouped_options
def stop(context: typer.Context, on_bus: BusOptions, json: Json = False) -> None:
    """Zero volts now."""
    with _module(context, on_bus) as module:
        module.stop()
    print_json({"stopped": context.obj}) if json else typer.echo("stopped")


@module_app.command()
@grouped_options
def switch(context: typer.Context, on_bus: BusOptions, json: Json = False) -> None:
    """Turn the motion under way round, from a second terminal: what is left of the way, the other way."""
    with _module(context, on_bus) as module:
        module.switch_direction()
    print_json({"switched": context.obj}) if json else typer.echo("switched its direction")


@module_app.command()
@grouped_options
def reset(context: typer.Context, on_bus: BusOptions, json: Json = False) -> None:
    """Release the latch of the emergency stop."""
    with _module(context, on_bus) as module:
        module.reset_emergency()
    print_json({"reset": context.obj}) if json else typer.echo("emergency stop reset")


@module_app.command()
@writes_files
def step(
    context: typer.Context,
    *,
    by: Annotated[float, typer.Option(help="Step of the set point, mm or degrees.")] = 5.0,
    period: Annotated[float, typer.Option(help="Time between two samples, s; a multiple of 0.01.")] = 0.01,
    settled: Annotated[
        float,
        typer.Option(help="End when it has stood still for so long, s; 0: when the module gives up (3 s) or is there."),
    ] = 1.0,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder for the record and its plot; default: a new one, step-1..."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace what is in the folder of --out.")] = False,
    on_bus: BusOptions,
    json: Json = False,
) -> None:
    """Step the set point, record the response and plot it; tell its rise time, overshoot, settling and error."""
    with _moving(context, on_bus) as module, progress_bars() as bar:
        folder = folder_for(out, force)
        result = module.step(by, period, settled=settled, progress=bar(f"step by {by:g}"))
        bar("save")
        from rds.bus.modules.oacs.tuning import quality
        from rds.core.atomic import write_whole
        from rds.panels.design.step_plot import plot
        from rds.results.files import save_all

        files = {kind: str(path) for kind, path in save_all(result, folder).items()}
        files["plot"] = str(write_whole(folder / "step.png", plot(result).png()))
    found = quality(result, result.axes[0])
    unit = result.units[f"{result.axes[0]}_measured"]
    if json:
        response = {**found._asdict(), "unit": unit}
        print_json(
            {"samples": len(result), "response": response, "notes": result.meta.get("notes", []), "files": files}
        )
    else:
        typer.echo(f"{len(result)} samples in {folder}")
        typer.echo(found.words(unit))
        for note in result.meta.get("notes", []):
            typer.echo(f"note: {note}")


def folder_for(out: Path | None, force: bool) -> Path:
    """Where a record goes, looked at before anything moves: a new folder, or the one asked for if nothing is there."""
    if out is None:
        if force:
            raise _refused("--force replaces what is in the folder of --out, which is not given")
        from rds.results.files import new_folder

        return new_folder(".", "step")
    if not force and out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise _refused(f"{out}: something is there already; choose another folder, or replace it with --force")
    return out


_SIDES = ("mounted_by", "carries_on")  # of a module, to its neighbours


def show_info(found: Mapping[str, Any]) -> None:
    """The download and the tuning, as `module.info().as_dict()` has them."""
    from rds.cli.console import cell, show_table

    unit = found["unit"]
    units = dict.fromkeys(("accuracy", "repeatability", "lowest", "highest", "initial"), unit)
    units |= {"counts_per_unit": f"counts/({unit})" if "/" in unit else f"counts/{unit}", "supply": "V"}
    speed = unit if unit == "rev/min" else f"{unit}/min"
    units |= dict.fromkeys(("least_speed", "clockwise_speed", "counterclockwise_speed"), speed)
    left = {"number", "unit", "matrix", "tuning"}
    sides = {side: "{gender} {kind} {size:g} mm".format(**found[side]) for side in _SIDES if found.get(side)}
    rows = [
        [name.replace("_", " "), cell("–" if value in ("", None) else value), units.get(name, "")]
        for name, value in {**found, **sides}.items()
        if name not in left
    ]
    show_table(f"Module {found['number']}", ["what", "value", "unit"], rows)
    matrix = [[cell(value) for value in row] for row in found["matrix"]]
    moved = {"": "nothing moves it", **{j: f"the axis shifts along {j}" for j in "xyz"}}
    moved |= {j: f"the axis turns about {about}" for j, about in zip("abc", "xyz", strict=True)}
    note = f"From one interface to the next with the axis at zero; {moved[found['joint']]}."
    show_table("Transformation matrix", ["x", "y", "z", "shift [mm]"], matrix, note)
    show_tuning(found["tuning"])


def show_tuning(values: Mapping[str, Any]) -> None:
    """The tuning in force, by name."""
    from rds.cli.console import cell, show_table

    rows = [[name, cell(value), *MEANINGS.get(name, ("", ""))] for name, value in values.items()]
    show_table("Tuning", ["parameter", "value", "unit", "meaning"], rows)
