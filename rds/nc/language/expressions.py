"""Numbers, parameters and expressions in brackets, as LinuxCNC reads and works them out.

Angles are in degrees. Sines, cosines and tangents are worked out in extended precision where the machine has it, as
LinuxCNC does, so that for example the sign of COS[90], which is 0 but for rounding, is the same.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rds.nc.language.parameters import Parameters

EQUAL = 1e-4  # numbers that differ by less are EQ (LinuxCNC's TOLERANCE_EQUAL)
WHOLE = 1e-4  # a number this close to a whole one is whole
DEEPEST = 50  # brackets and # inside one another

NUMBER = re.compile(r"[+-]*[0-9.]*")
SPELLED = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)")
_OUTSIDE_ASCII = re.compile(r"[\x80-\xff]+")
_MINUS = "\N{MINUS SIGN}".encode().decode("latin-1")  # a program's text is read byte by byte
FUNCTION = re.compile(r"abs|acos|asin|atan|cos|exists|exp|fix|fup|ln|round|sin|sqrt|tan")
_NAME = re.compile(r"[a-z][a-z0-9_]*")
OPERATION = re.compile(r"\*\*|[-+*/\]]|and|mod|or|xor|eq|ne|ge|gt|le|lt")
PRECEDENCE = {
    **dict.fromkeys(("and", "or", "xor"), 2),
    **dict.fromkeys(("eq", "ne", "ge", "gt", "le", "lt"), 3),
    **dict.fromkeys("+-", 4),
    **dict.fromkeys(("*", "/", "mod"), 5),
    "]": 1,
    "**": 6,
}
_NOT_FINITE = "the result is not a finite number; check the expression"
_FUNCTIONS_TEXT = "ABS, ACOS, ASIN, ATAN[]/[], COS, EXISTS, EXP, FIX, FUP, LN, ROUND, SIN, SQRT, TAN"


class Fault(Exception):
    """Something wrong in the block being read or executed: at a character of its text, or with one of its words.

    `key` is a letter ("x"), or a G or M word ("g20" is G2, "m3" is M3) of the block.
    """

    def __init__(self, message: str, key: str = "", at: int = -1):
        super().__init__(message)
        self.message = message
        self.key = key
        self.at = at


class Reader:
    """Reads values from a block's text: lower case, without blanks; `at` is the next character."""

    def __init__(self, text: str, parameters: Parameters, at: int = 0):
        self.text = text
        self.at = at
        self.parameters = parameters
        self._depth = 0

    def peek(self) -> str:
        """The next character; "" at the end."""
        return self.text[self.at : self.at + 1]

    def fault(self, message: str) -> Fault:
        return Fault(message, at=self.at)

    def expect(self, character: str, why: str) -> None:
        if self.peek() != character:
            raise self.fault(why)
        self.at += 1

    def value(self) -> float:
        """A number, a parameter, an expression in brackets or a function of one; with a sign, if any."""
        text, at = self.text, self.at
        first = text[at : at + 1]
        if not first:
            raise self.fault("a number is missing; write one, a parameter #... or an expression [...]")
        self._depth += 1
        if self._depth > DEEPEST:
            raise self.fault(f"brackets and signs are nested more than {DEEPEST} deep; use a parameter in between")
        second = text[at + 1 : at + 2]
        if first == "[":
            found = self.expression()
        elif first == "#":
            found = self.parameter()
        elif first in "+-" and second and second not in "0123456789.":
            self.at += 1
            found = self.value()
            if first == "-":
                found = -found
        elif "a" <= first <= "z":
            found = self._function()
        else:
            found = self._number()
        self._depth -= 1
        if not math.isfinite(found):
            self.at = at
            raise self.fault(_NOT_FINITE)
        return found

    def _number(self) -> float:
        match = NUMBER.match(self.text, self.at)
        spelled = match[0] if match else ""
        if not SPELLED.fullmatch(spelled):
            if spelled:
                raise self.fault(f"{spelled!r} is no number; write one like -12.5")
            raise self.fault(f"a number cannot begin with {self._character()}; write one like -12.5")
        self.at += len(spelled)
        return float(spelled)

    def integer(self) -> int:
        """A value that is whole to within WHOLE."""
        at = self.at
        try:
            return whole(self.value())
        except Fault as fault:
            if fault.at < 0:
                fault.at = at
            raise

    def expression(self) -> float:
        """[ value operation value ... ] by precedence: **; * / MOD; + -; EQ NE GT GE LT LE; AND OR XOR."""
        start = self.at
        self.expect("[", "a left bracket [ is missing; write the value as [...]")
        values = [self.value()]
        operations = [self._operation()]
        while operations[0] != "]":
            values.append(self.value())
            operations.append(self._operation())
            while len(operations) > 1 and PRECEDENCE[operations[-1]] <= PRECEDENCE[operations[-2]]:
                right = values.pop()
                try:
                    values[-1] = BINARY[operations.pop(-2)](values[-1], right)
                except Fault as fault:
                    fault.at = start
                    raise
        if not math.isfinite(values[0]):
            raise Fault(_NOT_FINITE, at=start)
        return values[0]

    def _operation(self) -> str:
        match = OPERATION.match(self.text, self.at)
        if match is None:
            if not self.peek():
                raise self.fault("the expression is not closed; add ]")
            raise self.fault(
                f"{self.peek()!r} begins no operation; use ** * / MOD + - EQ NE GT GE LT LE AND OR XOR or close with ]"
            )
        self.at = match.end()
        return match[0]

    def _character(self) -> str:
        """The next character as it is meant; outside of ASCII it is several bytes."""
        match = _OUTSIDE_ASCII.match(self.text, self.at)
        if match is None:
            return repr(self.peek())
        if match[0].startswith(_MINUS):
            return f"'{_MINUS}', a minus sign of a word processor; the one of programs is -"
        return f"'{match[0]}'"

    def _function(self) -> float:
        match = FUNCTION.match(self.text, self.at)
        if match is None:
            if self.text[self.at - 1 : self.at] == "#" and (bare := _NAME.match(self.text, self.at)):
                raise self.fault(f"the name of a parameter stands in < >; write #<{bare[0]}>")
            raise self.fault(f"a value cannot begin with {self._character()}; functions are {_FUNCTIONS_TEXT}")
        at, name = self.at, match[0]
        self.at = match.end()
        if self.peek() != "[":
            raise self.fault(f"{name.upper()} needs its argument in brackets; write {name.upper()}[...]")
        if name == "exists":
            return self._exists()
        argument = self.expression()
        try:
            if name != "atan":
                return UNARY[name](argument)
            self.expect("/", "ATAN needs two arguments; write ATAN[y]/[x]")
            return arc_tangent(argument, self.expression())
        except Fault as fault:
            if fault.at < 0:
                fault.at = at
            raise

    def _exists(self) -> float:
        self.at += 1
        self.expect("#", "EXISTS asks for a parameter; write EXISTS[#<name>] or EXISTS[#5]")
        if self.peek() == "<":
            found = self.parameters.find(self.name()) is not None
        else:
            found = self.parameters.has(self.integer())
        self.expect("]", "EXISTS asks for one parameter; close with ]")
        return float(found)

    def parameter(self) -> float:
        """The value of #number or #<name>."""
        at = self.at
        self.at += 1
        if self.peek() == "<":
            name = self.name()
            found = self.parameters.find(name)
            if found is None:
                where = (
                    " (LinuxCNC takes it from its INI file, which is not read here)" if name.startswith("_ini[") else ""
                )
                raise Fault(f"the parameter #<{name}> has no value{where}; set it before with #<{name}> = ...", at=at)
            return found
        index = self.integer()
        try:
            return self.parameters.get(index)
        except Fault as fault:
            fault.at = at
            raise

    def name(self) -> str:
        """What stands between < and >."""
        end = self.text.find(">", self.at)
        if end < 0:
            raise self.fault("the name is not closed; add >")
        name = self.text[self.at + 1 : end]
        self.at = end + 1
        return name


