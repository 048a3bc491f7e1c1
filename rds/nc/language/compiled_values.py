"""Values of a line (parameters, expressions, functions) as Python code, for lines that are executed again and again.

`Compiler` reads the same grammar as `expressions.Reader` and gives code instead of a value; what it does not know, or
takes for a fault, it refuses, and the reader says what is the matter. The code has the reader's own operations in its
order, so that a value is the same to the last bit. Text of the program gets into the code as numbers and as literals
of strings only.
"""

from __future__ import annotations

import math
from typing import Any

from rds.nc.language.expressions import (
    BINARY,
    DEEPEST,
    FUNCTION,
    NUMBER,
    OPERATION,
    PRECEDENCE,
    SPELLED,
    UNARY,
    Fault,
    arc_tangent,
    whole,
)
from rds.nc.language.parameters import COUNT, POSITION, Parameters

FAULTS = (Fault, ArithmeticError, LookupError, ValueError)  # of the code: the reader names what is wrong
_INLINE = frozenset("+-*/")  # a division by zero is a Python error as well
_TESTS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}


class Refused(Exception):
    """The text is not one for the compiler."""


def finite(value: float) -> float:
    """The value. Raises Fault for one that is not finite."""
    if not math.isfinite(value):
        raise Fault("the result is not a finite number")
    return value


def _not_negative(value: float) -> None:
    if value < 0.0:
        raise Fault("the value is negative")


def checked(code: str) -> str:
    """Code of a value that is finite, or raises Fault; expressions in brackets and functions are that already."""
    return code if code.startswith("finite(") else f"finite({code})"


def names_of(parameters: Parameters) -> dict[str, Any]:
    """What the code may use, besides its arguments n (numbered parameters), l and q (local and global names)."""
    return {
        "__builtins__": {},
        "atan": arc_tangent,
        "binary": BINARY,
        "declare": parameters.declare,
        "faults": FAULTS,
        "exists": lambda name: float(parameters.find(name) is not None),
        "finite": finite,
        "get": parameters.get,
        "has": lambda index: float(parameters.has(index)),
        "known": parameters.known,
        "not_negative": _not_negative,
        "settable": parameters.check_settable,
        "unary": UNARY,
        "whole": whole,
    }


class Compiler:
    """Reads values from a block's text, as `Reader` does; `at` is the next character. Each method gives code."""

    def __init__(self, text: str, parameters: Parameters, at: int):
        self.text = text
        self.at = at
        self._parameters = parameters
        self._depth = 0

    def peek(self) -> str:
        """The next character; "" at the end."""
        return self.text[self.at : self.at + 1]

    def expect(self, characters: str) -> None:
        if not self.text.startswith(characters, self.at):
            raise Refused
        self.at += len(characters)

    def value(self) -> str:
        """A number, a parameter, an expression in brackets or a function of one; with a sign, if any."""
        self._depth += 1
        first, second = self.peek(), self.text[self.at + 1 : self.at + 2]
        if not first or self._depth > DEEPEST:
            raise Refused
        if first == "[":
            found = self.expression()
        elif first == "#":
            found = self._parameter()
        elif first in "+-" and second and second not in "0123456789.":
            self.at += 1
            found = self.value()
            if first == "-":
                found = f"(-{found})"
        elif "a" <= first <= "z":
            found = f"finite({self._function()})"
        else:
            found = self._number()
        self._depth -= 1
        return found

    def _number(self) -> str:
        match = NUMBER.match(self.text, self.at)
        if match is None or not SPELLED.fullmatch(match[0]):
            raise Refused
        self.at = match.end()
        return f"({finite(float(match[0]))!r})"

    def expression(self) -> str:
        """[ value operation value ... ]: finite, or it raises Fault."""
        self.expect("[")
        values, operations = [self.value()], [self._operation()]
        while operations[0] != "]":
            values.append(self.value())
            operations.append(self._operation())
            while len(operations) > 1 and PRECEDENCE[operations[-1]] <= PRECEDENCE[operations[-2]]:
                right = values.pop()
                values[-1] = _joined(operations.pop(-2), values[-1], right)
        return f"finite({values[0]})"

    def _operation(self) -> str:
        match = OPERATION.match(self.text, self.at)
        if match is None:
            raise Refused
        self.at = match.end()
        return match[0]

    def _function(self) -> str:
        match = FUNCTION.match(self.text, self.at)
        if match is None:
            raise Refused
        self.at = match.end()
        name = match[0]
        if name == "exists":
            self.expect("[#")
            found = f"exists({self.name()!r})" if self.peek() == "<" else f"has(whole({self.value()}))"
            self.expect("]")
            return found
        argument = self.expression()
        if name != "atan":
            return f"unary[{name!r}]({argument})"
        self.expect("/")
        return f"atan({argument}, {self.expression()})"

    def _parameter(self) -> str:
        self.at += 1
        if self.peek() == "<":
            return self.named(self.name())
        index = self.index()
        if index.isdecimal() and 1 <= int(index) < COUNT and not POSITION <= int(index) < POSITION + 9:
            return f"n[{index}]"
        return f"get({index})"

    def named(self, name: str) -> str:
        if name in self._parameters.known:
            return f"known[{name!r}]()"
        return f"{'q' if name[:1] == '_' else 'l'}[{name!r}]"

    def index(self) -> str:
        """A value that is whole; digits, where it is a plain number."""
        found = self.value()
        try:
            return str(whole(float(found[1:-1])))
        except ValueError:
            return f"whole({found})"
        except Fault:
            raise Refused from None

    def name(self) -> str:
        """What stands between < and >."""
        end = self.text.find(">", self.at)
        if end < 0:
            raise Refused
        name = self.text[self.at + 1 : end]
        self.at = end + 1
        return name


def _joined(operation: str, left: str, right: str) -> str:
    if operation in _INLINE:
        return f"({left} {operation} {right})"
    if operation in _TESTS:
        return f"(1.0 if {left} {_TESTS[operation]} {right} else 0.0)"
    return f"binary[{operation!r}]({left}, {right})"
