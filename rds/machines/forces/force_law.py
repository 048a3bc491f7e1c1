"""The static cutting force, F = K d^β V^γ f^α (mrm-control, equation 4), and its coefficients as data."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import Quantity, Table, Text, near
from rds.core.toml_table import TomlTable

COEFFICIENTS = Table(
    "cutting force of a material under a tool, F = K d^depth V^speed f^feed",
    {
        "material": Text("what is cut"),
        "tool": Text("what cuts"),
        "K": Quantity("force at d = 1 mm, V = 1 m/min, f = 1 mm", "N", above=0.0),
        "depth": Quantity("exponent β of the depth of cut", low=-5.0, high=5.0),
        "speed": Quantity("exponent γ of the cutting speed", low=-5.0, high=5.0, default=0.0),
        "feed": Quantity("exponent α of the feed", above=0.0, high=5.0),
        "kc11": Quantity("specific cutting force at a chip of 1 mm by 1 mm, rake 0", "N/mm²", above=0.0),
        "mc": Quantity("exponent by which it falls with the chip thickness", low=0.0, high=1.0),
        "source": Text("where the numbers come from"),
    },
    needed=("material", "tool", "K", "depth", "feed", "source"),
)
FILE = Table("Coefficients of cutting forces, a table for each material and tool.", others=COEFFICIENTS)


@dataclass(frozen=True)
class ForceLaw:
    """F = K d^β V^γ f^α: F in N, d in mm, V in m/min, f in mm per tooth (per revolution in turning).

    `kc11` (N/mm²) and `mc` are those of Kienzle's law for a rake of 0, where they are known.
    """

    name: str
    material: str
    tool: str
    K: float
    depth: float  # β
    speed: float  # γ
    feed: float  # α
    source: str
    kc11: float | None = None
    mc: float | None = None

    def force(self, d: Any, V: Any, f: Any) -> Any:
        """The force, N; arrays answer as arrays. A feed of 0 cuts nothing."""
        return self.K * np.power(d, self.depth) * (np.power(V, self.speed) if self.speed else 1.0) * f**self.feed


def coefficient_names(path: str | Path | None = None) -> list[str]:
    """Names of the force laws of the package, or of a file with the same form."""
    return list(_table(path).table)


def force_law(name: str, path: str | Path | None = None) -> ForceLaw:
    """The force law called `name`, of the package or of a file with the same form.

    Raises InputError, with file and line, for an unknown name or a table that will not do.
    """
    laws = _table(path)
    if name not in laws.table:
        known = list(laws.table)
        raise InputError(f"there are no cutting forces of {name!r}; there are {', '.join(known)}{near(name, known)}")
    table = laws.inner(name)
    assert table is not None
    made = ForceLaw(name=name, **{key: table.read(key) for key in COEFFICIENTS.keys})
    table.done()
    return made


def _table(path: str | Path | None) -> TomlTable:
    own = files("rds.machines.forces").joinpath("coefficients.toml")
    return TomlTable.open(str(own) if path is None else path, FILE)
