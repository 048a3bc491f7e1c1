"""A fault as it stands below its line: what went wrong without what the line itself shows, and what to do."""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import get_close_matches

from rds.core.types import Reference
from rds.panels.equipment.build import Mark

_PLACE = re.compile(r"(?:in )?[^\s:,]+\.py, line \d+(?:, in \w+)?: ")
_QUOTED = re.compile(r": `[^`]*`(?=\s*\(rule:|$|;)")
_RULE = re.compile(r" \(rule: [^()]*\)$")
_NO_ATTRIBUTE = r"'Reference' object has no attribute '(\w+)'"
_IMPORTS = {"np": "import numpy as np", "numpy": "import numpy", "math": "import math"}
_MATHS = ("sin", "cos", "tan", "sqrt", "exp", "pi", "atan2", "hypot", "copysign", "floor", "ceil", "dist")


def told(mark: Mark, text: str, params: Iterable[str]) -> Mark:
    """The mark as it is read below its line of `text`; `params` are the names of the file's params."""
    if mark.line is None:
        return mark
    said = _RULE.sub("", _QUOTED.sub("", _PLACE.sub("", mark.text)))
    said = re.sub(rf"({_NO_ATTRIBUTE}) \(.*?\)", r"\1", said)  # the advice names r's numbers
    known = {*params, *re.findall(r"\b[A-Za-z_]\w*", re.sub(r"#.*|([\"']).*?\1", "", text))}
    advice = _advice(said, list(params), known)
    return Mark(mark.line, f"{said}. {advice}" if advice else said, mark.fault)


def _advice(said: str, params: list[str], known: set[str]) -> str:
    if found := re.search(_NO_ATTRIBUTE, said):
        near = get_close_matches(found[1], Reference._fields, 1, 0.5)
        return f"{f'Did you mean r.{near[0]}? ' if near else ''}r has {', '.join(Reference._fields)}"
    if found := re.search(r"KeyError: '(\w+)'", said):
        near = get_close_matches(found[1], params, 1, 0.5)
        mean = f'Did you mean params["{near[0]}"]? ' if near else ""
        return (
            f"{mean}Write it into params at the top; there {'are ' + ', '.join(params) if params else 'is nothing yet'}"
        )
    if found := re.search(r"name '(\w+)' is not defined", said):
        name = found[1]
        if name in _IMPORTS or name in _MATHS:
            return f"Write `{_IMPORTS.get(name, f'from math import {name}')}` at the top of the file"
        if name in params:
            return f'Write params["{name}"]'
        near = get_close_matches(name, known - {name}, 1, 0.7)
        return f"Did you mean {near[0]}?" if near else "Give it a value before this line"
    if "ZeroDivisionError" in said:
        return "In the first sample everything may be zero: ask for that before you divide"
    if "IndexError" in said:
        return "initial_state must have as many values as you take out of the state"
    if "'NoneType'" in said:
        return "A function without `return` gives None"
    return ""
