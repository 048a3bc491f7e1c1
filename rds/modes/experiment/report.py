"""What a run of the command line leaves: files, a table on the screen, JSON, an exit code."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rds.core import drawing
from rds.core.atomic import write_whole
from rds.core.progress import Progress
from rds.core.types import Ending, Verdict
from rds.modes.experiment.experiment import Experiment
from rds.modes.experiment.experiment_file import PATHS
from rds.modes.experiment.folder import new_folder
from rds.modes.loop.program import InterpolatedProgram, Program
from rds.results import Result
from rds.results.files import saved_files
from rds.results.report import DRAWN_BY, Pictures, write_report

METRICS = ("mean_error", "std_error", "mean_abs_error", "std_abs_error", "max_abs_error", "rms_error", "fit_percent")
STAGE_FIGURES = ("p50", "p99", "p999", "max")


def run_and_save(
    path: Path, mode: str | None, out: Path | None, progress: Progress | None
) -> tuple[Result, dict[str, Path]]:
    """Run the experiment in the file `path`, and save tables, plots and a report in `out` (default: under runs/)."""
    experiment = Experiment.from_toml(path)
    folder = out if out is not None else folder_of(experiment, mode)
    result = experiment.run(mode, out=folder, progress=progress)
    return result, save_run(result, experiment.plan(mode).program, folder, experiment.title or path.stem)


def save_run(
    result: Result, program: Program | InterpolatedProgram | None, folder: Path, title: str
) -> dict[str, Path]:
    """Plots and reports beside the tables in `folder`, with those of a path (`program`); each path by its kind."""
    if program is None:
        return save_with_report(result, folder, title)
    files: dict[str, Path] = PATHS.module("path").save_path_run(result, program, folder, title)
    return files


def folder_of(experiment: Experiment, mode: str | None) -> Path:
    """Where its results go when nobody says."""
    plan = experiment.plan(mode)
    return new_folder(plan.names, plan.mode)


def save_with_report(
    result: Result,
    folder: Path,
    title: str,
    beside: Sequence[Path] = (),
    pictures: Callable[[], Pictures] | None = None,
) -> dict[str, Path]:
    """One plot per axis and the report, which also links what is `beside` it; each file's path by its kind.

    `pictures` are what `pictures_of` gave, if that was called before. The tables are in `folder` already: the run has
    saved them there before anything else could go wrong.
    """
    files = saved_files(folder)
    drawn = (pictures or pictures_of(result))()
    for axis, picture in drawn.axes.items():
        files[f"plot_{axis}"] = write_whole(folder / f"{axis}.png", picture)
    files["report"] = write_report(
        folder / "report.html",
        title,
        [result],
        files=[*beside, *files.values()],
        sections=_validations(result),
        pictures=[drawn.report],
    )
    return files


def pictures_of(result: Result) -> Callable[[], Pictures]:
    """Begin to draw a run's pictures, where another process can do it; the function waits for them."""
    return drawing.asked(DRAWN_BY, "pictures", result)


def _validations(result: Result) -> list[str]:
    """What the run proved of its models, as HTML: a section per axis."""
    if not result.validation:
        return []
    from rds.identification.validate.report import section

    return [section(f"Validation of the model of {axis}", found) for axis, found in result.validation.items()]


def run_json(result: Result, files: dict[str, Path]) -> dict[str, Any]:
    """The one JSON object of `rds run --json`."""
    timing = result.meta.get("timing")
    stages = {
        stage: {name: timing[stage][name] for name in STAGE_FIGURES}
        for stage in ("lateness", "io", "interpolate", "compute", "model")
        if timing and stage in timing
    }
    counts = {name: timing[name] for name in ("late", "longest_late_run", "discarded", "samples")} if timing else None
    return {
        "mode": result.mode,
        "verdict": result.verdict,
        "verdict_reason": result.meta.get("verdict_reason"),
        "verdict_evidence": result.meta.get("verdict_evidence"),
        "ending": result.meta.get("ending"),
        "axes": {
            axis: {name: values.get(name) for name in METRICS if name in values}
            for axis, values in result.metrics.items()
        },
        "timing": {**stages, **counts} if counts else None,
        **({"program": result.meta["program"]} if "program" in result.meta else {}),
        "validation": result.meta.get("validation"),
        "environment": result.meta.get("environment"),
        "notes": [*result.meta.get("notes", []), *result.notes],
        "files": {kind: str(path) for kind, path in files.items()},
    }


def exit_code(result: Result) -> int:
    """0 for a run that is done and in time (or void: that says nothing against it), else 1."""
    done = result.meta.get("ending") == Ending.DONE
    return 0 if done and result.verdict != Verdict.MISSED else 1
