"""Machine files for the tests of links: axes by their letters, and any links."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rds.machines import Machine, load_machine

ROTARY = "ABC"


def text(axes: Sequence[str], links: str) -> str:
    """A machine's file with these axes (A, B, C turn by ±180 degrees, others move by ±100 mm) and these tables."""
    lines = ["sample_period = 0.001"]
    for node, name in enumerate(axes, 2):
        unit, half = ("deg", 180.0) if name[0] in ROTARY else ("mm", 100.0)
        lines += [f"[axis.{name}]", f"node = {node}", f'unit = "{unit}"', f"travel = [{-half}, {half}]"]
        lines += ["resolution = 0.001"]
    return "\n".join(lines) + "\n" + links


def machine(folder: Path, axes: Sequence[str], links: str) -> Machine:
    """The machine read from such a file."""
    path = folder / "own.toml"
    path.write_text(text(axes, links), encoding="utf-8")
    return load_machine(str(path))


def link(**keys: object) -> str:
    """A `[[link]]` table."""
    shown = {key: f'"{value}"' if isinstance(value, str) else f"{value}" for key, value in keys.items()}
    return "[[link]]\n" + "".join(f"{key} = {value}\n" for key, value in shown.items())
