"""Signals by kind: voltages for system tests, references for controllers.

A kind is a function that returns a `Signal`; its arguments are the options that a TOML table may give. `OPTIONS` of its
module declares each of them (`rds.core.quantities`: meaning, unit, range), for the schema, the panels and `--help`.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from rds.core.errors import InputError
from rds.core.options import check_known
from rds.core.quantities import Table
from rds.references.broadband import chirp, multisine
from rds.references.periodic import constant, sinusoid, square, triangle
from rds.references.signal import Signal, sample, sample_voltage
from rds.references.speed import speed
from rds.references.staircase import staircase
from rds.references.user import user

__all__ = [
    "Signal",
    "chirp",
    "constant",
    "make_signal",
    "multisine",
    "sample",
    "sample_voltage",
    "signal_function",
    "signal_kinds",
    "signal_options",
    "sinusoid",
    "speed",
    "square",
    "staircase",
    "triangle",
    "user",
]

_KINDS: Mapping[str, Callable[..., Signal]] = MappingProxyType(
    {
        "square": square,
        "triangle": triangle,
        "sinusoid": sinusoid,
        "user": user,
        "constant": constant,
        "multisine": multisine,
        "chirp": chirp,
        "staircase": staircase,
        "speed": speed,
    }
)


def signal_kinds() -> list[str]:
    """The kinds of signals there are."""
    return list(_KINDS)


def signal_function(kind: str) -> Callable[..., Signal]:
    """The function that makes signals of this kind."""
    return _KINDS[kind]


def signal_options(kind: str) -> Table:
    """What a file may say of a signal of this kind."""
    options = sys.modules[_KINDS[kind].__module__].OPTIONS
    parameters = inspect.signature(_KINDS[kind]).parameters
    keys = {name: options[name] for name in parameters if name in options}
    needed = tuple(name for name in keys if parameters[name].default is inspect.Parameter.empty)
    return Table(f"signal of kind {kind}", keys, needed=needed)


def make_signal(kind: str, **options: Any) -> Signal:
    """The signal of this `kind` with the options of its function, as words of a TOML table give them.

    Raises InputError for an unknown kind or option, one that is missing, or a value that will not do.
    """
    if kind not in _KINDS:
        raise InputError(f"there is no signal of kind {kind!r}; known kinds: {', '.join(_KINDS)}")
    parameters = inspect.signature(_KINDS[kind]).parameters
    check_known(options, parameters, f"signal of kind {kind!r}")
    missing = [name for name, p in parameters.items() if p.default is p.empty and name not in options]
    if missing:
        known = ", ".join(parameters)
        raise InputError(f"signal of kind {kind!r} needs {' and '.join(missing)}; its options are {known}")
    return _KINDS[kind](**options)
