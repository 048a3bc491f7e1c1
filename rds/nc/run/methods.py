"""Interpolators beside each other on one machine: what each commands, what the axes make of it, and what it costs.

The seeds of this comparison are the tables of the reference word methods (mini-cnc-rds, oacs-thesis 7): here every
method leads the simulated axes of a machine in the loop, under one controller.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.errors import ContractError, InputError
from rds.core.progress import Progress
from rds.interpolators import LIBRARY
from rds.interpolators.segment_rows import read_segments
from rds.machines import Machine, load_machine
from rds.modes import SIMULATION
from rds.modes.experiment import Experiment
from rds.modes.loop.execution import State
from rds.modes.loop.program import InterpolatedProgram
from rds.nc.language.dialect import Dialect
from rds.nc.run.path import SUFFIX
from rds.nc.run.run import usual_controller
from rds.nc.setup import Setup
from rds.results import Result
from rds.results.reports.content import Report, Table

if TYPE_CHECKING:
    from rds.core.figure import Picture

KIND = "interpolators"
COLUMNS = (
    "interpolator",
    "contour error, max [µm]",
    "contour error, RMS [µm]",
    "path error, max [µm]",
    "feed ripple [%]",
    "jerk, max [mm/s³]",
    "compute, median [µs]",
    "compute, 99 % [µs]",
    "time [s]",
)
_DIGITS = dict.fromkeys(COLUMNS[1:4], 3) | {"feed ripple [%]": 2, "jerk, max [mm/s³]": 0}
_DIGITS |= {"compute, median [µs]": 1, "compute, 99 % [µs]": 1, "time [s]": 3}
_NOTE = (
    "Contour error: of the measured position from the programmed path; path error: of the commanded one. Feed ripple: "
    "the largest deviation of the commanded speed from the programmed feed, at least a sample and the filter's length "
    "from where a segment begins or ends. Jerk: third differences of the commanded positions, of the worst axis; the "
    "jump to the feed from rest, and back, which a method without a filter makes, is not in it. Compute: "
    "time of the interpolator for one row, here and now."
)


@dataclass(frozen=True)
class MethodComparison:
    """The numbers of one method, in the order of `COLUMNS`, or why it was refused."""

    name: str
    numbers: tuple[float, ...] = ()
    refused: str = ""


def compare_methods(
    file: str | Path,
    own: Sequence[str | Path] = (),
    *,
    machine: str = "mini-cnc",
    controller: Any = None,
    acceleration: Any = None,
    sample_period: float | None = None,
    as_built: bool = True,
    setup: Setup | Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> list[MethodComparison]:
    """Every method of the library, and the users' files `own`, along the path (or part program) in `file`, simulated.

    The axes are those behind the bus, with friction, play and the loop's sample of delay; without `as_built`, the
    machine's model that controllers are designed for. Without `controller`, they have the law of part programs.
    `setup`: what a part program is read with.
    A method that refuses a segment of the path (`circular` a line) says so in `refused`. InputError for what is wrong
    with the path, the machine or the words; ContractError for an own interpolator that breaks its interface.
    """
    path = Path(file)
    if not path.is_file():
        raise InputError("there is no such path or part program; check the name and the folder", str(file))
    axes = list("XYZ") if path.suffix != SUFFIX else list("XYZ")[: len(read_segments(path)[0].start)]
    names = [*LIBRARY.names(), *map(str, own)]
    read_with = _words_of(Setup.of(setup))
    if read_with and path.suffix == SUFFIX:
        raise InputError("tools, parameters and options of the dialect are of part programs; leave them out", str(file))
    loaded = load_machine(machine)
    controller = usual_controller(loaded) if controller is None else controller
    of_axes = _as_built(loaded, axes, sample_period) if as_built else {}
    found = []
    for number, name in enumerate(names):
        if progress is not None:
            progress(number, len(names))
        words: dict[str, Any] = {"kind": "path", "file": str(path.resolve()), "interpolator": name}
        words |= {"setup": read_with} if read_with else {}
        table: dict[str, Any] = {"machine": machine, "axes": axes, "controller": controller} | of_axes
        table["reference"] = words | ({} if acceleration is None else {"acceleration": acceleration})
        if sample_period is not None:
            table["sample_period"] = sample_period
        try:
            experiment = Experiment.from_table(table)
            result = experiment.run(SIMULATION)
        except (ContractError, InputError) as error:  # before the run, or at the segment that it does not take
            if name not in LIBRARY.modules or name == LIBRARY.names()[0]:  # which takes every path
                raise
            found.append(MethodComparison(name, refused=str(error)))
            continue
        program = experiment.plan().program
        assert isinstance(program, InterpolatedProgram)
        found.append(MethodComparison(Path(name).name, _numbers(result, program, result.meta["sample_period"])))
    if progress is not None:
        progress(len(names), len(names))
    return found


def _words_of(setup: Setup) -> dict[str, Any]:
    """The setup as the table of an experiment, with what differs from its defaults."""
    files = {"tools": setup.tools, "parameters": setup.parameters}
    words: dict[str, Any] = {name: str(file.resolve()) for name, file in files.items() if file is not None}
    words |= {"correct": True} if setup.correct else {}
    usual = Dialect()._asdict()
    return words | {name: value for name, value in setup.options._asdict().items() if value != usual[name]}


def _as_built(machine: Machine, axes: Sequence[str], sample_period: float | None) -> dict[str, Any]:
    """The words that put the machine's own axes in the place of their models, as far as its file tells them."""
    T = sample_period or machine.sample_period
    own = {name: machine.axis(name).machine for name in axes}
    return {
        "axis": {
            name: {"model": {"name": "machine-axis", **behind, "delay": behind.get("delay", 0.0) + T}}
            for name, behind in own.items()
            if behind
        }
    }


