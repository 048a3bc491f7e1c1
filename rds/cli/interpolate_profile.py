"""`rds interpolate FILE --profile P`: a part program's motion by a profile, its certificate, table and pictures."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, NoReturn

import numpy as np
import typer

from rds.cli.common import print_json, progress_bars
from rds.core.errors import InputError

if TYPE_CHECKING:
    from rds.core.figure import Picture
    from rds.interpolators.motion.certificate import Certificate
    from rds.interpolators.motion.samples import SampleBlock
    from rds.nc.setup import Setup
    from rds.results import Result

MOST = 2_000_000  # samples, which are held in memory


def follow(
    profile: str, file: Path, machine: str, T: float, setup: Setup, *, folder: Path | None, plot: bool, json: bool
) -> NoReturn:
    """Sample, save and show. Ends the command: exit code 1 where a promise of the profile is not kept."""
    from rds.interpolators.motion.limits import Limits
    from rds.interpolators.motion.profiles import motion_of
    from rds.machines import load_machine
    from rds.nc.check import motion

    loaded = load_machine(machine)
    limits = Limits.of(loaded)
    notes: list[str] = []
    with progress_bars() as bar:
        samples, certificate = motion_of(
            profile, motion(file, loaded, setup, bar("plan"), notes), limits, T, start=np.zeros(6)
        )
        blocks = _gathered(samples, T)
    axes = [k for k in range(6) if limits.present[k]]
    result = _result(blocks, axes, T, {"profile": profile, "certificate": certificate.to_dict()})
    files = _save(result, certificate, folder, plot) if folder is not None else []
    resting = _resting(blocks)
    about = {
        "profile": profile,
        "sample_period_s": T,
        "samples": certificate.samples - 1,
        "time_s": (certificate.samples - 1) * T,
        "dwell_s": resting,
        "certificate": certificate.to_dict(),
    }
    if json:
        print_json({**about, "notes": notes, "files": [str(path) for path in files]})
    else:
        _show(file, about, certificate, files)
        for note in notes:
            typer.echo(f"note: {note}")
    raise typer.Exit(0 if certificate.ok else 1)


def _gathered(samples: Any, T: float) -> list[SampleBlock]:
    blocks, count = [], 0
    for block in samples:
        blocks.append(block)
        count += len(block)
        if count > MOST:
            raise InputError(
                f"the program takes more than {MOST} samples of {T:g} s, which are held in memory; give a longer "
                "--period, or `rds nc time --profile`, which keeps none"
            )
    if not blocks:
        raise InputError("the program moves nothing and waits for nothing; there is nothing to interpolate")
    return blocks


def _resting(blocks: list[SampleBlock]) -> float:
    """s of all dwells."""
    return float(sum(event.value for block in blocks for _, event in block.events if event.kind == "dwell"))


def _result(blocks: list[SampleBlock], axes: list[int], T: float, about: dict[str, Any]) -> Result:
    """The samples as a table with units."""
    from rds.interpolators.motion.segments import AXES
    from rds.results import Result

    position, velocity, acceleration = (
        np.concatenate([getattr(block, name) for block in blocks]) for name in ("position", "velocity", "acceleration")
    )
    columns: dict[str, np.ndarray] = {"time": np.arange(len(position)) * T}
    columns["line"] = np.concatenate([block.line for block in blocks])
    units = {"line": ""}
    for k in axes:
        unit = "mm" if k < 3 else "degrees"
        for name, values, suffix in (
            ("reference", position, ""),
            ("reference_velocity", velocity, "/s"),
            ("reference_acceleration", acceleration, "/s²"),
        ):
            columns[f"{AXES[k]}_{name}"] = values[:, k]
            units[f"{AXES[k]}_{name}"] = unit + suffix
    names = [AXES[k] for k in axes]
    return Result(columns, units, {"axes": names, "sample_period": T, "mode": "interpolation", "interpolation": about})


def _save(result: Result, certificate: Certificate, folder: Path, plot: bool) -> list[Path]:
    from rds.core.atomic import write_files

    files = [result.save(folder / "interpolation.csv")]
    if plot:
        drawn: dict[str, Picture] = {"motion": _motion(result), "certificate": certificate.plot()}
        pictures = {folder / f"{name}.png": picture.png() for name, picture in drawn.items()}
        write_files({path: partial(_write, png) for path, png in pictures.items()})
        files += pictures
    return files


def _write(data: bytes, stream: BinaryIO) -> None:
    stream.write(data)


def _motion(result: Result) -> Picture:
    """Position, velocity and acceleration of each axis over time."""
    from rds.interpolators.plots import over_time

    names = result.meta["axes"]
    kinds = ("reference", "reference_velocity", "reference_acceleration")
    columns = [np.column_stack([result[f"{axis}_{kind}"] for axis in names]) for kind in kinds]
    return over_time(result["time"], names, *columns)


def _show(file: Path, about: dict[str, Any], certificate: Certificate, files: list[Path]) -> None:
    from rds.cli.console import show_table

    rows = [
        ("samples", str(about["samples"]), ""),
        ("time", f"{about['time_s']:.6g}", "s"),
        ("of it dwells", f"{about['dwell_s']:g}", "s"),
    ]
    units = {"velocity": "mm/s", "acceleration": "mm/s²", "jerk": "mm/s³"}
    for (kind, axis), worst in certificate.worst.items():
        if axis and worst.value:
            unit = units[kind] if axis in "XYZ" else units[kind].replace("mm", "degrees")
            said = f"{worst.value:.6g} ({100.0 * worst.share:.1f} %, line {worst.line})"
            rows.append((f"largest {kind} {axis}, of its limit", said, unit))
    title = f"{file}: profile {about['profile']}, a sample every {1000.0 * about['sample_period_s']:g} ms"
    show_table(title, ("quantity", "value", "unit"), rows)
    typer.echo(certificate.sentence())
    for path in files:
        typer.echo(f"wrote {path}")
