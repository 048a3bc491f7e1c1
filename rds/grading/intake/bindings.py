"""The names of a notebook: what statements bind, what is there where it is graded, what can be changed in place."""

from __future__ import annotations

import ast
import symtable
import sys
from collections.abc import Collection, Iterator, Sequence
from itertools import chain
from typing import TYPE_CHECKING

from rds.grading.intake import followed
from rds.grading.sandbox.packages import ALLOWED

if TYPE_CHECKING:
    from rds.grading.intake.files import Files

_THERE = frozenset({*sys.stdlib_module_names, *ALLOWED})  # modules that a submission can import
_OF_LISTS = {"append", "clear", "extend", "fill", "insert", "pop", "put", "remove", "reverse", "sort"}
_OF_TABLES = {"add", "discard", "popitem", "setdefault", "update"}
CHANGING = frozenset(_OF_LISTS | _OF_TABLES)
"""Methods that change what they are called on."""


def imported(statement: ast.stmt) -> Iterator[tuple[str, str]]:
    """The names that an import binds, with the module that each is of."""
    if isinstance(statement, ast.Import):
        yield from ((a.asname or a.name.split(".")[0], a.name.split(".")[0]) for a in statement.names)
    elif isinstance(statement, ast.ImportFrom):
        yield from ((a.asname or a.name, (statement.module or "").split(".")[0]) for a in statement.names)


def not_there(statement: ast.stmt) -> Iterator[str]:
    """The names of modules that a submission cannot import."""
    if isinstance(statement, ast.Import):
        yield from (
            alias.asname or alias.name.split(".")[0]
            for alias in statement.names
            if alias.name.split(".")[0] not in _THERE
        )
    elif isinstance(statement, ast.ImportFrom) and (statement.module or "").split(".")[0] not in _THERE:
        yield from (alias.asname or alias.name for alias in statement.names)


def from_elsewhere(body: Sequence[ast.stmt], wanted: set[str], files: Files) -> list[frozenset[str]]:
    """By statement the names that cannot be had there: modules, what is read from files, and what is made of these."""
    code = {name for statement in body for name in not_there(statement)}
    before = -1
    while before != (before := len(code)):
        for statement in body:
            if isinstance(statement, (*followed.FUNCTIONS, ast.ClassDef)) and followed.names_in(statement) & code:
                code |= {statement.name} - wanted
    found, now = [], frozenset(code)  # most statements have the same: no copy for each
    for statement in body:
        here = now
        if isinstance(statement, followed.FUNCTIONS):
            if used_within(statement) & now or files.read_by(statement):
                now = now | {statement.name} - wanted
            elif statement.name in now - code:
                now -= {statement.name}
        for node in chain.from_iterable(map(ast.walk, at_once(statement))):
            targets, value = bound(node)
            names = set(chain.from_iterable(map(stored, targets))) - wanted
            if value is not None and (followed.names_in(value) & now or files.read_by(statement)):
                now, here = now | names, here | names
            elif isinstance(statement, ast.Assign) and (names - code) & now:
                now -= names - code
        found.append(here)
    return found


def used_within(function: ast.AST) -> set[str]:
    """The names of the notebook that a function or a class uses: not its own, which may be called the same."""
    tables, found = symtable.symtable(ast.unparse(function), "notebook", "exec").get_children(), set()
    while tables:
        table = tables.pop()
        found |= {symbol.get_name() for symbol in table.get_symbols() if symbol.is_global()}
        tables += table.get_children()
    return found


def table_of(statement: ast.stmt) -> symtable.SymbolTable:
    """The names of a statement, with its comprehensions as generators: from Python 3.12 on the variables of all others
    count as the notebook's own.
    """
    text = ast.unparse(statement)
    if any(isinstance(node, ast.ListComp | ast.SetComp | ast.DictComp) for node in ast.walk(statement)):
        text = ast.unparse(_Generators().visit(ast.parse(text)))
    return symtable.symtable(text, "notebook", "exec")


