"""The fields of each object, from the declarations that `rds nc make` has its options from."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, get_args, get_type_hints

from rds.core import quantities
from rds.core.errors import InputError
from rds.core.quantities import Quantity
from rds.nc.compiled_file import is_ours
from rds.nc.paths.numbers import BLEND, DECIMALS, HEIGHT, SPINDLE
from rds.nc.paths.objects import FEED, OBJECTS, File, Numbers, numbers
from rds.panels.program.text import check_name
from rds.panels.session.fields import Choice, Field, Flag, Number, Text

POINT_FILES = (".csv", ".txt", ".dat", ".tsv", ".xyz", ".pts")
_NO_FILE = _AS_THE_FILE_SAYS = ""
_LONGEST = 120  # characters of numbers with commas between them


@dataclass(frozen=True)
class Form:
    """An object as it is filled in. `first`: what stands in its fields at first; a tuple: the option several times."""

    label: str
    kind: str  # of OBJECTS
    first: Mapping[str, Any]
    without: tuple[str, ...] = ()  # options of the object that this form has no field for


FORMS = {
    "line": Form("Line", "line", {"start": "0,0", "end": "40,30,-2"}),
    "quad": Form("Quadrilateral by corners", "quad", {"corner": ("0,0", "40,5", "35,30", "0,25")}, ("start", "move")),
    "sides": Form(
        "Quadrilateral by sides", "quad", {"start": "0,0", "move": ("0,40,-1", "90,20,-1", "180,40,1")}, ("corner",)
    ),
    "arc": Form("Arc", "arc", {"centre": "20,20", "radius": 15.0, "start_angle": 0.0, "sweep": 360.0, "depth": 1.0}),
    "cone": Form(
        "Spiral cone",
        "cone",
        {"centre": "20,20", "radius": 20.0, "height": 5.0, "step_height": 1.0, "step_width": 3.0},
    ),
    "points": Form("Points of a file", "points", {}),
}


def fields(folder: Path) -> Iterator[Field]:
    """Those of every form, and of the program that is made of any."""
    tip = "what the part program is made of"
    yield Choice("object", "Object", tip, "line", {name: form.label for name, form in FORMS.items()})
    for name in FORMS:
        yield from form_fields(name, folder)
    yield Number.of(FEED, "feed", "Feed", 300.0)
    yield Number.of(HEIGHT, "safe", "Safe height", 5.0, optional=True, when_empty="none")
    yield Number.of(SPINDLE, "spindle", "Spindle", 3000.0, optional=True, when_empty="none")
    yield Number.of(BLEND, "blend", "Blend", optional=True, when_empty="none")
    yield Number.of(DECIMALS, "decimals", "Decimals")
    name = "line.ngc"
    yield Text("program", "Name of the program", "where the part program is written", name, name, 120, check_name, True)


def form_fields(name: str, folder: Path) -> Iterator[Field]:
    """The fields of one form, without those that every program has."""
    form = FORMS[name]
    for option, default, said in _options(form):
        first = form.first.get(option, default)
        several = isinstance(first, tuple)
        for k, value in enumerate(first if several else (first,), start=1):
            key = f"{name}_{option}{f'_{k}' if several else ''}"
            label = option.replace("_", " ").capitalize() + (f" {k}" if several else "")
            yield _field(said, key, label, value, default, folder)


def _options(form: Form) -> Iterator[tuple[str, Any, Any]]:
    """Name, default (None: needed, or nothing) and declaration of each option that the form has."""
    make = OBJECTS[form.kind]
    hints = get_type_hints(make, include_extras=True)
    for name, parameter in inspect.signature(make).parameters.items():
        if name != "feed" and name not in form.without:
            default = None if parameter.default is parameter.empty else parameter.default
            yield name, default, get_args(hints[name])[1]


def _field(said: Any, key: str, label: str, first: Any, default: Any, folder: Path) -> Field:
    if isinstance(said, Quantity):
        return Number.of(said, key, label, first, optional=first is None, when_empty="none")
    if isinstance(said, Numbers):
        named = label.lower()
        refuse = partial(check_numbers, said, named)
        return Text(key, f"{label} {said.form}", said.meaning, first, said.form, _LONGEST, refuse, needed=True)
    if isinstance(said, quantities.Flag):
        return Flag(key, label, said.meaning, bool(default))
    if isinstance(said, quantities.Choice):
        words = {_AS_THE_FILE_SAYS: "as the file says"} | {each: each for each in said.known}
        return Choice(key, label, said.meaning, _AS_THE_FILE_SAYS, words)
    assert isinstance(said, File)
    return Choice(key, label, said.meaning, _NO_FILE, {_NO_FILE: "choose one"} | _point_files(folder))


def _point_files(folder: Path) -> dict[str, str]:
    try:
        found = sorted(each for each in folder.iterdir() if each.suffix.lower() in POINT_FILES and each.is_file())
    except OSError:
        found = []
    return {each.name: each.name for each in found if not each.name.startswith(".") and not is_ours(each)}


def check_numbers(said: Numbers, name: str, text: str) -> None:
    """InputError unless `text` is as many numbers as are wanted."""
    found = numbers(text, name)
    if len(found) not in said.sizes:
        wanted = " or ".join(map(str, said.sizes))
        raise InputError(f"{name} {text!r} has {len(found)} of {said.form}; give {wanted} numbers, as in 10,-2.5")


def given(name: str, values: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """What the object's maker is called with; InputError where a file is still to be chosen."""
    form, options = FORMS[name], {}
    for option, _, said in _options(form):
        first = form.first.get(option)
        if isinstance(first, tuple):
            options[option] = [values[f"{name}_{option}_{k}"] for k in range(1, len(first) + 1)]
            continue
        value = values[f"{name}_{option}"]
        if isinstance(said, File):
            if value == _NO_FILE:
                raise InputError(f"choose a file of points of your folder ({', '.join(POINT_FILES)})")
            value = folder / value
        elif isinstance(said, quantities.Choice):
            value = None if value == _AS_THE_FILE_SAYS else value
        options[option] = value
    return options | {"feed": values["feed"]}
