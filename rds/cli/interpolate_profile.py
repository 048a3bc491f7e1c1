"""`rds interpolate FILE --profile P`: a part program's motion by a profile, its certificate, table and pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

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

_LINEAR = ("X", "Y", "Z")
_CHORDS = 20  # for each rad of an arc that is drawn
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
    files = _save(result, certificate, blocks, folder, plot) if folder is not None else []
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


def _save(result: Result, certificate: Certificate, blocks: list[SampleBlock], folder: Path, plot: bool) -> list[Path]:
    from rds.core.atomic import write_files

    files = [result.save(folder / "interpolation.csv")]
    if plot:
        drawn: dict[str, Picture] = {"motion": _motion(result), "feed": _feed(result, blocks)}
        if sum(axis in _LINEAR for axis in result.meta["axes"]) > 1:
            drawn["path"] = _path(result, blocks)
        drawn["certificate"] = certificate.plot()
        pictures = {folder / f"{name}.png": picture.png() for name, picture in drawn.items()}
        write_files(pictures)
        files += pictures
    return files


def _motion(result: Result) -> Picture:
    """Position, velocity and acceleration of each axis over time."""
    from rds.interpolators.plots import over_time

    names = result.meta["axes"]
    kinds = ("reference", "reference_velocity", "reference_acceleration")
    columns = [np.column_stack([result[f"{axis}_{kind}"] for axis in names]) for kind in kinds]
    return over_time(result["time"], names, *columns)


def _feed(result: Result, blocks: list[SampleBlock]) -> Picture:
    """The speed along the path over time, mm/s (degrees/s where no linear axis moves), beside the programmed one."""
    from rds.interpolators.plots import speed

    velocity = np.concatenate([block.velocity for block in blocks])
    of = slice(0, 3) if velocity[:, :3].any() else slice(3, 6)
    programmed = np.concatenate([_programmed_speed(block) for block in blocks])
    unit = "mm/s" if of.start == 0 else "degrees/s"
    return speed(result["time"], programmed, np.linalg.norm(velocity[:, of], axis=1), unit)


def _programmed_speed(block: SampleBlock) -> np.ndarray:
    """The feed rate of each sample's segment; nan in a rapid, and where the program has not moved yet."""
    number = block.segment - block.path_first
    known = (number >= 0) & (number < len(block.path))
    if not known.any():
        return np.full(len(block), np.nan)
    segments = block.path[np.where(known, number, 0)]
    return np.where(known & ~segments["rapid"], segments["rate"], np.nan)


def _path(result: Result, blocks: list[SampleBlock]) -> Picture:
    """The programmed path and the samples, in each plane of two linear axes in which they go somewhere."""
    from rds.interpolators.motion.segments import AXES, LINE, pieces, points_at
    from rds.interpolators.plots import in_planes

    points: list[np.ndarray] = []
    done = -1
    for block in blocks:
        fresh = block.path[max(0, done + 1 - block.path_first) :]
        done = max(done, block.path_first + len(block.path) - 1)
        curved = 2 + (np.abs(fresh["sweep"]) * _CHORDS).astype(int)
        owner, share = pieces(np.where(fresh["plane"] == LINE, 1, curved))
        points += [fresh["start"][:1], points_at(fresh[owner], share)]
    names = [axis for axis in result.meta["axes"] if axis in _LINEAR]
    columns = [AXES.index(name) for name in names]
    position = np.column_stack([result[f"{name}_reference"] for name in names])
    programmed = np.concatenate(points)[:, columns] if points else position[:1]
    going = [k for k in range(len(names)) if np.ptp(position[:, k]) > 0.0]
    return in_planes(names, going, programmed, position)


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
