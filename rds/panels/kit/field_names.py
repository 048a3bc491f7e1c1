"""Messages of the library in the words of the page: `--method simulation` is *Method: simulation* there.

An option that has a field is named by the field's label. What only a command can do says so: no advice of the page is
to be carried out by a flag that nobody can type there. Whole commands (`rds fit ...`) stay as they are, for a terminal.
"""

from __future__ import annotations

import re

# The options of commands that have a field of a panel, with its label.
FIELDS = {
    "method": "Method",
    "structure": "Structure",
    "option": "With",
    "map": "Map of its columns",
    "tools": "Tool table",
    "parameters": "Parameter file",
    "stock": "Stock",
    "part": "Intended part",
    "interpolator": "Motion",
    "controller": "Controller of the axes",
    "sample-period": "Sample period",
}
# What `--with` switches on.
DIALECT = {
    "program-numbers": "Program numbers",
    "default-feed": "Default feed",
    "open-end": "Open end",
    "block-delete": "Leave out / blocks",
}
_COMMAND = re.compile(r"`?\brds [a-z][^`;,)]*`?")
_WITH = re.compile(r"`?--with ([a-z][a-z-]*)`?")
_VALUES = r"simulation|inverse-dynamics|axis-mass|axis-inertia|axis|spindle|step|frequency|backlash"
_OPTION = re.compile(rf"`?--([a-z][a-z-]+)((?:[ =](?:[\w-]+=[\w.+-]+|[A-Z][A-Z,]*(?![a-z])|(?:{_VALUES})\b))?)`?")


def in_fields(message: str) -> str:
    """The message with each option named by its field, or as one of the command."""
    parts, last = [], 0
    for command in _COMMAND.finditer(message):
        parts += [_put(message[last : command.start()]), command[0]]
        last = command.end()
    return "".join([*parts, _put(message[last:])])


def _put(text: str) -> str:
    return _OPTION.sub(_named, _WITH.sub(_switched, text))


def _switched(found: re.Match[str]) -> str:
    return f"“{DIALECT[found[1]]}”" if found[1] in DIALECT else f"option {found[1]} of the command in a terminal"


def _named(found: re.Match[str]) -> str:
    name, value = found[1], found[2].strip(" =")
    if name in FIELDS:
        return f"“{FIELDS[name]}: {value}”" if value else f"“{FIELDS[name]}”"
    return f"option {name}{' ' + value if value else ''} of the command in a terminal"
