"""Quantities and other settings, declared once: meaning, unit, range, default, and whether a run may change them.

A declaration is the one place where these facts stand; the key of its table is its name. The reader of TOML files
(toml_table.py), Python's arguments, the options of commands, the fields of panels, live values, the JSON Schemas
(`rds schema`) and the tables of docs/ all take them from it, so a value that one door refuses is refused by every door,
with the same sentence.

They are plain dataclasses. Tried beside them on a machine's file: to import, pydantic takes 1.4 s, msgspec and attrs
0.4 s and dataclasses 0.15 s on the same busy computer; pydantic's message is three lines with a web address, msgspec's
leaves out the value and the name of the axis, attrs with cattrs accepts `bits = "12"`, and none knows file, line and
remedy.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from itertools import pairwise
from math import inf, isfinite, isnan, nan
from numbers import Real
from typing import Any, NamedTuple, Protocol

from rds.core.errors import InputError

_BEGINNING = 3  # letters by which a word is taken for another that begins alike


class Declaration(Protocol):
    """What a value may be."""

    @property
    def meaning(self) -> str:
        """What the value means, in a few words."""

    @property
    def default(self) -> Any:
        """What holds where nothing is given; None: it depends, or there is nothing."""

    def fault(self, value: Any) -> str | None:
        """Why `value` is refused, as the end of a sentence that begins with name and value; None if it is not."""

    def taken(self, value: Any) -> Any:
        """An accepted value as it is used."""


def checked(declaration: Declaration, value: Any, name: str, owner: str = "") -> Any:
    """The value as it is used; InputError that begins with owner, name and value if it is refused."""
    if (fault := declaration.fault(value)) is not None:
        is_hexadecimal = getattr(declaration, "hexadecimal", False) and type(value) is int
        shown = f"{value:#x}" if is_hexadecimal else shortened(value)
        raise InputError(f"{f'{owner}: ' if owner else ''}{name} = {shown} {fault}")
    return declaration.taken(value)


def shortened(value: Any, longest: int = 200) -> str:
    """The value as messages show it."""
    try:
        shown = f"{value!r:.{longest}}"
        return " ".join(shown.split()) if "\n" in shown else shown  # an array's, of several lines
    except ValueError:  # Python writes no whole number of more than 4300 digits
        return "a number of thousands of digits"


def listed(values: Mapping[str, Any], most: int = 8) -> str:
    """Names and values in one line, as in `tau = 0.01, K = 1.76`; "…" stands for those after `most`."""
    said = [f"{name} = {f'{v:.6g}' if isinstance(v, float) else shortened(v, 40)}" for name, v in values.items()]
    return ", ".join(said[:most] + ["…"] * (len(said) > most))


def near(word: Any, known: Sequence[str]) -> str:
    """The hint at the known word that is nearest to `word`; empty if none is near."""
    meant = _nearest(str(word), known)
    return f"; did you mean '{meant}'?" if meant else ""


def _nearest(word: str, known: Sequence[str]) -> str | None:
    """The same word in capital or small letters; else a near one that begins alike, one that does, or a near one."""
    close = get_close_matches(word, known, n=3)
    same = [name for name in known if name.casefold() == word.casefold()]
    alike = [name for name in known if len(word) >= _BEGINNING and name[:_BEGINNING] == word[:_BEGINNING]]
    both = [name for name in close if name in alike]
    meant = same or both or (alike if len(alike) == 1 else close)
    return meant[0] if meant else None


@dataclass(frozen=True)
class Quantity:
    """A number in `unit`, from `low` to `high`, and more than `above`."""

    meaning: str
    unit: str = ""
    low: float = -inf
    high: float = inf
    above: float = -inf
    default: float | None = None
    whole: bool = False
    infinite: bool = False  # +inf is a sensible value
    live: bool = False  # it may change while a run goes on
    hexadecimal: bool = False  # a whole number that is written so, such as an identifier

    def check(self, value: Any, name: str, owner: str = "") -> Any:
        """The value as a float (int where it is whole); InputError with name, value and range if it will not do."""
        return checked(self, value, name, owner)

    def fault(self, value: Any) -> str | None:
        """Why `value` is refused; None if it is not."""
        said = f" ({self.meaning})" if self.meaning else ""
        if isinstance(value, bool) or not isinstance(value, Real):
            quotes = ", without quotes" if isinstance(value, str) else ""
            return f"must be {self.range if self.whole else self._number('a number')}{quotes}{said}"
        number = _as_float(value)
        if isnan(number) or (number == inf and not self.infinite and self.high == inf) or number == -inf == self.low:
            return f"must be {self.range if self.whole else self._number('a finite number')}{said}"
        if not self.low <= number <= self.high or number <= self.above or (self.whole and number != int(number)):
            return f"must be {self.range}{said}"
        return None

    def taken(self, value: Any) -> float | int:
        """An accepted number as a float, or an int where it is whole."""
        return int(value) if self.whole else float(value)

    @property
    def range(self) -> str:
        """The range in words, with the unit: "from 0 to 10 s"."""
        low, high = max(self.low, self.above), self.high
        is_open = isfinite(self.above) and self.above >= self.low
        if isfinite(low) and isfinite(high):
            between = f"more than {self._shown(low)} and at most" if is_open else f"from {self._shown(low)} to"
            text = f"{between} {self._shown(high)}{self._unit}"
        elif isfinite(low):
            text = f"{'more than' if is_open else 'at least'} {self._shown(low)}{self._unit}"
        elif isfinite(high):
            text = f"at most {self._shown(high)}{self._unit}"
        else:
            return self._number("a whole number" if self.whole else "a number")
        of = "of " if text.startswith("at ") else ""
        return f"a whole number {of}{text}" if self.whole else text

    def schema(self) -> dict[str, Any]:
        """Its JSON Schema."""
        made: dict[str, Any] = {"type": "integer" if self.whole else "number", "description": self.described}
        bounds = {"minimum": self.low, "maximum": self.high, "exclusiveMinimum": self.above}
        made |= {key: int(v) if v == int(v) else v for key, v in bounds.items() if isfinite(v)}
        return made if self.default is None or self.default == inf else made | {"default": self.taken(self.default)}

    @property
    def described(self) -> str:
        """Meaning and unit."""
        return ", ".join(part for part in (self.meaning, self.unit) if part)

    def _number(self, words: str) -> str:
        return f"{words} in {self.unit}" if self.unit else words

    def _shown(self, number: float) -> str:
        if self.whole:
            return f"{int(number):#x}" if self.hexadecimal and number > 9 else f"{int(number)}"
        return f"{number:g}"

    @property
    def _unit(self) -> str:
        return f" {self.unit}" if self.unit else ""


def _as_float(value: Any) -> float:
    try:
        return float(value)
    except OverflowError:  # a whole number of hundreds of digits
        return nan


@dataclass(frozen=True)
class Choice:
    """One of several words. `choices` may be a function, so that the list is made where it is needed."""

    meaning: str
    choices: Sequence[str] | Callable[[], Sequence[str]]
    default: str | None = None

    @property
    def known(self) -> tuple[str, ...]:
        """The words there are."""
        return tuple(self.choices() if callable(self.choices) else self.choices)

    def fault(self, value: Any) -> str | None:
        """Why `value` is refused; None if it is not."""
        known = self.known
        if isinstance(value, str) and value in known:
            return None
        return f"is unknown; known: {', '.join(known)}{near(value, known)}"

    def taken(self, value: Any) -> str:
        """The word."""
        return str(value)

    def schema(self) -> dict[str, Any]:
        """Its JSON Schema."""
        return _with_default({"type": "string", "enum": list(self.known), "description": self.meaning}, self.default)


@dataclass(frozen=True)
class Flag:
    """True or false."""

    meaning: str
    default: bool | None = None

    def fault(self, value: Any) -> str | None:
        """Why `value` is refused; None if it is not."""
        return None if isinstance(value, bool) else "must be true or false"

    def taken(self, value: Any) -> bool:
        """The truth value."""
        return bool(value)

    def schema(self) -> dict[str, Any]:
        """Its JSON Schema."""
        return _with_default({"type": "boolean", "description": self.meaning}, self.default)


@dataclass(frozen=True)
class Text:
    """A text."""

    meaning: str
    default: str | None = None

    def fault(self, value: Any) -> str | None:
        """Why `value` is refused; None if it is not."""
        return None if isinstance(value, str) else "must be a text in quotes"

    def taken(self, value: Any) -> str:
        """The text."""
        return str(value)

    def schema(self) -> dict[str, Any]:
        """Its JSON Schema."""
        return _with_default({"type": "string", "description": self.meaning}, self.default)


@dataclass(frozen=True)
class Items:
    """A list of `count` values (None: any number of at least `least`). `form` says what it must be, after "must be"."""

    meaning: str
    item: Declaration
    form: str
    count: int | None = None
    least: int = 0
    rising: bool = False  # each number is larger than the one before
    default: Any = None

    def fault(self, value: Any) -> str | None:
        """Why `value` is refused; None if it is not."""
        right = isinstance(value, list | tuple) and all(self.item.fault(item) is None for item in value)
        right = right and (len(value) >= self.least if self.count is None else len(value) == self.count)
        if right and not (self.rising and any(a >= b for a, b in pairwise(value))):
            return None
        return f"must be {self.form} ({self.meaning})"

    def taken(self, value: Any) -> tuple[Any, ...]:
        """The values as a tuple."""
        return tuple(self.item.taken(item) for item in value)

    def schema(self) -> dict[str, Any]:
        """Its JSON Schema."""
        made = {"type": "array", "items": schema_of(self.item), "description": f"{self.meaning}: {self.form}"}
        if self.count is not None:
            return made | {"minItems": self.count, "maxItems": self.count}
        return made | ({"minItems": self.least} if self.least else {})


@dataclass(frozen=True)
class AnyValue:
    """A value whose form is the business of the part that takes it. `forms` tells an editor what they may be."""

    meaning: str
    forms: Sequence[Any] = ()  # declarations
    default: Any = None

    def fault(self, value: Any) -> str | None:
        """Nothing is refused here."""
        return None

    def taken(self, value: Any) -> Any:
        """The value."""
        return value

    def schema(self) -> dict[str, Any]:
        """Its JSON Schema."""
        forms = [schema_of(form) for form in self.forms]
        return {"description": self.meaning} | ({"anyOf": forms} if forms else {})


class Parts(NamedTuple):
    """The parts of a library that a table may name: what they are called, and the table of each, made on use."""

    names: Callable[[], Sequence[str]]
    table: Callable[[str], Table]


@dataclass(frozen=True)
class Table:
    """A table of a file: what its keys hold, and (`others`) what keys of any other name do; None: there are none.

    `needed` names the keys without which it is refused. Of a table that names a part of the library under `chosen_by`,
    `parts` has the table of each part; `keys` stand beside it, or (`alone`) in a table that names no part.
    """

    meaning: str
    keys: Mapping[str, Declaration] = field(default_factory=dict)
    others: Declaration | None = None
    needed: tuple[str, ...] = ()
    chosen_by: str = ""
    parts: Parts | None = None
    alone: bool = False
    default: None = None

    def fault(self, value: Any) -> str | None:
        """Why `value` is refused as a whole; its keys are read one by one."""
        return None if isinstance(value, Mapping) else "must be a table"

    def taken(self, value: Any) -> dict[str, Any]:
        """The table as it is."""
        return dict(value)

    def of(self, key: str) -> Declaration:
        """What `key` holds. KeyError for a key that is not declared: a mistake of the program."""
        if key in self.keys:
            return self.keys[key]
        if self.parts is not None:
            return Choice(self.meaning, self.parts.names) if key == self.chosen_by else AnyValue(f"option {key}")
        if self.others is None:
            raise KeyError(key)
        return self.others

    def schema(self) -> dict[str, Any]:
        """Its JSON Schema."""
        described = {"type": "object", "description": self.meaning}
        if self.parts is None:
            return described | self._keys_schema({}, self.needed)
        beside = {} if self.alone else self.keys
        forms = [
            Table(part.meaning, {**beside, **part.keys})._keys_schema(
                {self.chosen_by: {"const": name, "description": part.meaning}},
                tuple(dict.fromkeys((self.chosen_by, *(() if self.alone else self.needed), *part.needed))),
            )
            for name, part in ((name, self.parts.table(name)) for name in self.parts.names())
        ]
        return described | {"anyOf": forms + ([self._keys_schema({}, self.needed)] if self.alone else [])}

    def _keys_schema(self, first: dict[str, Any], needed: tuple[str, ...]) -> dict[str, Any]:
        keys = {key: schema_of(declaration) for key, declaration in self.keys.items()}
        return {
            "properties": keys | first,
            "additionalProperties": False if self.others is None else schema_of(self.others),
            **({"required": list(needed)} if needed else {}),
        }


@dataclass(frozen=True)
class Tables:
    """A list of tables, each under `[[key]]`."""

    meaning: str
    table: Table
    least: int = 0
    default: None = None

    def fault(self, value: Any) -> str | None:
        """Why `value` is refused as a whole."""
        right = isinstance(value, list) and all(isinstance(item, Mapping) for item in value)
        return None if right else "must be tables"

    def taken(self, value: Any) -> list[Any]:
        """The tables as they are."""
        return list(value)

    def schema(self) -> dict[str, Any]:
        """Its JSON Schema."""
        made = {"type": "array", "items": self.table.schema(), "description": self.meaning}
        return made | ({"minItems": self.least} if self.least else {})


def schema_of(declaration: Any) -> dict[str, Any]:
    """The JSON Schema of a declaration."""
    made: dict[str, Any] = declaration.schema()
    return made


def _with_default(schema: dict[str, Any], default: Any) -> dict[str, Any]:
    return schema if default is None else schema | {"default": default}
