"""Unit tests of a submission's functions: called in the sandbox, judged here."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

from rds.core.errors import InputError
from rds.core.toml_table import TomlTable
from rds.core.values import shown
from rds.grading.cases.case import Submitted
from rds.grading.grade import Status
from rds.grading.sandbox.errors import SubmissionError

_LONGEST_CALL = 80  # characters of the arguments


@dataclass(frozen=True)
class UnitTest:
    """`function(*args)` must return `expected`: each number within `tolerance` of it, all else the same."""

    function: str
    args: tuple[Any, ...]
    expected: Any
    tolerance: float

    @property
    def call(self) -> str:
        """The call in words, without what is expected of it."""
        said = ", ".join(map(repr, self.args))
        return f"{self.function}({said if len(said) <= _LONGEST_CALL else said[:_LONGEST_CALL] + '…'})"

    def fault(self, submitted: Submitted) -> str:
        """Why it does not: empty if it does. SubmissionError if the submission cannot go on."""
        try:
            answer = submitted.functions().call(self.function, list(self.args))
        except SubmissionError as error:
            if error.status is not Status.BROKE_CONTRACT:
                raise
            return error.reason
        return difference(answer, self.expected, self.tolerance)


def difference(answer: Any, expected: Any, tolerance: float, what: str = "it returned") -> str:
    """How plain values differ, without what is expected; empty if they are the same, numbers to within `tolerance`."""
    if _kind(answer) != _kind(expected) or (isinstance(expected, dict) and answer.keys() != expected.keys()):
        return f"{what} {_kind(answer)}, where {_kind(expected)} is expected"
    if isinstance(expected, list | dict):
        places: Iterable[Any] = range(len(expected)) if isinstance(expected, list) else expected
        found = (difference(answer[at], expected[at], tolerance, f"its value {at!r} is") for at in places)
        return next(filter(None, found), "")
    if isinstance(expected, int | float) and not isinstance(expected, bool):
        return (
            "" if _is_near(answer, expected, tolerance) else f"{what} {shown(answer)}, off by more than {tolerance:g}"
        )
    return "" if answer == expected else f"{what} {shown(answer)}, and that is not right"


def _kind(value: Any) -> str:
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, dict):
        return f"a dict with the keys {shown(sorted(value))}" if value else "an empty dict"
    if value is None or isinstance(value, bool):
        return "None" if value is None else "a truth value"
    return "a number" if isinstance(value, int | float) else "a text"


def _is_near(answer: float, expected: float, tolerance: float) -> bool:
    try:
        return isfinite(answer) and abs(answer - expected) <= tolerance
    except OverflowError:  # an int of hundreds of digits
        return False


def failing(tests: Sequence[UnitTest], submitted: Submitted) -> list[tuple[UnitTest, str]]:
    """Those that the submission does not pass, each with the reason. SubmissionError if it cannot go on."""
    return [(test, fault) for test in tests if (fault := test.fault(submitted))]


def read_tests(words: TomlTable) -> tuple[UnitTest, ...]:
    """The tables `[[criterion.test]]`. InputError with the place of what will not do."""
    return tuple(_test(table) for table in words.tables("test"))


def _test(words: TomlTable) -> UnitTest:
    function, args = words.read("function"), words.any("args", [])
    if not function or not function.isidentifier():
        raise InputError(f"function = {function!r} must be the name of a function", words.place("function"))
    if not isinstance(args, list):
        raise words.fault("args", "must be a list of the function's arguments")
    if "expected" not in words:
        raise InputError("expected is missing; give what the function must return", words.place())
    expected, tolerance = words.any("expected"), words.read("tolerance")
    for key, value in (("args", args), ("expected", expected)):
        if not _is_plain(value):
            raise words.fault(key, "must be made of finite numbers, texts, true, false, lists and tables")
    words.done()
    return UnitTest(function, tuple(args), expected, tolerance)


def _is_plain(value: Any) -> bool:
    if isinstance(value, list):
        return all(map(_is_plain, value))
    if isinstance(value, dict):
        return all(map(_is_plain, value.values()))
    return isinstance(value, bool | str) or (isinstance(value, int | float) and isfinite(value))
