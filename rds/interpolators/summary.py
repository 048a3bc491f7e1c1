"""An interpolation as numbers to read: what was made of the path, and what was promised of it."""

from __future__ import annotations

from rds.interpolators.result import Interpolation


def summary(done: Interpolation) -> tuple[str, list[tuple[str, str, str]]]:
    """A title, and rows of quantity, value and unit."""
    about = done.to_json()
    title = (
        f"{about['method'] if isinstance(about['method'], str) else ' and '.join(about['method'])}"
        f"{', ' + about['acceleration'] + ' acceleration' if about['acceleration'] else ''}: "
        f"{about['segments']} segment{'s' if about['segments'] > 1 else ''}, a sample every {1000 * done.T:g} ms"
    )
    rows = [
        ("samples", str(done.samples), ""),
        ("time", f"{done.duration:.6g}", "s"),
        ("programmed length", f"{done.programmed_length:.4f}", "mm"),
        ("length", f"{done.length:.4f}", "mm"),
        ("largest distance from the path, samples", f"{about['path_error_mm']:.6f}", "mm"),
        ("largest distance from the path, between them", f"{about['chord_error_mm']:.6f}", "mm"),
    ]
    return title, [*rows, *_steps(done), *_pulses(done), *_largest(done)]


def _steps(done: Interpolation) -> list[tuple[str, str, str]]:
    worst = done.worst_steps
    if worst is None:
        return []
    least = [("fewest steps within one BLU", str(worst.least), "")] if worst.least is not None else []
    return [
        *least,
        ("steps of the arc" if len(done.segments) == 1 else "steps of the worst arc", str(worst.count), ""),
        ("steps by the formula", f"{worst.formula:.2f}", ""),
        ("radial error", f"{worst.radial_error:.6f}", "mm"),
        ("chord height error", f"{worst.chord_error:.6f}", "mm"),
        (f"within one BLU of {worst.blu:g} mm", "yes" if worst.within else "NO", ""),
    ]


def _pulses(done: Interpolation) -> list[tuple[str, str, str]]:
    error = done.to_json()["generation_error_mm"]
    if error is None:
        return []
    return [
        ("commanded minus theoretical, largest", f"{error:.6f}", "mm"),
        (f"within one BLU of {done.blu:g} mm", "yes" if done.within else "NO", ""),
    ]


def _largest(done: Interpolation) -> list[tuple[str, str, str]]:
    about, rows = done.to_json(), []
    for name, key, unit in (("velocity", "velocity_mm_s", "mm/s"), ("acceleration", "acceleration_mm_s2", "mm/s²")):
        rows += [(f"largest {name} {axis}", f"{value:.6g}", unit) for axis, value in about[f"largest_{key}"].items()]
    return rows
