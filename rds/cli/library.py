"""`rds library`: the parts that there are of each kind, with their options: what the registries say, and nothing else.

docs/library.md is the same as Markdown (`make tables`). A command whose `--help` lists parts has the class
`NamesParts`.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Annotated, Any, NamedTuple

import typer
from typer.core import TyperCommand

from rds.cli.common import Json, print_json, refusals

ALONE = "axis X of the mini CNC at 1 kHz"  # whose tuned values a law's defaults are shown for


class Option(NamedTuple):
    """One option of a part: unit, what it means, what it may be, and what it is where nothing is said."""

    name: str
    unit: str
    meaning: str
    allowed: str
    default: str


class Part(NamedTuple):
    """A part of a library: what it is, in a sentence, and its options."""

    name: str
    about: str
    options: tuple[Option, ...] = ()


class Kind(NamedTuple):
    """A kind of parts: its heading, what to do with one, its names, and the part of each."""

    heading: str
    use: str
    names: Callable[[], Iterable[str]]
    part: Callable[[str], Part]


def _module(names: Callable[[], Any], owner: str, about: str = "", defaults: str = "DEFAULTS") -> Callable[[str], Part]:
    """The part of a registry's module: its docstring (or `about`), and its options under `owner`."""

    def part(name: str) -> Part:
        module = names().module(name)
        said = getattr(module, about) if about else _first(module)
        return Part(name, said, _options(getattr(module, owner, {}), getattr(module, defaults, {})))

    return part


def _first(thing: Any) -> str:
    """The first paragraph of a docstring, as one line."""
    return " ".join((inspect.getdoc(thing) or "").partition("\n\n")[0].split())


def _options(declared: Any, defaults: Mapping[str, Any]) -> tuple[Option, ...]:
    if not isinstance(declared, Mapping):  # names alone
        return tuple(Option(name, "", "", "", "") for name in declared)
    return tuple(_option(name, each, defaults.get(name)) for name, each in declared.items())


def _option(name: str, declared: Any, default: Any) -> Option:
    from rds.core.quantities import Choice, Flag, Items, Quantity, listed

    unit, allowed = str(getattr(declared, "unit", "")), ""
    if isinstance(declared, Quantity):
        allowed = declared.range.removesuffix(f" {unit}") if unit else declared.range
        allowed = "" if allowed in ("a number", "a number in") else allowed
        for words, sign in (("of ", ""), ("at least", "≥"), ("more than", ">"), ("at most", "≤"), ("from ", "")):
            allowed = allowed.replace(words, sign)
    elif isinstance(declared, Choice):
        allowed = ", ".join(declared.known)
    elif isinstance(declared, Flag):
        allowed = "true, false"
    elif isinstance(declared, Items):
        allowed = declared.form
    standing = declared.default if default is None else default
    shown = "" if standing is None else listed({"": standing}).removeprefix(" = ")
    return Option(name, unit, declared.meaning, allowed, shown)


def _controllers() -> Any:
    from rds.controllers import LIBRARY

    return LIBRARY


def _law(name: str) -> Part:
    """A law, with what its options are on `ALONE` where nothing is said."""
    from rds.controllers import library_controller
    from rds.machines import load_machine

    machine = load_machine("mini-cnc")
    made = library_controller(name, machine.axes["X"].model, machine.sample_period, machine.converter.range)
    part = _module(_controllers, "OPTIONS")(name)
    tuned = {key: value for key, value in made.params.items() if isinstance(value, int | float)}
    return part._replace(options=_options(_controllers().module(name).OPTIONS, tuned))


def _models() -> Any:
    from rds.models import LIBRARY

    return LIBRARY


def _signal(name: str) -> Part:
    from rds.references import signal_function, signal_options

    function, table = signal_function(name), signal_options(name)
    parameters = inspect.signature(function).parameters
    defaults = {key: p.default for key, p in parameters.items() if p.default is not p.empty and p.default is not None}
    return Part(name, _first(function).partition(" Raises ")[0], _options(table.keys, defaults))


def _signals() -> Iterable[str]:
    from rds.references import signal_kinds

    return signal_kinds()


def _interpolators() -> Any:
    from rds.interpolators import LIBRARY

    return LIBRARY


def _accelerations() -> Any:
    from rds.interpolators.acceleration import LIBRARY

    return LIBRARY


def _modes() -> Any:
    from rds.modes import MODES

    return MODES


