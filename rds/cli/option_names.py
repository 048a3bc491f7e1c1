"""Messages of the library in the words of a command's options: `step height = 0` is `--step-height 0` there."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager

# What the library calls otherwise than the options of `rds nc make`.
_CALLED = {"safe height": "safe", "spindle speed": "spindle", "corners": "corner", "moves": "move"}
_VALUE = re.compile(r"(?P<before>^|: |, )(?P<name>[a-z]+(?: [a-z]+)?) = ")
# Phrases (patterns) in which an option is named without its value.
_PHRASES = (
    ("step angle and tolerance both", "--step-angle and --tolerance both"),
    ("choose another level, or invert", "choose another --level, or --invert"),
    ("arcs need a tolerance", "--arcs needs a --tolerance"),
    (r"or name it(?= \(mm, in\))", "or name it with --unit"),
    ("take a step width", "take a --step-width"),
    ("a larger step height", "a larger --step-height"),
    ("start and end are the same", "--start and --end are the same"),
    (r"unit (?='[^']*' is not known)", "--unit "),
    (r"^(start|end|corner|move|centre|at|level) (?='.*' is not numbers)", r"--\1 "),
)


def in_options(message: str, options: Collection[str]) -> str:
    """The message with each value named by its option, of those that there are (without --)."""

    def option(found: re.Match[str]) -> str:
        name = _CALLED.get(found["name"], found["name"]).replace(" ", "-")
        return f"{found['before']}--{name} = " if name in options else found[0]

    said = _VALUE.sub(option, message)
    for phrase, other in _PHRASES:
        said = re.sub(phrase, other, said)
    return said


@contextmanager
def named_by_options(options: Collection[str]) -> Iterator[None]:
    """An InputError of what is done here names the command's options."""
    from rds.core.errors import InputError

    try:
        yield
    except InputError as error:
        where = error.where
        message = str(error) if where is None else str(error).removeprefix(f"{where}: ")
        raise InputError(in_options(message, options), where) from error
