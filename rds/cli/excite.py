"""`rds excite`: which voltage tells an axis's parameters best, as an experiment to run in system-test mode."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rds.cli.common import Json, print_json, progress_bars, refusals, stdout_kept, writes_files

if TYPE_CHECKING:
    from rds.identification.fit.excitation import Design, Prediction, Task
    from rds.machines.machine import Machine

_MARK = "Designed by `rds excite`"  # how the experiment's file begins


@writes_files
def excite(
    machine: Annotated[str, typer.Argument(help="A machine's name, or its TOML file.")],
    axis: Annotated[str | None, typer.Option(help="The axis; by default the machine's first.")] = None,
    duration: Annotated[float, typer.Option(help="Length of the test, s.")] = 10.0,
    noise: Annotated[
        float, typer.Option(help="Standard deviation of noise beside the encoder's rounding, mm (rev/min).")
    ] = 0.0,
    model: Annotated[
        Path | None, typer.Option(help="Design for this fitted model file; by default for the machine's own model.")
    ] = None,
    kind: Annotated[list[str] | None, typer.Option(help="Only signals of this kind; repeatable.")] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Write the experiment here (.toml).")] = None,
    plot: Annotated[Path | None, typer.Option(help="Write a picture here (.png).")] = None,
    json: Json = False,
) -> None:
    """Find the voltage, within travel and voltage, that tells time constant, gain and friction best."""
    with refusals(), stdout_kept(json):
        from rds.core.atomic import keep_another, write_files
        from rds.core.errors import InputError
        from rds.identification.fit.excitation import KINDS, design
        from rds.machines import load_machine

        for path, suffix in ((out, ".toml"), (plot, ".png")):
            if path is not None and path.suffix != suffix:
                raise InputError(f"give it a name that ends in {suffix}", str(path))
        if out is not None:
            keep_another(out, _MARK, "experiment of `rds excite`")
        loaded = load_machine(machine)
        task = _task(loaded, axis or next(iter(loaded.axes)), model, duration, noise)
        with progress_bars() as bar:
            found = design(task, kind or KINDS, bar("trying signals"))
        files: dict[Path, bytes] = {}
        if out is not None:
            files[out] = _experiment(found, machine).encode()
        if plot is not None:
            from rds.identification.fit.excitation_plot import excitation_picture

            files[plot] = excitation_picture(found).png()
        write_files(files)
    if json:
        print_json(_json(found) | {"files": [str(path) for path in files]})
        return
    _show(found)
    for path in files:
        typer.echo(f"{'experiment' if path == out else 'picture'}: {path}")


def _task(machine: Machine, axis: str, model: Path | None, duration: float, noise: float) -> Task:
    from rds.core.errors import InputError
    from rds.identification.fit.excitation import make_task
    from rds.identification.structures.structures import structure

    table = dict(machine.axis(axis).model)
    if model is not None:
        from rds.identification.fit.model_file import read_model

        read = read_model(model)
        for sentence in read.doubts():
            typer.echo(f"warning: {model}: {sentence}", err=True)
        made = structure(read.structure, read.options, read.output_unit, read.command_unit)
        if made.command_unit != "V" or (made.is_rate and read.structure != "spindle"):
            what = "no position" if made.is_rate else f"a command in {made.command_unit}"
            raise InputError(f"it is a model with {what}, and a voltage is designed for an axis's position", str(model))
        values = read.values()
        for name in made.parameters:
            if name not in values:
                raise InputError(f"it has no {name}, which structure {made.name} needs", str(model))
    else:
        name = table.pop("name", None)
        known = {"linear-axis": "axis", "spindle": "spindle"}
        if name not in known:
            raise InputError(
                f"axis {axis} has no [axis.{axis}.model] to design for; say what is assumed with --model FILE.toml",
                machine.path,
            )
        made = structure(known[name], (), machine.axis(axis).unit)
        values = {parameter: float(table.get(parameter, 0.0)) for parameter in made.parameters}
    return make_task(machine, axis, made, values, duration, noise)


def _experiment(found: Design, machine: str) -> str:
    """The experiment in system-test mode with the best signal."""
    from rds.core.toml_text import toml_text
    from rds.modes import SYSTEM_TEST

    task, best = found.task, found.best
    errors = ", ".join(f"{name} {value:.2g} %" for name, value in best.percent.items())
    place = str(Path(machine).resolve()) if machine.endswith(".toml") else machine
    table = {
        "title": f"Excitation of {task.axis.name}: {best.signal.kind}",
        "machine": place,
        "axis": task.axis.name,
        "mode": SYSTEM_TEST,
        "duration": task.duration,
        "signal": best.table,
    }
    return toml_text(
        table,
        f"{_MARK} for what is known of {task.axis.name}. Standard errors predicted for a fit of the "
        f"free run:\n{errors}; from rest at 0 it uses {_span(best, task)}.",
    )


def _span(prediction: Prediction, task: Task) -> str:
    low, high = prediction.travel
    return f"{low:.4g} to {high:.4g} {task.axis.unit}"


def _json(found: Design) -> dict[str, Any]:
    from math import isfinite

    def told(prediction: Prediction) -> dict[str, Any]:
        return {
            "signal": prediction.table,
            "std_errors": dict(prediction.std_errors),
            "std_errors_percent": dict(prediction.percent),
            "worst_percent": prediction.worst_percent,
            "mean_percent": prediction.mean_percent if isfinite(prediction.mean_percent) else None,
            "travel": list(prediction.travel),
            "peak_voltage": prediction.peak_voltage,
        }

    task = found.task
    return {
        "machine": task.machine.name,
        "axis": task.axis.name,
        "unit": task.axis.unit,
        "duration": task.duration,
        "sample_period": task.machine.sample_period,
        "noise": task.noise,
        "structure": task.structure.name,
        "assumed": dict(task.values),
        "tried": found.tried,
        "fitting": len(found.ranked),
        "best": told(found.best),
        "candidates": [told(prediction) for prediction in found.best_of_kinds()],
    }


def _show(found: Design) -> None:
    from rich.console import Console
    from rich.table import Table

    task = found.task
    title = f"Predicted standard errors [%] of {task.axis.name}, {task.duration:g} s, the best signal of each kind"
    table = Table(title=title, title_justify="left")
    table.add_column("signal", no_wrap=True)
    for name in (*task.parameters, "mean"):
        table.add_column(name.replace("_", " "), justify="right")
    table.add_column(f"travel [{task.axis.unit}]", justify="right")
    for prediction in found.best_of_kinds():
        numbers = [prediction.percent[name] for name in task.parameters] + [prediction.mean_percent]
        low, high = prediction.travel
        row = [f"{value:.2g}" for value in numbers]
        table.add_row(prediction.signal.kind, *row, f"{low:.3g} to {high:.3g}")
    Console().print(table)
    for prediction in found.best_of_kinds():
        words = [f"{key} {value:g}" for key, value in prediction.signal.settings.items() if _is_told(key, value)]
        typer.echo(f"{prediction.signal.kind}: {', '.join(words)}")
    assumed = ", ".join(f"{name} = {value:g} {task.structure.units[name]}" for name, value in task.values.items())
    typer.echo(
        f"{len(found.ranked)} of {found.tried} signals keep within travel and voltage. Assumed: {assumed}, noise of "
        f"{task.noise:.3g} {task.axis.unit}; for an axis that is as modelled. The first row is the one to take."
    )


def _is_told(key: str, value: Any) -> bool:
    return isinstance(value, int | float) and not (key in ("phase", "offset") and value == 0)