def whole(value: float) -> int:
    """The whole number that `value` is, to within WHOLE. Raises Fault."""
    below = math.floor(value)
    if value - below > 1 - WHOLE:
        return math.ceil(value)
    if value - below > WHOLE:
        raise Fault(f"{value:g} is not whole; write a whole number")
    return below


def _divide(left: float, right: float) -> float:
    if right == 0.0:
        raise Fault("division by zero; check the expression")
    return left / right


def _modulo(left: float, right: float) -> float:
    if right == 0.0 or not math.isfinite(left):
        raise Fault("the remainder of a division by zero; check the expression")
    rest = math.fmod(left, right)
    return rest + abs(right) if rest < 0.0 else rest


def _power(left: float, right: float) -> float:
    if left < 0.0 and not right.is_integer():
        raise Fault("a negative number to a power that is not whole; check the expression")
    try:
        return math.pow(left, right)
    except (OverflowError, ValueError):
        return math.inf


def _truth(test: Callable[[float, float], bool]) -> Callable[[float, float], float]:
    return lambda left, right: float(test(left, right))


BINARY: dict[str, Callable[[float, float], float]] = {
    "**": _power,
    "*": lambda left, right: left * right,
    "/": _divide,
    "mod": _modulo,
    "+": lambda left, right: left + right,
    "-": lambda left, right: left - right,
    "eq": _truth(lambda left, right: abs(left - right) < EQUAL),
    "ne": _truth(lambda left, right: abs(left - right) >= EQUAL),
    "gt": _truth(lambda left, right: left > right),
    "ge": _truth(lambda left, right: left >= right),
    "lt": _truth(lambda left, right: left < right),
    "le": _truth(lambda left, right: left <= right),
    "and": _truth(lambda left, right: left != 0.0 and right != 0.0),
    "or": _truth(lambda left, right: left != 0.0 or right != 0.0),
    "xor": _truth(lambda left, right: (left == 0.0) != (right == 0.0)),
}


