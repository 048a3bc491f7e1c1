"""What of a notebook reads files that it names: where it is graded there are none."""

from __future__ import annotations

import ast
from collections.abc import Sequence, Set
from dataclasses import dataclass, field
from itertools import chain

from rds.grading.intake import followed
from rds.grading.intake.bindings import at_once, bound, last_word

_READERS = frozenset({"open", "loadtxt", "genfromtxt", "load", "loadmat", "fromfile"})
_OF_PATHS = frozenset({"open", "read_text", "read_bytes"})  # methods
_PATHS = frozenset({"Path", "PurePath", "PosixPath", "WindowsPath", "join"})  # what makes names of files
_AT_MOST = 5  # names of a name of a file


@dataclass(frozen=True)
class Files:
    """The functions of a notebook that read a file of a given name, and the variables that hold names of files."""

    readers: Set[str] = _READERS
    names: Set[str] = field(default_factory=frozenset)
    own: Set[str] = field(default_factory=frozenset)  # the notebook's own functions that are called as a reader is
    methods: Set[str] = field(default_factory=frozenset)  # those of its classes that are
    paths: Set[str] = _PATHS  # what makes names of files, but for the notebook's own of that name

    @classmethod
    def of(cls, body: Sequence[ast.stmt]) -> Files:
        """Those of these statements."""
        functions = {each.name: each for each in body if isinstance(each, followed.FUNCTIONS)}
        classes = [each for each in body if isinstance(each, ast.ClassDef)]
        readers, own = set(_READERS), set(functions) & _READERS
        for name, function in functions.items():
            if _reads_its_first(function):
                readers.add(name)
                own.discard(name)
        methods = {node.name for each in classes for node in each.body if isinstance(node, followed.FUNCTIONS)}
        values: dict[str, list[ast.AST | None]] = {}
        for node in chain.from_iterable(map(ast.walk, chain.from_iterable(map(at_once, body)))):
            targets, value = bound(node)
            for target in targets:
                if isinstance(target, ast.Name):
                    values.setdefault(target.id, []).append(value)
        lambdas = {name for name, given in values.items() if any(isinstance(each, ast.Lambda) for each in given)}
        own |= lambdas & _READERS
        paths = _PATHS - functions.keys() - {each.name for each in classes} - lambdas
        names: set[str] = set()
        for _ in range(_AT_MOST):
            names |= {name for name, given in values.items() if all(_is_name(each, names, paths) for each in given)}
        for statement in body:
            if isinstance(statement, ast.ImportFrom):
                readers |= {each.asname for each in statement.names if each.asname and each.name in _READERS}
        readers |= {
            name
            for name, given in values.items()
            if any(isinstance(each, ast.Attribute | ast.Name) and last_word(each) in _READERS for each in given)
        }
        return cls(readers, names, own, methods & _READERS, paths)

    def read_by(self, statement: ast.stmt) -> bool:
        """Whether a statement cannot do without a file that it names."""
        if isinstance(statement, ast.Try | ast.If):  # with a way out
            return False
        return any(self._reads(call) for call in _calls(statement))

    def _reads(self, call: ast.Call) -> bool:
        function, word = call.func, last_word(call.func)
        on_path = isinstance(function, ast.Attribute) and _is_name(function.value, self.names, self.paths)
        if on_path and word in _OF_PATHS:
            return not _writes(call.args[:1], call.keywords)
        if word not in self.readers or word in (self.own if isinstance(function, ast.Name) else self.methods):
            return False
        return bool(call.args) and _is_name(call.args[0], self.names, self.paths) and not _opens_to_write(call)


def _calls(tree: ast.AST) -> list[ast.Call]:
    return [node for node in ast.walk(tree) if isinstance(node, ast.Call)]


def _reads_its_first(function: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Whether a function cannot do without the file that its first argument names."""
    arguments = [*function.args.posonlyargs, *function.args.args]
    ways_out = (node for node in ast.walk(function) if isinstance(node, ast.Try | ast.If))
    optional = {call for each in ways_out for call in _calls(each)}
    return any(
        isinstance(given, ast.Name) and given.id == arguments[0].arg and not _opens_to_write(call)
        for call in _calls(function)
        if arguments and call not in optional and last_word(call.func) in _READERS
        for given in call.args[:1]
    )


def _is_name(value: ast.AST | None, names: Set[str], paths: Set[str]) -> bool:
    """Whether an expression is the name of a file: a text, a path made of one, or a variable of `names`."""
    while isinstance(value, ast.BinOp):  # `Path("logs") / name`
        value = value.left
    if isinstance(value, ast.Call):
        return last_word(value.func) in paths
    if isinstance(value, ast.Name):
        return value.id in names
    return isinstance(value, ast.JoinedStr) or (isinstance(value, ast.Constant) and isinstance(value.value, str))


def _opens_to_write(call: ast.Call) -> bool:
    return last_word(call.func) == "open" and _writes(call.args[1:2], call.keywords)


def _writes(mode: Sequence[ast.expr], keywords: Sequence[ast.keyword]) -> bool:
    modes = [*mode, *(word.value for word in keywords if word.arg == "mode")]
    return any(isinstance(each, ast.Constant) and not str(each.value).startswith("r") for each in modes)
