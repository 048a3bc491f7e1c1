"""What the editor offers while one types: the names of an interface with their units, and the file's own params."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import TypedDict

from rds.panels.session.file_params import FileParam


class Word(TypedDict):
    """One of them. `after` is what stands before it: "r" for r.position, "params" for params["Kp"], "" for none."""

    after: str
    label: str
    detail: str  # its unit, or kind
    info: str  # what it means


def _word(after: str, label: str, detail: str, info: str) -> Word:
    return {"after": after, "label": label, "detail": detail, "info": info}


_PARAMS = _word("", "params", "dict", "your numbers by name: the file's, or what was put in their place on the page")
_PERIOD = _word("", "T", "s", "sample period")
_INITIAL = _word("", "initial_state", "list", "the state before the first sample")
_WORDS: Mapping[str, tuple[Word, ...]] = MappingProxyType(
    {
        "controller": (
            _word("r", "position", "mm", "where the axis should be"),
            _word("r", "velocity", "mm/s", "how fast it should move"),
            _word("r", "acceleration", "mm/s²", "how its velocity should change"),
            _word("", "r", "reference", "r.position, r.velocity, r.acceleration: what the axis should do"),
            _word("", "y", "mm", "the measured position"),
            _word("", "t", "s", "time since the run began"),
            _word("", "state", "list", "what control() returned last; at first initial_state"),
            _word("", "control", "function", "control(t, r, y, state, params) returns (voltage [V], next state)"),
            _INITIAL,
            _PARAMS,
        ),
        "model": (
            _word("", "x", "list", "the state: x[0] position [mm], x[1] velocity [mm/s]"),
            _word("", "u", "list", "the input: u[0] voltage [V]"),
            _word("", "t", "s", "time since the run began"),
            _word("", "derivatives", "function", "derivatives(t, x, u, params) returns the rate of change of x"),
            _word("", "advance", "function", "advance(x, u, T, params) returns x one sample later, exactly"),
            _word("", "output", "function", "output(t, x, u, params) returns what the encoder sees, mm"),
            _INITIAL,
            _PERIOD,
            _PARAMS,
        ),
        "interpolator": (
            _word("segment", "start", "mm", "where it begins, one value per axis"),
            _word("segment", "end", "mm", "where it ends, one value per axis"),
            _word("segment", "feed_rate", "mm/s", "velocity along the path"),
            _word("segment", "centre", "mm", "of an arc, one value per axis"),
            _word("segment", "clockwise", "bool", "of an arc, seen from the positive end of the third axis"),
            _word("segment", "plane", "axes", "of an arc: the two axes of its plane, by index"),
            _word("", "segment", "segment", "a LineSegment or an ArcSegment"),
            _word("", "interpolate", "function", "interpolate(segment, T, params) yields one row per sample"),
            _word("", "LineSegment", "class", "a straight move: from rds import LineSegment"),
            _word("", "ArcSegment", "class", "an arc or a helix: from rds import ArcSegment"),
            _PERIOD,
            _PARAMS,
        ),
    }
)
_MATHS = ("sin", "cos", "tan", "atan2", "sqrt", "exp", "log", "hypot", "copysign", "floor", "ceil", "pi")
_ARRAYS = ("array", "zeros", "clip", "sign", "sin", "cos", "sqrt", "exp", "abs", "dot", "linalg", "interp", "pi")


def words(role: str, params: Iterable[FileParam]) -> list[Word]:
    """What to offer in a file of `role` that has these `params`."""
    found = list(_WORDS[role])
    found += [_word("params", each.name, f"{each.value:g}", each.comment or "of your params") for each in params]
    found += [_word("math", name, "math", "import math") for name in _MATHS]
    found += [_word("np", name, "numpy", "import numpy as np") for name in _ARRAYS]
    return found