@cache
def _extended() -> Mapping[str, Callable[[float], float]]:
    """Functions of angles in extended precision; for the programs that have an angle."""
    from rds.nc.language.extended_angles import functions

    return functions()


def _circular(name: str) -> Callable[[float], float]:
    return lambda degrees: _extended()[name](degrees)


def _degrees(radians: float) -> float:
    return _extended()["degrees"](radians * 180.0)


def arc_tangent(y: float, x: float) -> float:
    """ATAN[y]/[x], degrees."""
    return _degrees(math.atan2(y, x))


def _arc(function: Callable[[float], float]) -> Callable[[float], float]:
    def angle(argument: float) -> float:
        if not -1.0 <= argument <= 1.0:
            raise Fault(f"a number from -1 to 1 is asked for, and got {argument:g}; check the expression")
        return _degrees(function(argument))

    return angle


def _exponential(argument: float) -> float:
    try:
        return math.exp(argument)
    except OverflowError:
        return math.inf


def _logarithm(argument: float) -> float:
    if argument <= 0.0:
        raise Fault(f"a positive number is asked for, and got {argument:g}; check the expression")
    return math.log(argument)


def _root(argument: float) -> float:
    if argument < 0.0:
        raise Fault(f"a number from 0 is asked for, and got {argument:g}; check the expression")
    return math.sqrt(argument)


UNARY: dict[str, Callable[[float], float]] = {
    "abs": lambda argument: -argument if argument < 0.0 else argument,
    "acos": _arc(math.acos),
    "asin": _arc(math.asin),
    "cos": _circular("cos"),
    "exp": _exponential,
    "fix": lambda argument: float(math.floor(argument)),
    "fup": lambda argument: float(math.ceil(argument)),
    "ln": _logarithm,
    "round": lambda argument: float(int(argument + (-0.5 if argument < 0.0 else 0.5))),
    "sin": _circular("sin"),
    "sqrt": _root,
    "tan": _circular("tan"),
}
