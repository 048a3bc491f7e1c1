"""(DEBUG, ...) and (PRINT, ...): texts in which parameters stand with their values, as in LinuxCNC's interpreter."""

from __future__ import annotations

import re

from rds.nc.language.expressions import EQUAL, Fault
from rds.nc.language.parameters import Parameters

_PIECE = re.compile(r"#(?P<number>[0-9]+)|#<(?P<name>[^>]*)>|#<|%(?P<places>d|f|\.[0-9]f|\.)", re.ASCII)
_LONGEST = 29  # characters of a value
_NO_VALUE = "######"


def expanded(text: str, parameters: Parameters) -> str:
    """What the comment says. Values have six decimals; after `%d` none, after `%f` four, after `%.3f` three.

    `######` stands for what has no value. Fault for a name without its `>`.
    """
    places = 6

    def piece(found: re.Match[str]) -> str:
        nonlocal places
        if (form := found["places"]) is not None:
            if form == ".":  # more than one digit is no form: LinuxCNC takes the % away
                return "."
            places = {"d": 0, "f": 4}[form] if form in "df" else int(form[1])
            return ""
        if found["number"] is not None:
            number = int(found["number"][:_LONGEST])
            value = parameters.get(number) if parameters.has(number) else 0.0 if number == 0 else None
        elif found["name"] is not None:
            value = parameters.find("".join(found["name"].split()).lower())
        else:
            raise Fault("the name of the parameter has no end; write #<name>", "(")
        if value is None:
            return _NO_VALUE
        shown = f"{0.0 if abs(value) < EQUAL else value:.{places}f}"
        return shown if len(shown) <= _LONGEST else _NO_VALUE

    return _PIECE.sub(piece, text)