def _mode(name: str) -> Part:
    from rds.modes import load_mode

    mode = load_mode(name)
    return Part(name, f"{mode.about}; {'in real time' if mode.real_time else 'in virtual time'}")


def _machines() -> Iterable[str]:
    from rds.machines import machine_names

    return machine_names()


def _machine(name: str) -> Part:
    from rds.machines import load_machine

    machine = load_machine(name)
    return Part(name, f"{machine.title}: {', '.join(machine.axes)}")


def _dialects() -> Any:
    from rds.bus.modules.dialects import LIBRARY

    return LIBRARY


def _dialect(name: str) -> Part:
    import sys

    package = _dialects().module(name).__package__
    return Part(name, _first(sys.modules[package]))


def _bus_logs() -> Iterable[str]:
    from rds.bus.tools.log_formats import ENDINGS

    return ENDINGS


def _bus_log(name: str) -> Part:
    from rds.bus.tools.log_formats import FORMATS

    found = FORMATS[name]
    return Part(name, f"{found.title}: keeps {found.keeps}; a recorder that is killed leaves {found.killed}")


def _data_files() -> Iterable[str]:
    from rds.identification.logs.tables import endings

    return endings()


def _data_file(name: str) -> Part:
    from rds.identification.logs.tables import FORMATS

    return Part(name, "; ".join(dict.fromkeys(each.title for each in FORMATS if each.title and name in each.endings)))


def _structures() -> Any:
    from rds.identification.structures.structures import LIBRARY

    return LIBRARY


def _methods() -> Any:
    from rds.identification.fit.fit import METHODS

    return METHODS


def _reports() -> Any:
    from rds.results.reports import KINDS as reports

    return reports


def _report(name: str) -> Part:
    module = _reports().module(name)
    rows = [
        Option(key, each.unit, each.meaning, "", "" if each.default is None else f"{each.default}")
        for key, each in module.SETTINGS.items()
    ]
    return Part(name, _first(module), tuple(rows))


def _criteria() -> Any:
    from rds.grading.criteria import KINDS as criteria

    return criteria


def _criterion(name: str) -> Part:
    part = _module(_criteria, "OPTIONS", "MEANING")(name)
    unit = _criteria().module(name).UNIT
    return part._replace(about=f"{part.about}, in {'the unit of the axis' if unit is None else unit or 'no unit'}")


def _gradebooks() -> Any:
    from rds.grading.exports import GRADEBOOKS

    return GRADEBOOKS


def _panels() -> Any:
    from rds.panels.registry import PANELS

    return PANELS


def _names(library: Callable[[], Any]) -> Callable[[], Iterable[str]]:
    return lambda: library().names()


KINDS: dict[str, Kind] = {
    "controller": Kind("Controllers", '`[controller] name = "…"`', _names(_controllers), _law),
    "model": Kind("Models", '`[model] name = "…"`', _names(_models), _module(_models, "PARAMETERS")),
    "signal": Kind("Signals", '`[reference]` or `[signal] kind = "…"`', _signals, _signal),
    "interpolator": Kind(
        "Interpolators", "`rds interpolate --method …`", _names(_interpolators), _module(_interpolators, "OPTIONS")
    ),
    "acceleration": Kind(
        "Acceleration filters",
        'in a path, `acceleration = "…"`',
        _names(_accelerations),
        _module(_accelerations, "OPTIONS"),
    ),
    "mode": Kind("Modes", "`rds run --mode …`", _names(_modes), _mode),
    "machine": Kind("Machines", '`machine = "…"`', _machines, _machine),
    "dialect": Kind("Dialects", '`[bus] dialect = "…"`', _names(_dialects), _dialect),
    "bus-log": Kind("Formats of bus logs", "`rds bus record FILE`, by the file's ending", _bus_logs, _bus_log),
    "data-file": Kind("Files of logged data", "`rds fit FILE`, by the file's ending", _data_files, _data_file),
    "structure": Kind(
        "Model structures",
        "`rds fit --structure …`, with `--option …`",
        _names(_structures),
        _module(_structures, "OPTIONS"),
    ),
    "method": Kind("Methods of estimation", "`rds fit --method …`", _names(_methods), _module(_methods, "NO_OPTIONS")),
    "report": Kind("Reports", "`rds report …`, with `--set NAME=VALUE`", _names(_reports), _report),
    "criterion": Kind("Criteria", 'in an assignment, `kind = "…"`', _names(_criteria), _criterion),
    "gradebook": Kind(
        "Gradebooks", "`rds grade export --to …`", _names(_gradebooks), _module(_gradebooks, "NO_OPTIONS")
    ),
    "panel": Kind("Panels", "`rds app --panel …`", _names(_panels), _module(_panels, "NO_OPTIONS", "SUMMARY")),
}


