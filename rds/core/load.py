"""A student's file, functions or notebook namespace, as the interfaces that they fill."""

from __future__ import annotations

import ast
import codecs
import copy
import dis
import hashlib
import inspect
import io
import linecache
import re
import tokenize
import traceback
import types
import warnings
from collections.abc import Callable, Mapping
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from rds.core.adapt import is_control_system
from rds.core.blame import STUDENT_ERRORS, student_error
from rds.core.errors import ContractError, InputError, Notice
from rds.core.interrupt import Endless, limited
from rds.core.quantities import near
from rds.core.run_text import run_text
from rds.core.signals import declaration_fault
from rds.core.signature import ARGUMENTS, INTERFACES, argument_fault, form, near_misses
from rds.core.types import Controller, Reference, Source
from rds.core.values import own_copy, shown

__all__ = ["StudentFile", "from_function", "from_namespace", "load_student", "student_error"]

_DECLARES = re.compile(rb"[ \t\f]*#.*?coding[:=][ \t]*([-\w.]+)")  # the encoding of a file of Python, PEP 263
_NUMBERS = (int, float)
_LONGEST_NAME = 100  # characters of a parameter
_LARGEST = 10_000_000  # bytes; a file of data, not of code


@dataclass(frozen=True)
class StudentFile:
    """What a student handed in: the interface functions by name, and what goes with them.

    `initial_state` is None where the student gave none, `signals` (names with their units) empty where a controller
    declares none. One `params` and one `initial_state` serve every function of a file; a model and a controller whose
    states differ belong in two files. `misfits` are functions that have the name but not the arguments of an interface,
    such as a helper called `interpolate`, with the reason. `starts_with_none` is set where `initial_state = None` is
    written: its controller is given None at first, and not the empty state. `sample_period` is what a file sets it to
    (s), if that is a number: the period that its own numbers were made for.
    """

    source: Source
    functions: Mapping[str, Callable[..., Any]]
    params: Mapping[str, Any] = field(default_factory=dict)
    initial_state: Any = None
    signals: Mapping[str, str] = field(default_factory=dict)
    misfits: Mapping[str, str] = field(default_factory=dict)
    starts_with_none: bool = False
    sample_period: float | None = None

    @property
    def first_state(self) -> Any:
        """What its controller is given at first."""
        return () if self.initial_state is None and not self.starts_with_none else self.initial_state

    @property
    def interfaces(self) -> tuple[str, ...]:
        """Those it fills of "controller", "model" and "interpolator"."""
        return tuple(dict.fromkeys(INTERFACES[name] for name in self.functions if name in INTERFACES))

    def parameters(self, overrides: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Its own copy of `params` with `overrides`; InputError for a key that `params` does not have."""
        merged: dict[str, Any] = own_copy(dict(self.params), "params", self.source.path or self.source.name)
        for key, value in (overrides or {}).items():
            if key not in merged:
                known = ", ".join(map(str, merged)) or "none"
                hint = near(key, [str(name) for name in merged])
                raise InputError(f"{self.source.name}: unknown parameter {key!r}; known parameters: {known}{hint}")
            if isinstance(value, str) and type(merged[key]) in _NUMBERS:
                said = f"must be a number, without quotes, as the file's own {merged[key]!r:.60} is"
                raise InputError(f"{self.source.name}: parameter {key} = {value!r:.60} {said}")
            merged[key] = value
        return merged

    def controller(self, coupled: bool = False, params: Mapping[str, Any] | None = None) -> Controller:
        """The controller, with `params` over its own; ContractError if there is none or it lacks a state."""
        control = self.functions.get("control")
        if control is None:
            raise ContractError(f"no controller: it defines no {form('control')}", self.source.name)
        merged, where = self.parameters(params), self.source.path or self.source.name
        if not self.source.path:
            _warn_of_globals(control)
        if self.initial_state is None and not self.starts_with_none and not coupled:
            _needs_no_state(control, merged, self.source)
        state = own_copy(self.first_state, "initial_state", where)
        signals, period = dict(self.signals), self.sample_period
        return Controller(control, state, merged, self.source, coupled, signals=signals, sample_period=period)


def load_student(path: str | Path, validate: bool = True, limit: bool = True) -> StudentFile:
    """Run the student's file at `path` as a module of its own and find what it defines.

    Files next to it can be imported, but do not come before the standard library and installed packages.
    InputError, with file and line, for a file that cannot be read or run or that defines no interface;
    ContractError for a function with the wrong arguments or `params` that is no dict, unless `validate` is
    off (the conformance check reports these itself). Only the student's own errors are caught: Ctrl-C is not.
    A file that does not come to its end is ended where it is after 60 s, unless `limit` is off.
    """
    file = Path(path)
    data = _read(file)
    file = file.resolve()
    text = _decode(data, file)
    if text.lstrip().startswith("{") and all(word in text for word in ('"cells"', '"nbformat"')):
        raise InputError("it is a notebook with the ending .py; name it .ipynb, or save its code as .py", str(file))
    source = Source(file.name, str(file), hashlib.sha256(data).hexdigest(), text)
    with limited() if limit else nullcontext():
        variables = run_text(text, file)
    student, period = _student(variables, source, validate), variables.get("sample_period")
    # by its type as it was before the file ran, which may have put another `float` in place of Python's
    return replace(student, sample_period=period) if period is not None and type(period) in _NUMBERS else student


def from_namespace(namespace: Mapping[str, Any] | types.ModuleType, validate: bool = True) -> StudentFile:
    """What a module, or the variables of a notebook (`globals()`), define of the interfaces; errors as for a file."""
    variables = vars(namespace) if isinstance(namespace, types.ModuleType) else namespace
    functions = [f for name in ARGUMENTS if inspect.isfunction(f := variables.get(name))]
    texts = [text for f in functions if (text := _source_text(f)) is not None]
    name = namespace.__name__ if isinstance(namespace, types.ModuleType) else "notebook"
    return _student(variables, _source(name, "\n\n".join(texts) or None), validate)


def from_function(
    function: Callable[..., Any],
    initial_state: Any = None,
    params: Mapping[str, Any] | None = None,
    role: str | None = None,
    validate: bool = True,
    signals: Mapping[str, str] | None = None,
) -> StudentFile:
    """One function, as from a notebook cell, in the `role` of "control", "derivatives", "advance" or "interpolate".

    Without `role` it is the function's name, else the interface whose arguments it has. Errors as for a file.
    """
    name = getattr(function, "__name__", type(function).__name__)
    role = role or (name if name in INTERFACES else _role_of(function, name))
    variables: dict[str, Any] = {role: function, "params": {} if params is None else params, "signals": signals}
    if initial_state is not None:
        variables["initial_state"] = initial_state
    return _student(variables, _source(name, _source_text(function)), validate)


def _system(variables: Mapping[str, Any]) -> str:
    """Where a python-control system of the file goes, which fills no interface there; empty if there is none."""
    names = [name for name, value in variables.items() if is_control_system(value)]
    if not names:
        return ""
    name = names[-1]  # the ones before it, such as s = tf("s"), are what it was made of
    return f"`{name}` is a system of python-control: hand it in in Python, as in `rds.Experiment(model={name})`"


def _student(variables: Mapping[str, Any], source: Source, validate: bool) -> StudentFile:
    # `import control` or `from scipy import interpolate` is no controller and no interpolator
    functions = {name: f for name in ARGUMENTS if callable(f := variables.get(name)) and not inspect.isclass(f)}
    if not any(name in INTERFACES for name in functions):
        if source.path and source.text is not None and not source.text.strip():
            raise InputError(
                "it is empty; save your code in the editor, and look whether this is the right file", source.path
            )
        names = ", ".join(form(name) for name in INTERFACES)
        written_here = {k: v for k, v in variables.items() if _is_written_here(v, variables)}
        hint = _system(variables) or near_misses(written_here) or _inner(source)
        raise InputError(f"it defines none of {names}{'; ' + hint if hint else ''}", source.path or source.name)
    misfits = {name: fault for name, f in functions.items() if (fault := argument_fault(name, f))}
    if all(name in misfits for name in functions if name in INTERFACES):
        misfits = {}  # nothing else fills an interface, so these were meant to
    elif {"derivatives", "advance"} & (set(functions) - set(misfits)):
        misfits.pop("output", None)  # next to a model it is meant for it
    fitting = {name: f for name, f in functions.items() if name not in misfits}
    params, state, signals = (variables.get(name) for name in ("params", "initial_state", "signals"))
    if not isinstance(signals, Mapping) or "control" not in fitting:
        signals = {}  # a variable of that name from before there were signals, or a model's
    starts_with_none = state is None and "initial_state" in variables
    student = StudentFile(source, fitting, {} if params is None else params, state, signals, misfits, starts_with_none)
    if validate:
        _validate(student)
    return student


def _validate(student: StudentFile) -> None:
    if not isinstance(student.params, Mapping):
        kind = type(student.params).__name__
        where = student.source.path or student.source.name
        raise ContractError(
            f"params is {shown(student.params)} ({kind}); it must be a dict of defaults, as in {{'gain': 20.0}}", where
        )
    if fault := declaration_fault(student.signals):
        raise ContractError(fault, _place_of("signals", student.source))
    for name, function in student.functions.items():
        if fault := argument_fault(name, function) or _form_fault(name, function):
            code = getattr(inspect.unwrap(function), "__code__", None)
            line = f":{code.co_firstlineno}" if code and student.source.path == code.co_filename else ""
            raise ContractError(fault, f"{student.source.path or student.source.name}{line}")


def _place_of(variable: str, source: Source) -> str:
    """The file, and the line where it last sets `variable`, where that is known."""
    lines = []
    if source.path is not None and source.text is not None:
        for node in ast.parse(source.text).body:
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            if any(isinstance(target, ast.Name) and target.id == variable for target in targets):
                lines.append(node.lineno)
    return f"{source.path or source.name}{f':{lines[-1]}' if lines else ''}"


def _form_fault(name: str, function: Callable[..., Any]) -> str | None:
    """Whether calling `function` would not run it, with the remedy; only rows are yielded."""
    if inspect.iscoroutinefunction(function) or inspect.isasyncgenfunction(function):
        return f"{name}() is asynchronous, and nobody awaits it; write `def`, not `async def`"
    if name != "interpolate" and inspect.isgeneratorfunction(function):
        return f"{name}() is a generator; use `return`, not `yield`"
    return None


def _inner(source: Source) -> str:
    """Where a file defines a function of an interface, but within something that was not run; "" if nowhere."""
    inner = ast.walk(ast.parse(source.text)) if source.path is not None and source.text is not None else ()
    for node in inner:
        if isinstance(node, ast.FunctionDef) and node.name in INTERFACES:
            within = 'within something else, such as `if __name__ == "__main__":` or another function'
            return f"{node.name}() in line {node.lineno} is {within}; move it out, to the left margin"
    return ""


def _is_written_here(value: Any, variables: Mapping[str, Any]) -> bool:
    """False for what a file imported: a library's class is no near miss of the student's."""
    module = getattr(value, "__module__", None)
    return module is None or module == variables.get("__name__", module)


def _warn_of_globals(control: Callable[..., Any]) -> None:
    """A file is loaded anew for each run; a function of a notebook finds in its variables what the last run left."""
    code = getattr(inspect.unwrap(control), "__code__", None)
    kept = {each.argval for each in dis.get_instructions(code) if each.opname == "STORE_GLOBAL"} if code else ()
    for name in sorted(kept):
        said = f"control() keeps `{name}` outside of its state, so the next run begins with what this one leaves there"
        warnings.warn(Notice(f"{said}; take it from `state` and return it in next_state"), stacklevel=2)


def _needs_no_state(control: Callable[..., Any], params: dict[str, Any], source: Source) -> None:
    """A trial call with the empty state: "index out of range" in a running loop does not say what is missing."""
    try:
        control(0.0, Reference(0.0, 0.0, 0.0), 0.0, (), copy.deepcopy(params))
    except Endless as error:
        raise ContractError(student_error(error, source), source.path or source.name) from error
    except (IndexError, KeyError, TypeError, ValueError) as error:
        if remedy := missing_param(error, params, source):
            said = f"control() looks for {error.args[0]!r}, which is not in params: {student_error(error, source)}"
            raise ContractError(f"{said}; {remedy}", source.path or source.name) from error
        if not wants_state(error, lambda state: control(0.0, Reference(0.0, 0.0, 0.0), 0.0, state, params), source):
            return  # whoever runs it reports it
        raise ContractError(
            f"control() fails with the empty state, and there is no initial_state: {student_error(error, source)}; "
            f"{how_to_define('initial_state', '[0.0]', source)}",
            source.path or source.name,
        ) from error
    except STUDENT_ERRORS:
        return  # not for want of a state: whoever runs it reports it


def missing_param(error: BaseException, params: Mapping[str, Any], source: Source | None) -> str:
    """How to define the parameter for want of which control() failed, or what it is called; empty where it was not
    that.
    """
    key = error.args[0] if isinstance(error, KeyError) and error.args else None
    if not isinstance(key, str) or len(key) > _LONGEST_NAME or key in params or _is_of_another_dict(error, key, params):
        return ""
    spelt = {str(name).lower(): str(name) for name in params}
    if alike := get_close_matches(key.lower(), spelt, n=1):
        return f"params has {spelt[alike[0]]!r}: write the name alike in both places"
    return how_to_define("params", f"{{{key!r}: 1.0}}", source)


def _is_of_another_dict(error: BaseException, key: str, params: Mapping[str, Any]) -> bool:
    """Whether the line that failed looks into a dict of other keys than those of `params`, and without this one."""
    frames = list(traceback.walk_tb(error.__traceback__))
    if not frames:
        return False
    frame, number = frames[-1]
    names = re.findall(r"(\w+)\s*\[", linecache.getline(frame.f_code.co_filename, number))
    dicts = [each for name in names if type(each := frame.f_locals.get(name, frame.f_globals.get(name))) is dict]
    return any(key not in each and each.keys() != params.keys() for each in dicts)


def how_to_define(name: str, example: str, source: Source | None) -> str:
    """Where a law's `name` goes: into its file, or with a function of a notebook, whose variables nobody looks at."""
    if source is not None and source.path:
        return f"define it, as in `{name} = {example}`"
    return f'hand {name} over with the function, as in `{{"control": control, "{name}": {example}}}`'


def wants_state(error: BaseException, call: Callable[[Any], Any], source: Source | None) -> bool:
    """Whether `error`, of `call` with the empty state, is about the state: with a number it is another one, or none."""
    try:
        call(0.0)
    except STUDENT_ERRORS as other:
        return student_error(other, source) != student_error(error, source)
    return True


def _role_of(function: Callable[..., Any], name: str) -> str:
    fits = [role for role in INTERFACES if argument_fault(role, function) is None]
    if len(fits) > 1:  # derivatives and advance both take four
        try:
            names = set(inspect.signature(function).parameters)
        except (TypeError, ValueError):  # built-in classes and functions need not tell
            names = set()
        fits = [role for role in fits if names >= set(ARGUMENTS[role])] or fits
    if len(fits) != 1:
        forms = ", ".join(form(role) for role in INTERFACES)
        raise ContractError(f"cannot tell which interface {name}() fills; name it and its arguments as in {forms}")
    return fits[0]


def _source(name: str, text: str | None) -> Source:
    sha256 = hashlib.sha256(text.encode()).hexdigest() if text is not None else None
    return Source(name, None, sha256, text)


def _source_text(function: Callable[..., Any]) -> str | None:
    try:
        return inspect.getsource(function)
    except (OSError, TypeError):
        return None


def _read(file: Path) -> bytes:
    where = str(file)
    if not file.exists():
        raise InputError("there is no such file; check the name and the folder", where)
    if not file.is_file():
        kind = "a folder" if file.is_dir() else "not a regular file"
        raise InputError(f"it is {kind}; name the Python file in which the functions are", where)
    if file.suffix == ".ipynb":
        raise InputError("it is a notebook; save the cells that define the functions as a .py file", where)
    try:
        if file.stat().st_size > _LARGEST:
            raise InputError(f"it has {file.stat().st_size} bytes, more than {_LARGEST}; keep data out of it", where)
        return file.read_bytes()
    except OSError as error:
        raise InputError(f"it cannot be read: {error.strerror}", where) from error


def _decode(data: bytes, file: Path) -> str:
    if b"\0" in data:
        line = data[: data.index(b"\0")].count(b"\n") + 1
        raise InputError("it contains null bytes, so it is not UTF-8 text; save it as UTF-8", f"{file}:{line}")
    declared = next((found[1].decode() for line in data.splitlines()[:2] if (found := _DECLARES.match(line))), "")
    encoding = "utf-8-sig"
    try:
        try:
            encoding, _ = tokenize.detect_encoding(io.BytesIO(data).readline)
        except SyntaxError:  # a line is not in what is declared, or no encoding that Python knows is
            with suppress(LookupError):
                encoding = codecs.lookup(declared or encoding).name
        return data.decode(encoding)
    except (LookupError, UnicodeError) as error:  # Python knows it, but not as an encoding of text, or not of this one
        if isinstance(error, UnicodeDecodeError) and encoding.startswith("utf-8"):
            line = data[: error.start].count(b"\n") + 1
            bad = data[error.start : error.start + 1]
            raise InputError(f"byte {bad!r} is not UTF-8 text; save it as UTF-8", f"{file}:{line}") from error
        raise InputError(
            f"its text cannot be read as the {declared!r} that it declares; save it as UTF-8", str(file)
        ) from error
