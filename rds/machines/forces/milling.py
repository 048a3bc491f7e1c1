"""Cutting parameters of milling: feed speed, chip thickness, specific cutting force, power (dcs-thesis, 5.3 to 5.6).

    v_f = n z f_z                                           mm/min
    h_m = 360 f_z a_e sin κ / (π D ω_e)                      mm
    k_c = k_c1.1 (1 - 0.01 γ₀) / h_m^m_c                     N/mm²
    P_c = a_p a_e v_f k_c / (6·10⁷ η)                        kW

ω_e is the angle over which a tooth is engaged: of a cut of width a_e at the side of a cutter of diameter D,
cos ω_e = 1 - 2 a_e/D.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import acos, degrees, inf, pi, radians, sin
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import Quantity

_KILOWATT = 6e7  # N mm/min
OPTIONS: Mapping[str, Quantity] = {
    "speed": Quantity("spindle speed n", "rev/min", above=0.0),
    "teeth": Quantity("teeth z of the tool", low=1, whole=True),
    "feed": Quantity("feed per tooth f_z", "mm", above=0.0),
    "depth": Quantity("depth of cut a_p, along the tool", "mm", above=0.0),
    "width": Quantity("width of cut a_e, across the tool", "mm", above=0.0),
    "diameter": Quantity("diameter D of the tool", "mm", above=0.0),
    "kc11": Quantity("specific cutting force at a chip of 1 mm by 1 mm", "N/mm²", above=0.0),
    "mc": Quantity("exponent by which it falls with the chip thickness", low=0.0, high=1.0),
    "rake": Quantity("rake angle γ₀", "degrees", low=-90.0, high=90.0, default=0.0),
    "entering": Quantity("entering angle κ", "degrees", above=0.0, high=90.0, default=90.0),
    "engaged": Quantity(
        "angle of engagement ω_e; by default from width and diameter", "degrees", above=0.0, high=360.0
    ),
    "efficiency": Quantity("efficiency η of the spindle's drive", above=0.0, high=1.0, default=1.0),
}


@dataclass(frozen=True)
class Cut:
    """What follows for a cut. `torque` is that of the power at the spindle's speed, without the losses of η."""

    feed_speed: float  # mm/min
    cutting_speed: float  # m/min
    engaged: float  # degrees
    chip_thickness: float  # mm, mean
    specific_force: float  # N/mm²
    removal: float  # cm³/min
    power: float  # kW, of the spindle's motor
    torque: float  # N m

    def to_json(self) -> dict[str, float]:
        """By name."""
        return asdict(self)


def cut(**given: Any) -> Cut:
    """The parameters of a cut; see `OPTIONS`. InputError for a missing, unknown or impossible value."""
    v = _read(given)
    return _cut(v)


def _read(given: Mapping[str, Any]) -> dict[str, float]:
    for name in given:
        if name not in OPTIONS:
            raise InputError(f"a cut has no {name!r}; it has {', '.join(OPTIONS)}")
    found: dict[str, float] = {}
    for name, option in OPTIONS.items():
        value = given.get(name)
        if value is None:
            value = option.default
        if value is not None:
            found[name] = option.check(value, name, "cut")
        elif name != "engaged":
            raise InputError(f"a cut needs {name} ({option.described})")
    if found["width"] > found["diameter"]:
        raise InputError(
            f"width = {found['width']:g} mm is more than the tool's diameter of {found['diameter']:g} mm; "
            "a tool cuts no wider than it is"
        )
    if found["feed"] > found["diameter"]:
        raise InputError(
            f"feed = {found['feed']:g} mm per tooth is more than the tool's diameter of {found['diameter']:g} mm; give "
            "the way from tooth to tooth, not the feed rate"
        )
    found.setdefault("engaged", degrees(acos(1.0 - 2.0 * found["width"] / found["diameter"])))
    return found


def _cut(v: Mapping[str, float]) -> Cut:
    feed_speed = v["speed"] * v["teeth"] * v["feed"]
    arc = pi * v["diameter"] * v["engaged"]
    chip = 360.0 * v["feed"] * v["width"] * sin(radians(v["entering"])) / arc
    specific = v["kc11"] * (1.0 - 0.01 * v["rake"]) / chip ** v["mc"]
    removal = v["depth"] * v["width"] * feed_speed  # mm³/min
    useful = removal * specific / _KILOWATT
    return Cut(
        feed_speed=feed_speed,
        cutting_speed=pi * v["diameter"] * v["speed"] / 1000.0,
        engaged=v["engaged"],
        chip_thickness=chip,
        specific_force=specific,
        removal=removal / 1000.0,
        power=useful / v["efficiency"],
        torque=useful * 1e3 / (2.0 * pi * v["speed"] / 60.0),
    )


def powers(feed: np.ndarray, speed: np.ndarray, **given: Any) -> np.ndarray:
    """The power (n,), W, at feeds (n,) in mm/s and spindle speeds (n,) in rev/min; 0 without feed.

    `given` is the rest of a cut, without speed and feed per tooth. InputError as `cut`.
    """
    v = _read({**given, "feed": 1.0, "speed": 1.0})
    one = _cut(v).power  # kW at 1 rev/min and 1 mm a tooth, which turns as n f_z^(1 - m_c)
    made = np.zeros(len(feed))
    cutting = (feed > 0.0) & (speed != 0.0)
    turns = np.abs(speed[cutting])
    per_tooth = 60.0 * feed[cutting] / (turns * v["teeth"])
    made[cutting] = 1e3 * one * turns * per_tooth ** (1.0 - v["mc"])
    return made


def largest_feed(power: float, **given: Any) -> float:
    """The feed per tooth (mm) whose cut takes `power` kW: P_c grows with f_z^(1 - m_c). Inf where m_c = 1."""
    v = _read({**given, "feed": 1.0})
    return inf if v["mc"] == 1.0 else float((power / _cut(v).power) ** (1.0 / (1.0 - v["mc"])))


def warnings(made: Cut, power: float | None = None, feed_speed: float | None = None) -> list[str]:
    """What the machine cannot do: a cut beyond the spindle's `power` (kW), a feed beyond `feed_speed` (mm/min)."""
    said = []
    if power is not None and made.power > power:
        watts = f"the cut takes {1e3 * made.power:.0f} W, and the spindle has {1e3 * power:.0f} W"
        said.append(f"{watts}; cut less deep or feed slower")
    if feed_speed is not None and made.feed_speed > feed_speed:
        feeds = f"the feed is {made.feed_speed:.0f} mm/min, and the machine does {feed_speed:.0f} mm/min"
        said.append(f"{feeds}; feed or turn slower")
    return said
