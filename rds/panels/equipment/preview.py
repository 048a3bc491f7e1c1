"""The lanes of the strip before there is a run: what will be drawn where, and the signal that is chosen."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

import numpy as np

from rds.core.colours import QUANTITIES
from rds.core.errors import InputError
from rds.panels.equipment.fields import USER
from rds.panels.equipment.state import Equipment
from rds.references import Signal, make_signal

_POINTS = 401
_PERIODS = 8  # at most, of a signal that repeats
_HINTS = {
    "control": (
        "Choose on the left what to try, then Run. Here will be, as it happens, in lanes that share their time: the "
        "reference and the measured position; the error between them; the voltage. Drag in a lane to zoom, place two "
        "cursors to measure, and let an earlier run stand behind."
    ),
    "model": (
        "Choose on the left what to send, then Run. Here will be, as it happens, in lanes that share their time: the "
        "position that the voltage leads to, and the voltage. Drag in a lane to zoom, place two cursors to measure, "
        "and let an earlier run stand behind."
    ),
}


def preview(equipment: Equipment) -> str:
    """HTML: a sentence, and the lanes."""
    shown, seconds = _signal(equipment)
    said = f"as chosen, {seconds:g} s" if shown else ""
    voltage, unit = equipment.kind == "model", equipment.axis.unit
    lanes = [
        _lane("position", unit, "" if voltage else shown, said, QUANTITIES["reference"], 3.0),
        "" if voltage else _lane("error", unit),
        _lane("voltage", "V", shown if voltage else "", said, QUANTITIES["voltage"], 1.6),
    ]
    return f'<p>{_HINTS[equipment.kind]}</p><div class="rds-lanes">{"".join(lanes)}</div>'


def _lane(name: str, unit: str, points: str = "", said: str = "", colour: str = "", width: float = 0.0) -> str:
    drawing = ""
    if points:
        curve = f'<polyline points="{points}" style="stroke: {colour}; stroke-width: {width}px"/>'
        drawing = (
            f'<svg viewBox="0 -1 1 2" preserveAspectRatio="none" aria-hidden="true">{curve}</svg><span>{said}</span>'
        )
    return f'<div class="rds-lane"><span>{name} [{escape(unit)}]</span>{drawing}</div>'


def _signal(equipment: Equipment) -> tuple[str, float]:
    """Points of the chosen signal, scaled to 1, and the seconds that they show: its first periods.

    No points for a path or somebody's file.
    """
    chosen = equipment.choices
    if equipment.on_path or chosen["shape"] == USER:  # whose formula would be written as a file
        return "", 0.0
    try:
        table = equipment.table()
        words: Mapping[str, Any] = table["signal" if equipment.kind == "model" else "reference"]
        signal: Signal = make_signal(**words)
    except InputError:  # what is missing is said when it is run
        return "", 0.0
    seconds = float(chosen["duration"])
    if signal.period is not None:
        seconds = min(seconds, _PERIODS * signal.period)
    values = signal.value(np.linspace(0.0, seconds, _POINTS))
    most = float(np.abs(values).max())
    if not np.isfinite(most) or most == 0.0:
        return "", 0.0
    return " ".join(f"{i / (_POINTS - 1):.4f},{-0.9 * value / most:.3f}" for i, value in enumerate(values)), seconds
