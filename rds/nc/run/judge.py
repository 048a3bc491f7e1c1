"""What was measured of a program's run, against the program: where each axis follows worst, and the contour error."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from rds.core.shared_quantities import TIED_FEED
from rds.interpolators.motion.planner import TOLERANCE
from rds.interpolators.motion.segments import AXES, BLEND, JOINTS
from rds.modes.loop.execution import State
from rds.modes.loop.program import InterpolatedProgram
from rds.nc.run.contour import contour_error
from rds.nc.run.prepare import Prepared
from rds.results import Result
from rds.results.metrics import moving

WAITS = {
    State.HELD: "held_s",
    State.STOP: "stops_s",
    State.TOOL: "tool_changes_s",
    State.SPINDLE: "spindle_s",
    State.HOME: "homing_s",
}
_LINEAR = AXES[:3]
_DISAGREEMENT = 0.2  # of velocities and positions, of the way: well above what a corner makes
_SAMPLES, _JUMP = 50, 0.01  # over which they are compared; mm: positions in whole BLU go by jumps, or stand


def judged(result: Result, prepared: Prepared) -> Result:
    """The result with the column `contour_error` (mm; 0 on the way home) and with `meta["program"]`."""
    state = result["program_state"].astype(int)
    is_reference = bool(prepared.about)  # then the commanded path is a subject of its own
    prepared = located(result, prepared)
    error = contour(result, prepared, state)
    line = result["program_line"].astype(int)  # that it was at, as in `worst_lines`
    columns = dict(result.columns)
    units = dict(result.units)
    columns["contour_error"], units["contour_error"] = error, "mm"
    if is_reference:
        columns["path_error"], units["path_error"] = contour(result, prepared, state, "reference"), "mm"
    moves = moving(result)
    on_path = moves & (state != State.HOME)
    linear = any(name in _LINEAR for name in prepared.program.axes)

    def worst(values: np.ndarray, line: np.ndarray, where: np.ndarray, unit: str) -> dict[str, Any] | None:
        return _worst(values[where], line[where], result["time"][where], unit) if where.any() else None

    about = {
        "file": prepared.file.name,
        **_times(result, prepared, state),
        "certificate": prepared.certificate.to_dict() if prepared.certificate else None,
        "waiting_samples": len(result) - int(moves.sum()),
        "limit_shares": _limit_shares(result, prepared),
        "contour_error": worst(error, line, on_path, "mm") if len(prepared.path) and linear else None,
        **({"path_error": worst(columns["path_error"], line, on_path, "mm")} if is_reference and linear else {}),
        **prepared.about,
        **({"outputs": list(prepared.outputs)} if prepared.outputs else {}),
        **({"begun_at_line": prepared.begin} if prepared.begin else {}),
        "own_feed": any(event.kind == "override" and event.value == TIED_FEED for event in prepared.events),
        **_force(result, worst, moves),
        "following_error": {
            name: found
            for name in prepared.program.axes
            if (
                found := worst(
                    np.abs(result[f"{name}_reference"] - result[f"{name}_measured"]),
                    line,
                    moves,
                    result.units[f"{name}_measured"],
                )
            )
        },
    }
    notes = [*result.meta.get("notes", []), *prepared.notes, *_disagreement(result, prepared)]
    meta = result.meta | {"program": about, "notes": notes}
    return Result(columns, units, meta)


def _force(result: Result, worst: Callable[..., Any], where: np.ndarray) -> dict[str, Any]:
    """The largest cutting force that the load cell measured, of a run that has one."""
    if "cutting_force" not in result:
        return {}
    return {"cutting_force": worst(result["cutting_force"], result["program_line"].astype(int), where, "N")}


def worst_lines(result: Result, column: np.ndarray, count: int = 5) -> list[tuple[int, float, float]]:
    """The program lines with the largest values of a column: line, value and when it was, s."""
    line, moves = result["program_line"].astype(int), moving(result)
    found = []
    for number in np.unique(line[moves]):
        here = np.flatnonzero((line == number) & moves)
        worst = here[np.argmax(column[here])]
        found.append((int(number), float(column[worst]), float(result["time"][worst])))
    return sorted(found, key=lambda entry: -entry[1])[:count]


def located(result: Result | Mapping[str, np.ndarray], prepared: Prepared) -> Prepared:
    """`prepared` with the segment of each sample, which of an interpolator's only the run's own rows tell."""
    if not isinstance(prepared.program, InterpolatedProgram):
        return prepared
    sample = np.ceil(result["program_sample"]).astype(int)
    segment = np.zeros(int(sample.max(initial=0)) + 1, dtype=int)
    segment[sample] = result["program_segment"].astype(int) - 1
    return replace(prepared, segment=np.maximum.accumulate(segment))  # samples that were passed over


def contour(
    result: Result | Mapping[str, np.ndarray], prepared: Prepared, state: np.ndarray, of: str = "measured"
) -> np.ndarray:
    """Distance (mm) of each measured position to the path.

    `of` "reference": of each commanded position. `result` may be some of a run's rows, as columns; `state` is its
    `program_state`, as integers.
    """
    path, axes = prepared.path, prepared.program.axes
    error = np.zeros(len(state))
    if not len(path):
        return error
    points, wanted = np.zeros((len(state), 6)), np.zeros((len(state), 6))
    for i, name in enumerate(AXES):
        if name in axes:
            points[:, i], wanted[:, i] = result[f"{name}_{of}"], result[f"{name}_reference"]
        else:
            points[:, i] = wanted[:, i] = path["start"][0, i]
    row = np.clip(np.ceil(result["program_sample"]).astype(int), 0, len(prepared.segment) - 1)
    blended = path["mode"] == BLEND
    given = path["tolerance"][blended]
    corner = float(np.where(np.isfinite(given), given, TOLERANCE).max(initial=0.0))
    segment = prepared.segment[row]
    for_tip = path["tip"][segment] != JOINTS

    def measure(some: np.ndarray, here: np.ndarray, there: np.ndarray, along: np.ndarray) -> None:
        reach = np.linalg.norm(here - there, axis=1) + corner + 1e-3
        error[some], _ = contour_error(here, along, segment[some], reach)

    some = (state != State.HOME) & ~for_tip
    measure(some, points[some, :3], wanted[some, :3], path)
    some = (state != State.HOME) & for_tip
    if prepared.tip is not None and some.any():
        corner += TOLERANCE
        length = path["tool_length"][segment[some]]
        here, there = (prepared.tip.tip.places(each[some], length)[0] for each in (points, wanted))
        measure(some, here, there, prepared.tip.path)
    return error


def _times(result: Result, prepared: Prepared, state: np.ndarray) -> dict[str, Any]:
    """Predicted and executed seconds, and what was waited for."""
    # samples that were discarded belong to the state of the one after them
    spent = np.diff(np.rint(result["time"] / prepared.T).astype(np.int64), prepend=-1)
    waited = {name: int(spent[state == kind].sum()) for kind, name in WAITS.items()}
    moving = int(spent.sum()) - sum(waited.values())
    return {
        "predicted_samples": prepared.program.samples,
        "moving_samples": moving,
        "predicted_s": prepared.seconds,
        "executed_s": int(spent.sum()) * prepared.T,
        "moving_s": moving * prepared.T,
        **{name: samples * prepared.T for name, samples in waited.items()},
        "last_line": int(result["program_line"][-1]),
        "completed": result.meta.get("ending") == "done",
        "done_percent": _share_done(result, prepared),
    }


def _share_done(result: Result, prepared: Prepared) -> float:
    """Per cent of the program's samples; of an interpolator's, how many there are is known in the end only."""
    if isinstance(prepared.program, InterpolatedProgram) and result.meta.get("ending") == "done":
        return 100.0
    return 100.0 * min(float(result["program_sample"].max() + 1.0) / prepared.program.samples, 1.0)


def _limit_shares(result: Result, prepared: Prepared) -> dict[str, dict[str, float]]:
    """Of each axis the largest velocity, acceleration and jerk that was sent, by differences, over its limit.

    The axes stand before the first sample, and after the last one of a path that was gone to its end. Where samples
    were discarded there are no differences.
    """
    program, T = prepared.program, prepared.T
    rest = (3, 3 if result.meta.get("ending") == "done" else 0)  # samples at rest before and after
    whole = np.pad(np.diff(np.rint(result["time"] / T)) == 1, rest, constant_values=True)
    shares: dict[str, dict[str, float]] = {name: {} for name in program.axes}
    for order, kind in enumerate(("velocity", "acceleration", "jerk"), 1):
        known = np.ones(max(len(result) + sum(rest) - order, 0), dtype=bool)
        for i in range(order):
            known &= whole[i : i + len(known)]
        for name, limit in zip(program.axes, program.limits[order - 1], strict=True):
            sent = np.abs(np.diff(np.pad(result[f"{name}_reference"], rest, "edge"), order))[known] / T**order
            shares[name][kind] = float(sent.max(initial=0.0) / limit)
    return shares


def _disagreement(result: Result, prepared: Prepared) -> list[str]:
    """A note where an interpolator's velocities are not those of its positions: laws feed them forward."""
    if not isinstance(prepared.program, InterpolatedProgram):
        return []
    follows = np.diff(np.rint(result["time"] / prepared.T)) == 1  # no sample is missing before it
    parts = np.arange(0, int(follows.sum()), _SAMPLES)
    if not len(parts):
        return []
    for name in prepared.program.axes:
        steps = np.diff(result[f"{name}_reference"])[follows]
        told = result[f"{name}_reference_velocity"][1:][follows] * prepared.T
        off = np.abs(np.add.reduceat(told - steps, parts))
        share = float(off[off > _JUMP].sum() / max(np.abs(steps).sum(), _JUMP))
        if share > _DISAGREEMENT:
            return [
                f"The velocities of the interpolator {prepared.about['interpolator']} differ from the change of its "
                f"positions, of {name} by {share:.0%} on average: a controller that feeds velocity forward pushes the "
                "wrong way. Let it yield (position, velocity, acceleration) in mm, mm/s and mm/s²."
            ]
    return []


def _worst(values: np.ndarray, line: np.ndarray, time: np.ndarray, unit: str) -> dict[str, Any]:
    at = int(np.argmax(values))
    return {
        "unit": unit,
        "max": float(values[at]),
        "line": int(line[at]),
        "time_s": float(time[at]),
        "rms": float(np.sqrt(np.mean(values**2))),
        "mean": float(np.mean(values)),
    }
