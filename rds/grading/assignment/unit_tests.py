"""Unit tests of a submission's functions: called in the sandbox, judged here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

from rds.core.errors import InputError
from rds.core.toml_table import TomlTable
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

    def passes(self, submitted: Submitted) -> bool:
        """Whether it does; a function that fails or is not there does not. SubmissionError if it cannot go on."""
        try:
            answer = submitted.functions().call(self.function, list(self.args))
        except SubmissionError as error:
            if error.status is not Status.BROKE_CONTRACT:
                raise
            return False
        return is_near(answer, self.expected, self.tolerance)


def is_near(answer: Any, expected: Any, tolerance: float) -> bool:
    """Whether plain values are the same, numbers to within `tolerance`."""
    if isinstance(expected, bool) or isinstance(answer, bool):
        return answer is expected
    if isinstance(expected, int | float):
        if not isinstance(answer, int | float):
            return False
        try:
            return isfinite(answer) and abs(answer - expected) <= tolerance
        except OverflowError:  # an int of hundreds of digits
            return False
    if isinstance(expected, list):
        same = isinstance(answer, list) and len(answer) == len(expected)
        return same and all(is_near(a, e, tolerance) for a, e in zip(answer, expected, strict=True))
    if isinstance(expected, dict):
        same = isinstance(answer, dict) and answer.keys() == expected.keys()
        return same and all(is_near(answer[key], value, tolerance) for key, value in expected.items())
    return type(answer) is type(expected) and bool(answer == expected)


def failing(tests: Sequence[UnitTest], submitted: Submitted) -> list[UnitTest]:
    """Those that the submission does not pass. SubmissionError if it cannot go on."""
    return [test for test in tests if not test.passes(submitted)]


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
