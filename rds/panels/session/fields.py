"""Fields: what a user may set, with unit, range and the sentence that refuses a wrong value."""

from __future__ import annotations

import unicodedata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any

from rds.core import quantities
from rds.core.errors import InputError
from rds.core.quantities import Declaration, Quantity, shortened
from rds.core.toml_file import parse_toml
from rds.modes import DEFAULT, load_mode, mode_names
from rds.modes.loop.mode import Drive

_LONGEST_NAME = 255  # bytes of one part of a path, on every common file system


@dataclass(frozen=True)
class Field:
    """One thing to set. `name` is its key in files and code, `label` what stands beside it, `tooltip` what it means."""

    name: str
    label: str
    tooltip: str
    default: Any = None

    def check(self, value: Any) -> Any:
        """The value as it will be used; InputError with what it must be instead."""
        return value


@dataclass(frozen=True)
class Number(Field):
    """A number in `unit`, from `low` to `high`, and more than `above`. Text is read as a person writes it."""

    unit: str = ""
    low: float = -inf
    high: float = inf
    above: float = -inf
    whole: bool = False
    optional: bool = False  # empty text stands for None: the program's own choice
    when_empty: str = "by itself"  # what stands in an empty optional field: who chooses then, and what

    def check(self, value: Any) -> float | int | None:
        """The number; text may have a decimal comma, blanks around it, and the unit behind it."""
        if self.optional and (value is None or (isinstance(value, str) and not value.strip())):
            return None
        number = self._number(value)
        if (fault := self.quantity.fault(number)) is not None:
            shown = f"{value:.60}" if isinstance(value, str) else shortened(value, 60)
            raise InputError(f"{self.label} {fault}, not {shown}")
        return self.quantity.taken(number)

    @classmethod
    def of(cls, quantity: Quantity, name: str, label: str, default: Any = None, **more: Any) -> Number:
        """The field of a declared quantity, whose meaning is its tooltip."""
        q = quantity
        bounds = {"unit": q.unit, "low": q.low, "high": q.high, "above": q.above, "whole": q.whole}
        more = {"tooltip": q.meaning, **bounds, **more}
        return cls(name=name, label=label, default=q.default if default is None else default, **more)

    @property
    def quantity(self) -> Quantity:
        """What it may be. The tooltip has the meaning, so that a refusal need not repeat it."""
        return Quantity("", self.unit, self.low, self.high, self.above, whole=self.whole)

    @property
    def range(self) -> str:
        """The range in words, with the unit."""
        return self.quantity.range

    @property
    def _no_number(self) -> str:
        return str(self.quantity.fault(None))

    def _number(self, value: Any) -> Any:
        if not isinstance(value, str):
            return value
        text = value.replace("−", "-").strip().removesuffix(self.unit).strip()  # the minus sign that pictures have
        if text.count(",") == 1 and "." not in text:
            text = text.replace(",", ".")
        try:
            return float("" if "_" in text else text)  # 1_0 is 10 to Python alone
        except ValueError:
            raise InputError(f"{self.label} {self._no_number}, not {value!r:.60}") from None


@dataclass(frozen=True)
class Choice(Field):
    """One of `options`, each a key with the words that stand for it."""

    options: Mapping[str, str] = field(default_factory=dict)

    def check(self, value: Any) -> str:
        """The key; InputError with the list of those there are."""
        if not isinstance(value, str) or value not in self.options:
            raise InputError(f"{self.label} must be one of {', '.join(self.options)}, not {value!r:.60}")
        return value


@dataclass(frozen=True)
class Flag(Field):
    """Yes or no."""

    def check(self, value: Any) -> bool:
        """True or false."""
        if not isinstance(value, bool):
            raise InputError(f"{self.label} must be true or false, not {value!r:.60}")
        return value


@dataclass(frozen=True)
class Text(Field):
    """Text of at most `longest` characters; `refuse(text)` may raise InputError. Without it, the text names a file."""

    placeholder: str = ""
    longest: int = 4096
    refuse: Callable[[str], None] | None = None
    needed: bool = False  # empty text is an error as well

    def check(self, value: Any) -> str:
        """The text."""
        if not isinstance(value, str) or len(value) > self.longest:
            raise InputError(f"{self.label} must be text of at most {self.longest} characters")
        if bad := [c for c in value if unicodedata.category(c) in ("Cc", "Cs") and c not in "\t\n"]:
            raise InputError(f"{self.label} holds a character that cannot be written, {bad[0]!r}; type it again")
        if self.refuse is not None:
            if value or self.needed:
                self.refuse(value)
        elif any(len(part.encode()) > _LONGEST_NAME for part in value.split("/")):
            raise InputError(f"{self.label} is longer than the name of a file can be, {_LONGEST_NAME} bytes")
        return value


@dataclass(frozen=True)
class Several(Field):
    """Some of `options`, in their order."""

    options: Mapping[str, str] = field(default_factory=dict)
    least: int = 1

    def check(self, value: Any) -> list[str]:
        """The keys; InputError for one that is not there, or too few."""
        if (
            not isinstance(value, Sequence)
            or isinstance(value, str)
            or any(not isinstance(key, str) or key not in self.options for key in value)
        ):
            raise InputError(f"{self.label} must be some of {', '.join(self.options)}, not {value!r:.60}")
        if len(set(value)) < self.least:
            raise InputError(f"{self.label} needs {self.least} or more of {', '.join(self.options)}")
        return [key for key in self.options if key in value]


def labels(names: Sequence[str], told: Mapping[str, str]) -> dict[str, str]:
    """The parts of a library as the options of a choice: by the words that are `told`, else by their names."""
    return {name: told.get(name, name.replace("-", " ").capitalize()) for name in names}


def field_of(declaration: Declaration, name: str, label: str, unit: str = "") -> Field:
    """The field of an option that may be left out: a number, or what a file would say (`[[1, 2]]`, `true`).

    `unit` takes the place of the declaration's own.
    """
    if isinstance(declaration, Quantity):
        unit = unit or declaration.unit
        tip = ", ".join(filter(None, (declaration.meaning, unit)))
        return Number.of(declaration, name, label, tooltip=tip, unit=unit, optional=True)
    tip = f"{declaration.meaning}: as in a file"
    if isinstance(declaration, quantities.Choice):
        tip = f"{declaration.meaning}: {', '.join(declaration.known)}"
    return Text(name, label, tip, "", refuse=lambda text: _refuse_value(declaration, label, text))


def value_of(field: Field, value: Any) -> Any:
    """What a field of `field_of` says in a file; None for nothing."""
    return _value(field.label, value) if isinstance(field, Text) and isinstance(value, str) else value


def _value(label: str, text: str) -> Any:
    if not text.strip():
        return None
    try:
        return parse_toml(f"value = {text}", label)["value"]
    except InputError:
        if text.replace("-", "").replace("_", "").isalnum():  # a word without its quotes
            return text.strip()
        raise InputError(f"{label} is not a value as in a file, such as 1.5, [1, 2] or a word: {text!r:.60}") from None


def _refuse_value(declaration: Declaration, label: str, text: str) -> None:
    value = _value(label, text)
    if value is not None:
        quantities.checked(declaration, value, label)


def mode_choice(drives: Drive) -> Choice:
    """The choice among the modes in which a controller, or a voltage signal, may drive the axes."""
    modes = [load_mode(name) for name in mode_names(drives)]
    tip = "; ".join(f"{mode.label.lower()}: {mode.about}" for mode in modes)
    return Choice("mode", "Mode", tip, DEFAULT, {mode.name: mode.label for mode in modes})
