"""Errors of a student's code, reduced to the student's own lines."""

from __future__ import annotations

import linecache
import re
from pathlib import Path
from traceback import FrameSummary, extract_tb

from rds.core.errors import RdsError
from rds.core.traceback_frames import is_installed, place_of
from rds.core.types import Source

STUDENT_ERRORS = (Exception, SystemExit)
"""What a student's code may raise and its caller answers for; Ctrl-C is the user's."""

_ARRAYS_AS_NUMBERS = ("only 0-dimensional arrays can be converted", "inhomogeneous shape")  # numpy's words
_FROM_THE_CLOCK = re.compile(r"(?:/|//|%)\s*\(?\s*t\b")  # divided by what the time t stands in
_TUPLE_FOR_NUMBER = "can't multiply sequence by non-int of type 'float'"
_OF_REFERENCE = re.compile(r"'float' object has no attribute '(?:position|velocity|acceleration)'")
_UNPRINTABLE = "(its message cannot be printed)"
_LONGEST = 300  # characters of an exception's own text; some print whole arrays


def student_error(exc: BaseException, path_or_source: str | Path | Source | None = None) -> str:
    """One line that says where in the student's own code `exc` came from.

    `path_or_source` is the student's file, or the `Source` of a function written in a notebook. The innermost
    line of that file (or of a file next to it) is named; without one, the innermost line outside this package,
    the standard library and the installed packages. Gives for example
    "file.py, line 12, in control: ZeroDivisionError: division by zero: `u = 1 / y`".
    """
    path = path_or_source.path if isinstance(path_or_source, Source) else path_or_source
    try:
        return _student_error(exc, path)
    except STUDENT_ERRORS:  # its class is the student's own, or it was made with what it never holds else
        return f"{type.__repr__(type(exc))}: {_UNPRINTABLE}"


def _student_error(exc: BaseException, path: str | Path | None) -> str:
    if isinstance(exc, SyntaxError) and exc.filename and isinstance(exc.filename, str):
        line = (exc.text or "").strip()
        return _sentence(f"{Path(exc.filename).name}, line {exc.lineno}", type(exc).__name__, exc.msg, line)
    own = _own_frames(exc, path)
    if not own and isinstance(exc.__cause__, StopIteration):  # in a generator: its own error has no line
        own = _own_frames(exc.__cause__, path)
    if not own:
        return str(exc) if isinstance(exc, RdsError) else f"{type(exc).__name__}: {_text(exc)}"
    frame = own[-1]
    line = (frame.line or linecache.getline(frame.filename, frame.lineno or 0)).strip()
    where = place_of(frame)
    text = _text(exc)
    if isinstance(exc, ZeroDivisionError) and _FROM_THE_CLOCK.search(line):
        text += " (in the first call t is 0; divide by the sample period, a number of your own)"
    return _sentence(where, type(exc).__name__, text, line)


def is_students(exc: BaseException) -> bool:
    """Whether `exc` was raised in or below a line that belongs neither to this package nor to any installed one."""
    return bool(_own_frames(exc, None))


def student_line(exc: BaseException, path: str | Path) -> int | None:
    """The number of the innermost line of the file `path` on the way to `exc`."""
    if isinstance(exc, SyntaxError) and isinstance(exc.filename, str) and Path(exc.filename) == Path(path):
        return exc.lineno
    numbers = [frame.lineno for frame in extract_tb(exc.__traceback__) if Path(frame.filename) == Path(path)]
    return numbers[-1] if numbers else None


def _own_frames(exc: BaseException, path: str | Path | None) -> list[FrameSummary]:
    frames = extract_tb(exc.__traceback__)
    own = {
        name: _is_own(name, path) for name in {frame.filename for frame in frames}
    }  # a recursion has a thousand frames
    return [frame for frame in frames if own[frame.filename]]


def _is_own(filename: str, path: str | Path | None) -> bool:
    if path is not None:
        return Path(filename).parent == Path(path).resolve().parent and not is_installed(filename)
    return not filename.startswith("<frozen") and not is_installed(filename)


def is_tuple_for_number(exc: BaseException) -> bool:
    """Whether a number was multiplied with a list or tuple, such as 30,0 with a decimal comma."""
    return isinstance(exc, TypeError) and _TUPLE_FOR_NUMBER in _text(exc)


def _text(exc: BaseException) -> str:
    try:
        text = " ".join(str(exc)[: 10 * _LONGEST].split())
    except STUDENT_ERRORS:  # an exception class of the student's own may fail to print itself
        text = _UNPRINTABLE
    text = text if len(text) <= _LONGEST else text[:_LONGEST] + "…"
    if isinstance(exc, TypeError | AttributeError) and "'Reference'" in text:
        return f"{text} (r.position, r.velocity and r.acceleration are its numbers)"
    if type(exc) is TypeError and "for ^: " in text:
        return f"{text} (a power is written **)"
    if isinstance(exc, AttributeError) and _OF_REFERENCE.search(text):
        return f"{text} (r has it; y is the position itself)"
    if isinstance(exc, TypeError | ValueError) and any(said in text for said in _ARRAYS_AS_NUMBERS):
        return f"{text} (of an array of one number, such as a model's u, [0] is the number)"
    if isinstance(exc, IndexError) and "index out of range" in text:
        return f"{text} (the first value is [0]; of `state`, initial_state says how many there are)"
    if isinstance(exc, UnboundLocalError):
        return f"{text} (a function forgets its variables after each call: what is to last goes through `state`)"
    if type(exc) is TypeError and "'float' object is not subscriptable" in text:
        return f"{text} (it is one number, as r.position and y are with one axis: leave the [...] out)"
    if type(exc) is TypeError and _TUPLE_FOR_NUMBER in text:
        return f"{text} (a list or tuple stands where a number belongs; 30,0 is a tuple, 30.0 a number)"
    return f"{text} (the dict has no such key)" if type(exc) is KeyError else text  # its own text is the key alone


def _sentence(where: str, kind: str, text: str, line: str) -> str:
    said = f"{where}: {kind}: {text}" if text else f"{where}: {kind}"
    return f"{said}: `{line}`" if line else said
