"""Where the work is on the machine: the origins of the coordinate systems in a parameter file, and touching off."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.nc.language.errors import ProgramError
from rds.nc.language.frame import SYSTEMS as WORDS
from rds.nc.language.parameters import G92, G92_APPLIED, SYSTEM, SYSTEMS, read_parameters

FIRST = "offsets.var"  # the file that is begun where none is chosen
_AXES = "XYZ"


class Offsets:
    """The origins of G54 to G59.3, mm in machine coordinates, in a parameter file as LinuxCNC keeps it."""

    def __init__(self, folder: Path, name: str):
        """InputError for a file that is there and is no parameter file."""
        self.path = folder / name
        try:
            self._values = read_parameters(self.path) if self.path.exists() else {}
        except ProgramError as error:
            raise InputError(str(error)) from error

    def origin(self, system: int) -> dict[str, float]:
        """Of system 1 (G54) to 9 (G59.3), by axis."""
        return {axis: self._values.get(_number(system, axis), 0.0) for axis in _AXES}

    def table(self) -> list[list[str]]:
        """A row for each system that is not at the machine's zero, and for G54."""
        rows = []
        for number, word in list(enumerate(WORDS))[1:]:
            origin = self.origin(number)
            if number == 1 or any(origin.values()):
                rows.append([word, *(f"{value:.3f}" for value in origin.values())])
        return rows

    def touch_off(self, system: int, machine: Mapping[str, float], reads: Mapping[str, float]) -> None:
        """Let the tool, which is at `machine` (mm, by axis), read `reads` (mm) in a system from now on; saved.

        InputError where an axis's position is missing, or the file turns the system or shifts all of them (G92).
        """
        self._refuse_moved(system)
        for axis, value in reads.items():
            if axis not in machine:
                raise InputError(f"the position of {axis} on the machine is not known; give it")
            self._values[_number(system, axis)] = machine[axis] - value
        self._values.setdefault(SYSTEM, 1.0)
        lines = [f"{number}\t{value:.6f}" for number, value in sorted(self._values.items())]
        write_whole(self.path, ("\n".join(lines) + "\n").encode())

    def _refuse_moved(self, system: int) -> None:
        """What the tool reads would be another thing than its distance from the origin."""
        turn = SYSTEMS + 20 * system + 10
        if self._values.get(turn, 0.0):
            raise InputError(
                f"{WORDS[system]} is turned by {self._values[turn]:g}° in {self.path.name} (parameter {turn}): use "
                f"another system, or set {turn} to 0 in the file"
            )
        if self._values.get(G92_APPLIED) and any(self._values.get(G92 + axis) for axis in range(3)):
            raise InputError(
                f"{self.path.name} shifts all systems by G92 (parameters {G92} on): set {G92_APPLIED} to 0 in the "
                "file, or use another file"
            )


def _number(system: int, axis: str) -> int:
    return SYSTEMS + 20 * system + 1 + _AXES.index(axis)
