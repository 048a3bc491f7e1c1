"""The submission's process: loads the file, says what it defines, then runs the one thing that it is asked for."""

from __future__ import annotations

import base64
import importlib.util
import locale
import random
import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, TextIO

import numpy as np
import numpy.random  # here, before the forks: else each of them imports it anew

from rds.core.blame import student_error
from rds.core.errors import ContractError, InputError
from rds.core.load import StudentFile, load_student
from rds.core.run_text import load_error
from rds.core.signature import INTERFACES, form
from rds.grading.sandbox.frames import FrameError
from rds.grading.sandbox.inside import runs, walls
from rds.grading.sandbox.inside.channel import Channel
from rds.grading.sandbox.inside.counting import RunCount, counted, work_alone
from rds.grading.sandbox.inside.plain import NotPlain, plain
from rds.grading.sandbox.shared_channel import ChannelClosed

_RUNS = {"control": runs.control, "model": runs.model, "rows": runs.rows}
_OWN = ("rds.checks.rows", "rds.core.types", "rds.core.values", "rds.machines.converter", "rds.modes.loop.laws")
"""Modules that ask a submission at each sample, besides `runs`: their work is not the submission's."""
_MOST_NAMES = 1000  # that are told of a file


def main(questions: int, answers: int, shared: list[int]) -> int:
    """Serve one submission; the process's exit code. `shared` is the memory shared with the grader, and its bells."""
    channel = Channel(questions, answers, *shared)
    for name, descriptor in (("stdout", 1), ("stderr", 2)):
        vars(sys)[name] = vars(sys)[f"__{name}__"] = _stream(descriptor)
    _seed()
    _as_at_home()
    try:
        order = channel.ask()
        file = Path(walls.HOME) / order["name"]
        file.write_bytes(base64.b64decode(order["text"]))
        count = _counted(questions, answers, order.pop("counted"))
        loaded = _load(channel, order["kind"], file, count)
        if loaded is None:
            return 0
        while True:
            order = channel.ask()
            if order["op"] == "call":
                _call(channel, loaded, order, file)
            elif order["op"] in _RUNS and isinstance(loaded, StudentFile):
                _RUNS[order["op"]](channel, loaded, order, count)
    except ChannelClosed:
        return 0


def _stream(descriptor: int) -> TextIO:
    """Its output, by lines, so that nothing is lost if it is ended.

    Made anew after the fork: the warm interpreter's own streams hold that they could be rewound, and so refuse the
    `sys.stdout.reconfigure(encoding="utf-8")` that many files for Windows begin with.
    """
    errors = "backslashreplace" if descriptor == 2 else "surrogateescape"
    return open(descriptor, "w", buffering=1, encoding="utf-8", errors=errors, closefd=False)


def _seed() -> None:
    """The same numbers in each run from whatever is not seeded, `numpy.random.default_rng()` included."""
    random.seed(0)
    np.random.seed(0)
    vars(np.random.bit_generator)["randbits"] = random.Random(0).getrandbits  # where numpy takes its entropy


def _as_at_home() -> None:
    """What a file says for its author's own computer, and none of its functions needs, does no harm here.

    Such is the choice of a window for pictures, that of a language, whose data are not mounted, and the import of what
    runs experiments, which is not mounted either.
    """
    set_language = locale.setlocale

    def set_if_there(category: int, name: Any = None) -> str:
        try:
            return set_language(category, name)
        except locale.Error:
            return set_language(category)

    vars(locale)["setlocale"] = set_if_there
    if "matplotlib" in sys.modules:
        vars(sys.modules["matplotlib"])["use"] = lambda *_, **__: None
    package = vars(sys.modules["rds"])
    there = package["__getattr__"]

    def get(name: str) -> Any:
        try:
            return there(name)
        except ModuleNotFoundError as error:
            return _NotHere(error)

    package["__getattr__"] = get