def _numbers(result: Result, program: InterpolatedProgram, T: float) -> tuple[float, ...]:
    error, commanded = result["contour_error"] * 1e3, result["path_error"] * 1e3
    way = np.column_stack([result[f"{name}_reference"] for name in program.axes])
    jerk = np.abs(np.diff(way, 3, axis=0)).max(initial=0.0) / T**3
    took = np.array(_times(program)) * 1e6
    return (
        float(error.max()),
        float(np.sqrt(np.mean(error**2))),
        float(commanded.max()),
        _ripple(result, program, way, T),
        float(jerk),
        float(np.median(took)),
        float(np.percentile(took, 99)),
        len(result) * T,
    )


def _ripple(result: Result, program: InterpolatedProgram, way: np.ndarray, T: float) -> float:
    """Per cent of the programmed feed that the commanded speed is off it, away from where a segment begins or ends."""
    speed = np.linalg.norm(np.diff(way, axis=0), axis=1) / T
    segment = result["program_segment"].astype(int)[1:]
    runs = result["program_state"].astype(int)[1:] == State.RUNS
    edge = len(getattr(program.stretches[0].rows, "weights", (1,)))  # of the filter
    borders = np.flatnonzero(np.diff(segment, prepend=segment[0] - 1, append=segment[-1] + 1))
    near = np.zeros(len(speed), bool)
    for border in borders:
        near[max(border - edge - 1, 0) : border + edge + 1] = True
    inside = runs & ~near
    if not inside.any():
        return float("nan")
    feed = program.path["rate"][segment[inside] - 1]
    return float(100.0 * np.max(np.abs(speed[inside] - feed) / feed))


def _times(program: InterpolatedProgram) -> list[float]:
    """How long each row took to make, s, without the loop."""
    took = []
    for stretch in program.stretches:
        rows = stretch.rows()
        while True:
            before = perf_counter()
            row = next(rows, None)
            took.append(perf_counter() - before)
            if row is None:
                took.pop()
                break
    return took or [0.0]


def methods_report(compared: Sequence[MethodComparison], file: Path, settings: Mapping[str, Any]) -> Report:
    """The comparison as a table, one picture and sentences."""
    taken = [each for each in compared if each.numbers]
    rows = [(each.name, *each.numbers) for each in taken]
    refused = [f"{each.name} was refused: {each.refused}" for each in compared if each.refused]
    least = min(taken, key=lambda each: each.numbers[0])
    said = f"{least.name} keeps the axes nearest to the path: {least.numbers[0]:.3f} µm at most."
    return Report(
        kind=KIND,
        title=f"Interpolators along {file.name}",
        sources=[str(file)],
        settings=settings,
        tables=[Table("Interpolators", COLUMNS, rows, _NOTE, _DIGITS)],
        figures={"methods": lambda: _picture(rows)},
        findings=[said, *refused],
    )


def _picture(rows: Sequence[Sequence[Any]]) -> Picture:
    """Bars of each number by method: errors side by side, the others for themselves."""
    from rds.core.figure import BLUE, GREEN, ORANGE, PURPLE, SKY, Picture, dress

    names = [row[0] for row in rows]
    places = np.arange(len(names))
    picture = Picture(1.6 + 0.42 * len(names))
    errors, ripple, jerk, compute = picture.subplots(1, 4, sharey=True)
    errors.barh(places - 0.2, [row[1] for row in rows], 0.38, color=BLUE, label="measured")
    errors.barh(places + 0.2, [row[3] for row in rows], 0.38, color=ORANGE, hatch="//", label="commanded")
    errors.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False, fontsize="small")
    for axes, column, colour, label in (
        (ripple, 4, GREEN, "feed ripple [%]"),
        (jerk, 5, PURPLE, "jerk, max [mm/s³]"),
        (compute, 6, SKY, "compute, median [µs]"),
    ):
        axes.barh(places, [row[column] for row in rows], 0.6, color=colour)
        dress(axes, "", label)
    for axes, column in ((ripple, 4), (jerk, 5)):  # which differ by powers of ten
        axes.set_xscale("log")
        known = [row[column] for row in rows if row[column] > 0.0]
        axes.set_xlim(left=min(known, default=1.0) / 2.0)
    dress(errors, "", "error from the path, max [µm]")
    errors.set_yticks(places, names)
    errors.invert_yaxis()
    return picture
