"""What the bus did to a run, in a sentence: a fault that is over soon ends nothing, and is told all the same."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def bus_note(drivers: Mapping[str, Any], bus: Mapping[str, Any]) -> str | None:
    """From the drivers' counters and the statistics of the built-in bus (either may be empty); None: all went well."""
    parts = []
    if missing := drivers.get("missing", 0):
        late = min(drivers.get("late", 0), missing)
        came = f", {late} of them came later" if late else ""
        of = "the position before stood in for " + ("it" if missing == 1 else "each")
        parts.append(f"{_some(missing, 'answer')} of modules did not come within the period{came} ({of})")
    if lost := drivers.get("lost_ticks", 0):
        parts.append(f"modules missed {_some(lost, 'command')}")
    if cut := drivers.get("cut", 0):
        parts.append(f"zero volts for {_some(cut, 'period')}, because a module was silent")
    if emergencies := drivers.get("emergencies", 0):
        parts.append(_some(emergencies, "emergency message"))
    if errors := bus.get("error_frames", 0):
        parts.append(f"{_some(errors, 'error frame')}, after which the frames were sent again")
    if struck := bus.get("struck", 0):
        parts.append(f"{_some(struck, 'frame')} struck by injected faults")
    return f"on the bus: {'; '.join(parts)}" if parts else None


def _some(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"
