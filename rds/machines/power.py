"""The power budget of a machine's modules: what they draw while they start, run and work, against their supply.

The currents stand in the `[axis.NAME.module]` tables, the supply in `[power]`. Each motor draws `current_start` at
rest, `current_run` at speed and at most `current_peak`; where no largest current is known, it is that of the start. Of
both ways round the larger counts. All motors may start at once. Source of the shipped machine's numbers: oacs-thesis,
10.1.3 and tables Q39 to Q43.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import floor
from typing import Any

from rds.core.errors import InputError
from rds.machines.machine import Machine


@dataclass(frozen=True)
class ModuleCurrent:
    """Currents of one module, A."""

    name: str
    start: float
    run: float
    peak: float


@dataclass(frozen=True)
class PowerBudget:
    """The modules' currents and the supply: V, A. `unknown` are axes whose modules say no currents."""

    machine: str
    voltage: float
    current: float
    modules: tuple[ModuleCurrent, ...]
    unknown: tuple[str, ...]

    @property
    def start(self) -> float:
        """A, all motors at rest."""
        return sum(module.start for module in self.modules)

    @property
    def run(self) -> float:
        """A, all motors at speed."""
        return sum(module.run for module in self.modules)

    @property
    def peak(self) -> float:
        """A, the largest of all motors at once."""
        return sum(module.peak for module in self.modules)

    @property
    def reserve(self) -> float:
        """A, what is left of the supply at the peak."""
        return self.current - self.peak

    @property
    def ok(self) -> bool:
        """Whether the supply bears the peak."""
        return self.reserve >= 0.0

    @property
    def further(self) -> int:
        """How many further modules of an average peak the supply bears."""
        return max(0, floor(self.reserve / (self.peak / len(self.modules)) + 1e-9)) if self.peak else 0

    def verdict(self) -> str:
        """One sentence."""
        said = f"the modules draw at most {self.peak:.2f} A of the supply's {self.current:g} A at {self.voltage:g} V"
        if not self.ok:
            return (
                f"overloaded: {said}; give {self.machine} a supply of {self.peak:.1f} A, or start its axes one by one"
            )
        beside = f"; {', '.join(self.unknown)} say{'s' * (len(self.unknown) == 1)} no current" if self.unknown else ""
        return f"ok: {said}; it bears {self.further} more of their kind{beside}"

    def to_json(self) -> dict[str, Any]:
        """As plain dicts, A, V and W."""
        return {
            "machine": self.machine,
            "supply": {"voltage": self.voltage, "current": self.current, "power": self.voltage * self.current},
            "modules": {m.name: {"start": m.start, "run": m.run, "peak": m.peak} for m in self.modules},
            "start": self.start,
            "run": self.run,
            "peak": self.peak,
            "reserve": self.reserve,
            "further_modules": self.further,
            "unknown": list(self.unknown),
            "ok": self.ok,
        }


def power_budget(machine: Machine) -> PowerBudget:
    """The budget of a machine. InputError for one whose file says no supply, or no module's current."""
    if machine.power is None:
        raise InputError("says no supply; add [power] with voltage (V) and current (A)", machine.path)
    modules, unknown = [], []
    for axis in machine.axes.values():
        own = axis.module
        start, run = (_larger(own, name) for name in ("current_start", "current_run"))
        if not start and not run and not own.get("current_peak"):
            unknown.append(axis.name)
            continue
        modules.append(ModuleCurrent(axis.name, start, run, max(own.get("current_peak", 0.0), start, run)))
    if not modules:
        raise InputError(
            "none of its modules says a current; add current_start and current_run to [axis.NAME.module]", machine.path
        )
    return PowerBudget(machine.name, machine.power.voltage, machine.power.current, tuple(modules), tuple(unknown))


def _larger(module: Mapping[str, Any], name: str) -> float:
    """The larger of both ways round, A."""
    return max(float(module.get(name, 0.0)), float(module.get(f"counterclockwise_{name}", 0.0)))
