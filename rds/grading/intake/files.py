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

    @classmethod
    def of(cls, body: Sequence[ast.stmt]) -> Files:
        """Those of these statements."""
        functions = {each.name: each for each in body if isinstance(each, followed.FUNCTIONS)}
        readers, own = set(_READERS), set(functions) & _READERS
        for name, function in functions.items():
            arguments = {node.arg for node in ast.walk(function.args) if isinstance(node, ast.arg)}
            if any(_name_of(call) in arguments for call in _calls(function) if last_word(call.func) in _READERS):
                readers.add(name)
                own.discard(name)
        values: dict[str, list[ast.AST | None]] = {}
        for node in chain.from_iterable(map(ast.walk, chain.from_iterable(map(at_once, body)))):
            targets, value = bound(node)
            for target in targets:
                if isinstance(target, ast.Name):
                    values.setdefault(target.id, []).append(value)
        names: set[str] = set()
        for _ in range(_AT_MOST):
            names |= {name for name, given in values.items() if all(_is_name(each, names) for each in given)}
        for statement in body:
            if isinstance(statement, ast.ImportFrom):
                readers |= {each.asname for each in statement.names if each.asname and each.name in _READERS}
        readers |= {
            name
            for name, given in values.items()
            if any(isinstance(each, ast.Attribute | ast.Name) and last_word(each) in _READERS for each in given)
        }
        return cls(readers, names, own)

    def read_by(self, statement: ast.stmt) -> bool:
        """Whether a statement cannot do without a file that it names."""
        if isinstance(statement, ast.Try | ast.If):  # with a way out
            return False
        return any(self._reads(call) for call in _calls(statement))

    def _reads(self, call: ast.Call) -> bool:
        function, word = call.func, last_word(call.func)
        if isinstance(function, ast.Attribute) and word in _OF_PATHS and _is_name(function.value, self.names):
            return not _writes(call.args[:1], call.keywords)
        if word not in self.readers or (isinstance(function, ast.Name) and word in self.own) or not call.args:
            return False
        return _is_name(call.args[0], self.names) and not (word == "open" and _writes(call.args[1:2], call.keywords))


def _calls(tree: ast.AST) -> list[ast.Call]:
    return [node for node in ast.walk(tree) if isinstance(node, ast.Call)]


def _name_of(call: ast.Call) -> str:
    return call.args[0].id if call.args and isinstance(call.args[0], ast.Name) else ""


def _is_name(value: ast.AST | None, names: Set[str]) -> bool:
    """Whether an expression is the name of a file: a text, a path made of one, or a variable of `names`."""
    while isinstance(value, ast.BinOp):  # `Path("logs") / name`
        value = value.left
    if isinstance(value, ast.Call):
        return last_word(value.func) in _PATHS
    if isinstance(value, ast.Name):
        return value.id in names
    return isinstance(value, ast.JoinedStr) or (isinstance(value, ast.Constant) and isinstance(value.value, str))


def _writes(mode: Sequence[ast.expr], keywords: Sequence[ast.keyword]) -> bool:
    modes = [*mode, *(word.value for word in keywords if word.arg == "mode")]
    return any(isinstance(each, ast.Constant) and not str(each.value).startswith("r") for each in modes)
