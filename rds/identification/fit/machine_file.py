"""Machine files from estimates: a known machine one axis of which is what was found of it, or a machine of it alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from rds.core.atomic import keep_another, write_whole
from rds.core.errors import InputError
from rds.core.toml_file import read_toml
from rds.core.toml_text import toml_text
from rds.identification.fit.model_file import ModelFile, read_model
from rds.identification.fit.run_model import checked_structure, library_table, run_model
from rds.identification.structures.signals import POSITIONS
from rds.machines import load_machine
from rds.models.machine_axis import MachineParameters

_ALONE = {"sample_period": 0.001, "converter": {"range": 10.0, "bits": 12}}  # of a machine that nobody else describes


@dataclass(frozen=True)
class MachineMade:
    """The file that was written, and sentences on which of its numbers are not of the log: chosen, or another's."""

    path: Path
    said: tuple[str, ...]


def write_machine(
    path: str | Path,
    model: ModelFile | str | Path,
    base: str | None,
    axis: str,
    *,
    measured: bool = False,
    per_volt: float | None = None,
) -> MachineMade:
    """Write the machine `base` (a name or a file) to `path` with `axis` as the model file says, whole or not at all.

    The axis's `model` is what was estimated, and so is the machine behind the bus (`machine`). What the file has
    besides - travel, resolution, limits, other axes - stays what it was, and is said; with `measured` travel, speed and
    resolution of this axis are those of the logs that were fitted. Without a `base` the machine has this axis alone.
    `per_volt`: of a model commanded in A, N, Nm or %, how much of it the drive makes of a volt. InputError for an axis
    that the machine does not have or that is measured in another unit, and for a student's structure, which is no
    machine.
    """
    path = Path(path)
    if path.suffix != ".toml":
        raise InputError("a machine file is TOML; give it a name that ends in .toml", str(path))
    keep_another(path, "as estimated: ", "machine of a model file")
    file = model if isinstance(model, ModelFile) else read_model(model)
    if file.is_student:
        raise InputError(
            "its structure is a student's file, which no machine is made of; fit `--structure axis`", file.path
        )
    unit = load_machine(base).axis(axis).unit if base is not None else _unit_of(file)
    run_model(file, unit=unit, per_volt=per_volt)  # whatever will not do is said here
    table = _machine_table(library_table(checked_structure(file), file.values(), per_volt or 1.0))
    known = {field.name for field in fields(MachineParameters)}
    found = _found(file) if measured or base is None else {}
    if base is None:
        data: dict[str, Any] = {"name": path.stem, **_ALONE, "axis": {axis: {"node": 1, "unit": unit, **found}}}
        header = f"The axis {axis} as estimated: {Path(file.path).name}, SHA-256 {file.sha256[:16]}..."
        said = ["sample period (1 ms), converter (±10 V, 12 bits) and node are chosen, not of the log"]
    else:
        machine = load_machine(base)
        data, _ = read_toml(machine.path)
        data["name"] = path.stem
        said = [_others(data["axis"][axis], found, machine.name, unit, file)]
        data["axis"][axis] |= {key: value for key, value in found.items() if key != "limits"}
        if "limits" in found and "limits" in data["axis"][axis]:
            data["axis"][axis]["limits"] |= found["limits"]
        header = f"{machine.name} with axis {axis} as estimated: {Path(file.path).name}, SHA-256 {file.sha256[:16]}..."
    if base is None:
        data["axis"][axis].pop("limits", None)  # acceleration and jerk are not known
    data["axis"][axis] |= {"model": table, "machine": {key: v for key, v in table.items() if key in known}}
    write_whole(path, toml_text(data, header + "\n" + "\n".join(said)).encode())
    return MachineMade(path, tuple(said))


def _machine_table(table: dict[str, Any]) -> dict[str, Any]:
    """The `[model]` table as one that the machine behind the bus can be made of, too.

    The directional axis becomes the machine's own, by which viscous friction may be more in one direction: τ, K and
    friction so that the smaller of the two is none.
    """
    if table["name"] != "directional-axis":
        return table
    plus, minus = 1.0 + table["viscous_plus"], 1.0 + table["viscous_minus"]
    least = min(plus, minus)
    scaled = {name: table[name] / least for name in ("tau", "K", "friction_plus", "friction_minus")}
    viscous = {"viscous": plus / least - 1.0, "viscous_difference": (minus - plus) / least}
    return {"name": "machine-axis", **scaled, **viscous}


def _unit_of(file: ModelFile) -> str:
    return "rev/min" if file.structure == "spindle" else POSITIONS[file.output_unit][0]


def _found(file: ModelFile) -> dict[str, Any]:
    """Travel, resolution and the highest speed of the fitted logs; InputError where no log tells the first two."""
    ends = [log["position"] for log in file.logs if "position" in log]
    steps = [float(log["resolution"]) for log in file.logs if "resolution" in log]
    speeds = [abs(v) for log in file.logs for v in log.get("velocity", ())]
    if file.structure == "spindle" and speeds:
        ends, steps = [(0.0, max(speeds))], steps or [1.0]
    if not ends or not steps:
        raise InputError(
            f"its logs do not tell {'travel' if not ends else 'the resolution of the encoder'}; take these of a "
            "machine that is known (--base, without --measured)",
            file.path,
        )
    low, high = min(end[0] for end in ends), max(end[1] for end in ends)
    found: dict[str, Any] = {"travel": [low, high], "resolution": max(steps)}
    return found | ({"limits": {"velocity": max(speeds)}} if speeds else {})


def _others(axis: Mapping[str, Any], found: Mapping[str, Any], name: str, unit: str, file: ModelFile) -> str:
    """Which numbers of the axis are the other machine's."""
    theirs = []
    if "travel" not in found:
        theirs.append(f"travel ({axis['travel'][0]:g} to {axis['travel'][1]:g} {unit})")
        theirs.append(f"resolution ({axis['resolution']:g} {unit})")
    if "limits" in axis:
        speed = "" if "limits" in found else f"velocity {axis['limits']['velocity']:g} {unit}/s, "
        theirs.append(f"limits of planned motion ({speed}acceleration and jerk)")
    logged = [log["position"] for log in file.logs if "position" in log]
    beside = ""
    if logged and "travel" not in found:
        low, high = min(end[0] for end in logged), max(end[1] for end in logged)
        beside = f"; the log went from {low:.4g} to {high:.4g} {unit} (--measured takes its numbers)"
    return f"of {name}, not of the log: {', '.join(theirs) or 'node and module'}{beside}"
