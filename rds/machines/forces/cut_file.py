"""What a part program cuts, and what tool and machine bear: a TOML file, or the same words as options."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import Quantity, Table, Text, near
from rds.core.toml_table import TomlTable
from rds.machines.forces.force_law import ForceLaw, force_law
from rds.machines.forces.milling import OPTIONS as MILLING
from rds.machines.forces.milling import powers

FORCE = "force"  # the name of the cutting force's own limit
POWER = "power"  # that of the spindle's
LIMIT = Quantity("largest load of a joint by the process, N or N m", above=0.0)
LIMITS = Table(
    "what is borne",
    {
        FORCE: Quantity("largest cutting force", "N", above=0.0),
        POWER: Quantity("power of the spindle's motor; needs width", "W", above=0.0),
    },
    others=LIMIT,
)
CUT = Table(
    "A cut: what the feed moves of a part program take off, and what is borne.",
    {
        "material": Text("name of the cutting force's coefficients", "aluminium-6061"),
        "coefficients": Text("file of coefficients instead of the package's"),
        "depth": Quantity("depth of cut of feed moves", "mm", above=0.0),
        "teeth": Quantity("teeth of the tool; 1: feed per revolution, as in turning", low=1, whole=True, default=1),
        "diameter": Quantity("diameter of the tool (of the work in turning)", "mm", above=0.0),
        "speed": Quantity("spindle speed where the program says none", "rev/min", above=0.0),
        "axial": Quantity("force along the tool, into it, as a share of the cutting force", low=0.0, default=0.0),
        "direction": Quantity(
            "of the force across the tool: 0 against the motion of the tool over the work, from there "
            "counter-clockwise as seen from the spindle",
            "degrees",
            low=-180.0,
            high=180.0,
            default=0.0,
        ),
        "width": Quantity("width of cut, across the tool, for the power", "mm", above=0.0),
        "rake": MILLING["rake"],
        "efficiency": MILLING["efficiency"],
        "hardness": Quantity("what the simulated load cell measures of the force by the law", above=0.0, default=1.0),
        "top": Quantity("of the work, in its coordinates: the load cell of a served machine measures below it", "mm"),
        "limits": LIMITS,
    },
    needed=("depth", "diameter"),
)


@dataclass(frozen=True)
class CutFile:
    """A cut: the force law, depth and diameter in mm, teeth, and limits by name (`FORCE` in N, a joint in N or N m).

    `speed` (rev/min) holds where the program has none. The force is against the motion of the tool over the work, or
    turned from there about the tool by `direction` (degrees), and `axial` of it along the tool. `width` (mm), `rake`
    (degrees) and `efficiency` are for the spindle's power.
    """

    law: ForceLaw
    depth: float
    teeth: int
    diameter: float
    speed: float | None = None
    axial: float = 0.0
    direction: float = 0.0
    width: float | None = None
    rake: float = 0.0
    efficiency: float = 1.0
    hardness: float = 1.0
    top: float | None = None  # mm, along z of the work
    limits: Mapping[str, float] = field(default_factory=dict)

    @property
    def has_power(self) -> bool:
        """Whether the spindle's power follows from what is known."""
        return self.width is not None and self.law.kc11 is not None and self.law.mc is not None

    def power(self, feed: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """The spindle's power (n,), W, at feeds in mm/s and speeds in rev/min (equations 5.4 to 5.6 of dcs-thesis).

        Zeros where it does not follow (`has_power`).
        """
        if not self.has_power:
            return np.zeros(len(feed))
        own = {key: getattr(self, key) for key in ("depth", "teeth", "diameter", "width", "rake", "efficiency")}
        return powers(feed, speed, kc11=self.law.kc11, mc=self.law.mc, **own)

    def force(self, feed: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Cutting forces (n,), N, at feeds (n,) in mm/s and spindle speeds (n,) in rev/min; 0 without feed.

        The spindle turns where there is feed: who knows the line of the program refuses anything else.
        """
        moves = feed > 0.0
        made = np.zeros(len(feed))
        n = np.abs(speed[moves])
        per_tooth = 60.0 * feed[moves] / (n * self.teeth)
        made[moves] = self.law.force(self.depth, pi * self.diameter * n / 1000.0, per_tooth)
        return made


_NUMBERS = (
    *("depth", "teeth", "diameter", "speed", "axial", "direction", "width", "rake", "efficiency", "hardness", "top"),
)


def read_cut(path: str | Path) -> CutFile:
    """A cut from its file. InputError, with file and line, for one that will not do."""
    return _cut(TomlTable.open(path, CUT), Path(path).parent)


def cut_of(words: Mapping[str, Any]) -> CutFile:
    """A cut from words, as options give them."""
    return _cut(TomlTable(dict(words), CUT, path="the cut (options such as --depth 1.0, or a file by --cut)"), Path())


def _cut(table: TomlTable, folder: Path) -> CutFile:
    own = table.read("coefficients")
    law = force_law(table.read("material"), None if own is None else folder / own)
    limits = table.inner_or_empty("limits")
    made = CutFile(
        law,
        limits={key: limits.read(key) for key in limits.table},
        **{key: table.read(key) for key in _NUMBERS},
    )
    made.power(np.ones(1), np.ones(1))  # raises for a cut whose power cannot be
    if POWER in made.limits and not made.has_power:
        why = "width is missing" if made.width is None else f"the coefficients of {law.name} have no kc11 and mc"
        raise limits.fault(POWER, f"W is a limit of a power that does not follow: {why}")
    for each in (limits, table):
        each.done()
    return made


def require_joints(cut: CutFile, joints: tuple[str, ...], machine: str) -> None:
    """InputError if a limit is of a joint that the machine does not have."""
    known = (FORCE, POWER, *joints)
    for name in cut.limits:
        if name not in known:
            raise InputError(
                f"{machine} has no joint {name!r} to limit; there are {', '.join(known)}{near(name, known)}"
            )