class _Generators(ast.NodeTransformer):
    def generic_visit(self, node: ast.AST) -> ast.AST:
        super().generic_visit(node)
        if isinstance(node, ast.ListComp | ast.SetComp):
            return ast.GeneratorExp(node.elt, node.generators)
        if isinstance(node, ast.DictComp):
            return ast.GeneratorExp(ast.Tuple([node.key, node.value], ast.Load()), node.generators)
        return node


def stored(target: ast.AST) -> Iterator[str]:
    """The names that a target binds, without those whose parts it sets."""
    yield from (e.id for e in ast.walk(target) if isinstance(e, ast.Name) and isinstance(e.ctx, ast.Store))


def mutable(body: Sequence[ast.stmt], known: set[str], functions: Collection[str]) -> set[str]:
    """The known names that the notebook binds to other things than numbers, texts and functions."""
    found, plain = set(), True
    values: dict[str, list[ast.AST | None]] = {}
    for statement in body:
        if isinstance(statement, ast.ClassDef):
            found.add(statement.name)
        for node in chain.from_iterable(map(ast.walk, at_once(statement))):
            targets, value = bound(node)
            for target, given in _pairs(targets, value):
                whole = given if isinstance(target, ast.Name) and not isinstance(node, ast.For) else None
                for name in stored(target):
                    values.setdefault(name, []).append(whole)
    numbers = set(functions)
    while plain:
        more = {n for n, given in values.items() if n not in numbers and all(is_plain(v, numbers) for v in given)}
        numbers |= more
        plain = bool(more)
    return (found | (values.keys() - numbers)) & known


def _pairs(targets: Sequence[ast.AST], value: ast.AST | None) -> Iterator[tuple[ast.AST, ast.AST | None]]:
    """Each target with what is bound to it: `K, tau = 1.6, 0.012` binds two numbers."""
    for target in targets:
        parts = target.elts if isinstance(target, ast.Tuple) else []
        values = value.elts if isinstance(value, ast.Tuple) else []
        if parts and values and not any(isinstance(each, ast.Starred) for each in (*parts, *values)):
            yield from zip(parts, values, strict=False)  # of other lengths, it does not run anyhow
        else:
            yield target, value


def is_plain(value: ast.AST | None, numbers: set[str]) -> bool:
    """Whether an expression is a number or a text."""
    if isinstance(value, ast.Name):
        return value.id in numbers
    if isinstance(value, ast.BinOp | ast.UnaryOp | ast.BoolOp):
        parts = [each for each in ast.iter_child_nodes(value) if isinstance(each, ast.expr)]
        return all(is_plain(each, numbers) for each in parts)
    if isinstance(value, ast.Call):
        return last_word(value.func) in ("float", "int", "round", "str", "len", "sqrt", "exp", "sum")
    return isinstance(value, ast.Constant | ast.Compare | ast.JoinedStr)


def at_once(statement: ast.stmt) -> Sequence[ast.AST]:
    """What of it runs where it stands: of a definition only its decorators."""
    if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return [ast.Call(func=each, args=[], keywords=[]) for each in statement.decorator_list]
    return [statement]


def bound(node: ast.AST) -> tuple[Sequence[ast.AST], ast.AST | None]:
    """What a node binds, and to what."""
    if isinstance(node, ast.Assign):
        return node.targets, node.value
    if isinstance(node, ast.AnnAssign | ast.NamedExpr):
        return [node.target], node.value
    if isinstance(node, ast.For | ast.AsyncFor | ast.comprehension):
        return [node.target], node.iter
    if isinstance(node, ast.withitem) and node.optional_vars is not None:
        return [node.optional_vars], node.context_expr
    return [], None


def last_word(node: ast.AST) -> str:
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""


def root(node: ast.AST) -> str:
    """The name that an expression such as `a`, `a.b` or `a.b[c].d` begins with; "" if it begins otherwise."""
    while isinstance(node, ast.Attribute | ast.Subscript):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""