class NamesParts(TyperCommand):
    """A command in whose help `{kind}` stands for the parts of that kind: looked up when it is shown, not before."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Show the help, with the names filled in."""
        for parameter in self.params:
            if said := getattr(parameter, "help", None):
                parameter.help = re.sub(r"\{([a-z-]+)\}", _in_words, said)  # type: ignore[attr-defined]
        super().format_help(ctx, formatter)


def _in_words(found: re.Match[str]) -> str:
    return ", ".join(KINDS[found[1]].names()) if found[1] in KINDS else found[0]


def library(
    kind: Annotated[str | None, typer.Argument(help="A kind of parts; without it, all kinds are listed.")] = None,
    name: Annotated[str | None, typer.Argument(help="One part of it, with all of its options.")] = None,
    markdown: Annotated[bool, typer.Option("--markdown", help="All of it as a page of Markdown.")] = False,
    json: Json = False,
) -> None:
    """The parts that there are (controllers, models, signals, criteria, ...), with their options' units and ranges."""
    with refusals():
        from rds.core.errors import InputError
        from rds.core.quantities import near

        if kind is not None and kind not in KINDS:
            raise InputError(
                f"there is no kind of parts {kind!r}; known kinds: {', '.join(KINDS)}{near(kind, list(KINDS))}"
            )
        known = list(KINDS[kind].names()) if kind is not None else []
        if name is not None and name not in known:
            raise InputError(f"there is no {kind} {name!r}; known: {', '.join(known)}{near(name, known)}")
        if markdown:
            if kind is not None:
                raise InputError("--markdown is of all kinds; leave the kind out")
            typer.echo(as_markdown(), nl=False)
            return
        wanted = {
            each: [KINDS[each].part(part) for part in ([name] if name else KINDS[each].names())]
            for each in ([kind] if kind else KINDS)
        }
    if json:
        print_json({each: {part.name: _plain(part) for part in parts} for each, parts in wanted.items()})
        return
    from rds.cli.console import show_table

    if kind is None:
        rows = [[each, ", ".join(part.name for part in parts)] for each, parts in wanted.items()]
        show_table("Parts of the library; `rds library KIND` says more", ["kind", "parts"], rows)
        return
    parts = wanted[kind]
    show_table(
        f"{KINDS[kind].heading}: {KINDS[kind].use.replace('`', '')}",
        ["name", "what it is"],
        [list(part[:2]) for part in parts],
    )
    if name is not None and parts[0].options:
        note = f"defaults of {ALONE}" if kind == "controller" else ""
        show_table("Options", list(_HEADINGS), [list(option) for option in parts[0].options], note)


_HEADINGS = ("option", "unit", "what it is", "range", "default")


def _plain(part: Part) -> dict[str, Any]:
    return {"about": part.about, "options": {each.name: each._asdict() for each in part.options}}


def as_markdown() -> str:
    """The page docs/library.md."""
    lines = [
        "# The library",
        "",
        "All parts that there are, with the options of each. This page is made from the program's own tables",
        "(`make tables`); `rds library` shows the same in a terminal, `rds library controller pid` one part.",
        "How a part of your own takes the place of one of these is in",
        "[experiments.md](experiments.md#the-three-fixed-interfaces).",
    ]
    for kind in KINDS.values():
        parts = [kind.part(name) for name in kind.names()]
        lines += ["", f"## {kind.heading}", "", f"Use: {kind.use}.", "", "| name | what it is |", "| --- | --- |"]
        lines += [f"| `{part.name}` | {_cell(part.about)} |" for part in parts]
        for part in parts:
            if part.options and any(option.meaning for option in part.options):
                heads = _HEADINGS if kind.heading != "Controllers" else (*_HEADINGS[:-1], f"default ({ALONE})")
                lines += ["", f"### `{part.name}`", "", f"| {' | '.join(heads)} |", f"|{' --- |' * len(heads)}"]
                lines += [f"| {' | '.join((f'`{o.name}`', *map(_cell, o[1:])))} |" for o in part.options]
            elif part.options:
                lines += ["", f"Options of `{part.name}`: {', '.join(f'`{option.name}`' for option in part.options)}."]
    return "\n".join(lines) + "\n"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
