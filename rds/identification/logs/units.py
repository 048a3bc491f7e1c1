"""Units of logged columns, converted explicitly: a unit that is not in this table is refused, with the table.

Each unit belongs to a dimension and is some factor of that dimension's base unit, which is what a `Log` holds.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from types import MappingProxyType

from rds.core.errors import InputError

# dimension -> (base unit, {unit: how many base units one of it is})
_DIMENSIONS: Mapping[str, tuple[str, Mapping[str, float]]] = MappingProxyType(
    {
        "time": ("s", {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}),
        "length": ("mm", {"m": 1e3, "cm": 10.0, "mm": 1.0, "um": 1e-3, "nm": 1e-6, "in": 25.4, "ft": 304.8}),
        "angle": ("deg", {"deg": 1.0, "rad": 57.29577951308232, "mrad": 0.05729577951308232, "rev": 360.0}),
        "counts": ("counts", {"counts": 1.0}),
        "speed": (
            "mm/s",
            dict(zip(("m/s", "cm/s", "mm/s", "um/s", "in/s"), (1e3, 10.0, 1.0, 1e-3, 25.4), strict=True))
            | dict(zip(("m/min", "mm/min", "in/min"), (1e3 / 60.0, 1.0 / 60.0, 25.4 / 60.0), strict=True)),
        ),
        "angular speed": (
            "rev/min",
            {"rev/min": 1.0, "rev/s": 60.0, "rad/s": 9.549296585513721, "deg/s": 1.0 / 6.0, "krev/min": 1e3},
        ),
        "count speed": ("counts/s", {"counts/s": 1.0}),
        "voltage": ("V", {"V": 1.0, "mV": 1e-3, "uV": 1e-6, "kV": 1e3}),
        "current": ("A", {"A": 1.0, "mA": 1e-3, "uA": 1e-6}),
        "force": ("N", {"N": 1.0, "kN": 1e3, "mN": 1e-3}),
        "torque": ("Nm", {"Nm": 1.0, "mNm": 1e-3}),
        "ratio": ("%", {"1": 100.0, "%": 1.0, "permille": 0.1}),
    }
)
# other spellings, after `plain` has made them so
_SPELLINGS: Mapping[str, str] = MappingProxyType(
    {
        **dict.fromkeys(("sec", "secs", "second", "seconds", "Sekunden"), "s"),
        **dict.fromkeys(("sek", "Sek", "Sec", "Second", "Seconds", "Sekunde"), "s"),
        **dict.fromkeys(("msec", "millisec", "millis", "millisecond", "milliseconds"), "ms"),
        **dict.fromkeys(("usec", "microsec", "micros", "microsecond", "microseconds"), "us"),
        **dict.fromkeys(("meter", "metre", "meters", "metres"), "m"),
        **dict.fromkeys(("millimeter", "millimetre", "millimeters", "millimetres", "Millimeter"), "mm"),
        **dict.fromkeys(("micron", "microns", "micrometer", "micrometre", "micrometers", "Mikrometer"), "um"),
        **dict.fromkeys(("inch", "inches"), "in"),
        **dict.fromkeys(("°", "degree", "degrees", "Grad", "Degree", "Degrees"), "deg"),
        **dict.fromkeys(("radian", "radians"), "rad"),
        **dict.fromkeys(("°/s", "deg/sec", "dps"), "deg/s"),
        **{f"{length}/sec": f"{length}/s" for length in ("m", "mm", "um", "in", "rad")},
        **dict.fromkeys(("pct", "percent", "Percent"), "%"),
        **dict.fromkeys(("rpm", "RPM", "r/min", "U/min", "1/min", "min-1"), "rev/min"),
        **dict.fromkeys(("krpm", "kRPM"), "krev/min"),
        **dict.fromkeys(("turn", "turns"), "rev"),
        **dict.fromkeys(("U/s", "r/s", "rps", "turn/s", "turns/s"), "rev/s"),
        **dict.fromkeys(("count", "cts", "cnt", "inc", "increments", "ticks", "pulse", "pulses", "steps"), "counts"),
        **dict.fromkeys(("incs", "qc", "quadcounts"), "counts"),  # EPOS counts quarters of a line
        **dict.fromkeys(("cts/s", "inc/s", "ticks/s", "pulses/s", "steps/s", "count/s", "counts/sec"), "counts/s"),
        **dict.fromkeys(("volt", "volts", "Volt", "Volts"), "V"),
        **dict.fromkeys(("ampere", "amperes", "amp", "amps", "Ampere", "Amp", "Amps"), "A"),
        **dict.fromkeys(("newton", "newtons", "Newton", "Newtons"), "N"),
        **dict.fromkeys(("N.m", "N*m", "N·m"), "Nm"),
        **dict.fromkeys(("Nmm", "N.mm", "N*mm", "N·mm"), "mNm"),
        **dict.fromkeys(("percent", "pct"), "%"),
        **dict.fromkeys(("‰", "per mille", "0.1%", "0,1%"), "permille"),
    }
)
_BY_UNIT = MappingProxyType(
    {unit: (dimension, factor) for dimension, (_, units) in _DIMENSIONS.items() for unit, factor in units.items()}
)
_ALIKE = 0.75  # of the letters: what is less alike is another unit, not a slip
# endings of names that say a unit, as in `pos_mm`; not those that are as likely something else (x_in, a_1, p_m)
_ENDINGS = (
    "s",
    "sec",
    "ms",
    "msec",
    "us",
    "usec",
    "ns",
    "mm",
    "um",
    "deg",
    "rad",
    "counts",
    "V",
    "mV",
    "A",
    "mA",
    "N",
    "Nm",
    "rpm",
    "pct",
    "percent",
)
_OF_RPM = re.compile(r"(?:.*[_ ])?rpm(?:[_ ]?\w+)?|(?:.*[_ ])?RPM(?:[_ ]?\w+)?")
_OF_TORQUE = re.compile(r"(?:.*_)?(?:torque|tau)_(?:.*_)?nm")  # of which nm is no length
_RATES = re.compile(r"(?P<stem>.+?)_(?P<unit>mm|um|m|cm|in|deg|rad|rev|counts|inc)_(?:p|per)?_?(?P<time>s|sec|min)")


def unit_of_name(name: str) -> str | None:
    """The unit that a name ends with, as `pos_mm` and `velocity_mm_s` do; `rpm_left` has one, too. None for none."""
    if _OF_RPM.fullmatch(name):
        return "rev/min"
    if _OF_TORQUE.fullmatch(name):
        return "Nm"
    if rate := _RATES.fullmatch(name):
        unit = f"{rate['unit']}/{'s' if rate['time'] == 'sec' else rate['time']}"
        return unit if dimension(unit) else None
    stem, _, ending = name.replace("µ", "u").replace("μ", "u").rpartition("_")
    return ending if stem and ending in _ENDINGS else None


def acting(unit: str) -> str:
    """What a command in this unit is: a voltage, current, force or torque; of a share it is the command."""
    found = dimension(unit)
    return found if found in ("voltage", "current", "force", "torque") else "command"


def plain(unit: str) -> str:
    """A unit as the table spells it: µ in either of its two codes is u; `rpm` is rev/min. Not checked."""
    text = unit.strip().replace("µ", "u").replace("μ", "u").replace("⁻¹", "-1").replace(" ", "")
    return _SPELLINGS.get(text, text)


def dimension(unit: str) -> str | None:
    """What a unit measures (time, length, voltage, ...); None for one that the table does not have."""
    found = _BY_UNIT.get(plain(unit))
    return found[0] if found else None


def base(of: str) -> str:
    """The unit in which a `Log` holds a dimension."""
    return _DIMENSIONS[of][0]


def factor(unit: str, to: str) -> float:
    """What a number in `unit` is multiplied by to be in `to`; InputError if either is unknown or they do not match."""
    from_dimension, from_factor = _known(unit)
    to_dimension, to_factor = _known(to)
    if from_dimension != to_dimension:
        raise InputError(
            f"{unit} measures {from_dimension}, and {to} measures {to_dimension}: neither becomes the other"
        )
    return from_factor / to_factor


def known_units(unit: str, dimensions: Iterable[str]) -> str:
    """Which units there are for `dimensions`, and which of them an unknown `unit` may be meant for, as words."""
    known = [name for d in dimensions for name in _DIMENSIONS[d][1]]
    spelled = {word.casefold(): known_as for word, known_as in _SPELLINGS.items() if known_as in known}
    spelled |= {name.casefold(): name for name in known}
    close = get_close_matches(plain(unit).casefold(), spelled, n=1, cutoff=_ALIKE)
    hint = f"; did you mean {spelled[close[0]]!r}?" if close else ""
    if unit == "Hz" and "rev/s" in known:
        hint = "; revolutions in a second are 'rev/s', where they are the axis's and no electrical ones"
    return f"known units: {', '.join(known)}{hint}"


def check_unit(unit: str, dimensions: Iterable[str], what: str) -> str:
    """The dimension of `unit`, which must be one of `dimensions`; InputError lists the units that would do."""
    allowed = list(dimensions)
    found = dimension(unit)
    if found is None:
        known = [name for d in allowed for name in _DIMENSIONS[d][1]]
        raise InputError(f"unit {unit!r} of {what} is unknown; {known_units(unit, allowed)}")
    if found not in allowed:
        known = [name for d in allowed for name in _DIMENSIONS[d][1]]
        hint = ""
        if "voltage" in allowed and found in ("length", "angle", "counts", "speed", "angular speed", "count speed"):
            hint = "; where a drive is told to go is its reference, and the voltage, current or torque that moves the "
            hint += "axis its command"
        one_of = f"it must be in one of {', '.join(known)}"
        raise InputError(f"{what} is in {unit!r}, which measures {found}; {one_of}{hint}")
    return found


def _known(unit: str) -> tuple[str, float]:
    found = _BY_UNIT.get(plain(unit))
    if found is None:
        raise InputError(f"unit {unit!r} is unknown; known units: {', '.join(_BY_UNIT)}")
    return found