class _NotHere:
    """In place of what is not mounted: it can be imported, and the error comes where it is used."""

    def __init__(self, error: ImportError):
        self._error = error

    def __call__(self, *_: Any, **__: Any) -> Any:
        raise self._error

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):  # Python's own questions, such as whether it wraps another
            raise AttributeError(name)
        raise self._error


def _counted(questions: int, answers: int, order: dict[str, Any] | None) -> RunCount | None:
    """The count of the run that `order` announces, sealed by its number; None if nothing is to be counted."""
    if order is None:
        return None
    work_alone()
    return counted(questions, answers, runs.layout_of(order), order["seal"], [runs, *map(import_module, _OWN)])


def _load(channel: Channel, kind: str, file: Path, count: RunCount | None) -> StudentFile | ModuleType | None:
    """Run the file and tell what it defines; None if it cannot be used."""
    try:
        loaded = _functions(file) if kind == "functions" else _interface(kind, file)
    except BaseException as error:  # whatever a submission raises is its own doing: nobody else is in this process
        if count:
            count.stop()
        said = str(error) if isinstance(error, InputError) else student_error(error, file)
        channel.tell_error(said)
        return None
    given = loaded if isinstance(loaded, StudentFile) else None
    found = given.functions if given else vars(loaded)
    params, fault = _shown(lambda: dict(given.params) if given else {})
    state, state_fault = _shown(lambda: given.initial_state if given else None)
    problem = "; ".join(f"{name}: {text}" for name, text in [("params", fault), ("initial_state", state_fault)] if text)
    told = {"defines": _callable_names(found), "params": params or {}, "initial_state": state, "problem": problem}
    try:
        channel.tell(told)
    except FrameError as error:  # texts without end; it can be used all the same
        channel.tell({"defines": [], "params": {}, "initial_state": None, "problem": f"what it defines: {error}"})
    return loaded


def _callable_names(found: Mapping[str, Any]) -> list[str]:
    """What can be called in it, by name; of very much, what is imported (`from numpy import *`) is left out first."""
    names = [n for n, v in found.items() if isinstance(n, str) and callable(v) and n[:1] not in ("", "_")]
    file = found.get("__name__")
    own = {name for name in names if type(found[name]) is FunctionType and found[name].__module__ == file}
    return sorted(sorted(names, key=lambda name: (name not in own, name))[:_MOST_NAMES])


def _interface(kind: str, file: Path) -> StudentFile:
    student = load_student(file, limit=False)  # the sandbox has limits of its own, without a thread in this process
    if kind not in student.interfaces:
        wanted = " or ".join(form(name) for name, interface in INTERFACES.items() if interface == kind)
        raise ContractError(f"no {kind}: it defines no {wanted}", file.name)
    return student


def _functions(file: Path) -> ModuleType:
    """The file as a module; what it defines is looked up when it is called."""
    spec = importlib.util.spec_from_file_location("submission", file)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses and pickle look it up there
    try:
        spec.loader.exec_module(module)
    except BaseException as error:  # as in `_load`
        raise load_error(error, file) from error
    return module


def _shown(make: Callable[[], Any]) -> tuple[Any, str]:
    try:
        return plain(make()), ""
    except NotPlain as fault:
        return None, str(fault)
    except BaseException as error:  # a class of its own that cannot be looked at
        return None, f"it cannot be shown ({type(error).__name__})"


def _call(channel: Channel, loaded: Any, order: dict[str, Any], file: Path) -> None:
    """One function with plain arguments; its answer, or what it raised."""
    functions = loaded.functions if isinstance(loaded, StudentFile) else vars(loaded)
    name = order["name"]
    if not callable(functions.get(name)):
        channel.tell_error(f"it defines no function {name}()")
        return
    try:
        channel.tell({"value": plain(functions[name](*order["args"]))})
    except NotPlain as fault:
        channel.tell_error(f"{name}() returned what is not made of numbers, texts and lists: {fault}")
    except BaseException as error:
        channel.tell_error(f"{name}() failed: {student_error(error, file)}")
