"""Which statements of a notebook make the names that are asked for, and what these need. Nothing is run.

A statement makes the names that it binds, those whose parts it sets (`params["Kp"] = 2.0`, `params.update(...)`), and
those that a function of the notebook changes when it calls it (`def tune(): params["Kp"] = 2.0`, then `tune()`).
"""

from __future__ import annotations

import ast
import symtable
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from rds.grading.sandbox.packages import ALLOWED

_OF_LISTS = {"append", "clear", "extend", "fill", "insert", "pop", "put", "remove", "reverse", "sort"}
_OF_TABLES = {"add", "discard", "popitem", "setdefault", "update"}
_CHANGING = frozenset(_OF_LISTS | _OF_TABLES)
"""Methods that change what they are called on."""

_THERE = frozenset({*sys.stdlib_module_names, *ALLOWED})  # modules that a submission can import


@dataclass
class _Effect:
    """What a call of a function of the notebook's changes: `names` of the notebook, or its arguments."""

    names: set[str] = field(default_factory=set)
    is_of_arguments: bool = False
    uses: set[str] = field(default_factory=set)

    @property
    def is_there(self) -> bool:
        return bool(self.names) or self.is_of_arguments


def needed(body: Sequence[ast.stmt], wanted: set[str]) -> tuple[set[int], tuple[str, ...]]:
    """The numbers of the statements that make the `wanted` names, and of those that make what these use.

    Also the functions that change such a name, but cannot be called where it is graded, as they need modules that are
    not there: their calls are left out.
    """
    effects, elsewhere = _effects(body)
    facts = [_made_and_used(statement, effects) for statement in body]
    makers: dict[str, list[int]] = {}
    for number, (made, _) in enumerate(facts):
        for name in made:
            makers.setdefault(name, []).append(number)
    keep = {number for number, statement in enumerate(body) if _is_for_all(statement)}
    known, todo = set(wanted), list(wanted)
    while todo:
        for number in makers.get(todo.pop(), ()):
            if number not in keep:
                keep.add(number)
                new = facts[number][1] - known
                known |= new
                todo += new
    called = {name for number, statement in enumerate(body) if number not in keep for name in _called(statement)}
    return keep, tuple(sorted(name for name in called & elsewhere.keys() if elsewhere[name].names & known))


def _is_for_all(statement: ast.stmt) -> bool:
    """Whether it concerns all code: `from __future__ import`, and `from x import *`, of which nobody knows."""
    return isinstance(statement, ast.ImportFrom) and (
        statement.module == "__future__" or any(alias.name == "*" for alias in statement.names)
    )


def _effects(body: Sequence[ast.stmt]) -> tuple[dict[str, _Effect], dict[str, _Effect]]:
    """By function what its calls change; then those functions that can only be called on the author's own computer."""
    functions = {each.name: each for each in body if isinstance(each, ast.FunctionDef)}
    found = {name: _effect(node) for name, node in functions.items()}
    has_grown = True
    while has_grown:  # until what is called by what is called is in it, too
        has_grown = False
        for effect in found.values():
            before = len(effect.names), len(effect.uses)
            for other in [found[name] for name in effect.uses & found.keys()]:
                effect.names |= other.names
                effect.uses |= other.uses
            has_grown |= (len(effect.names), len(effect.uses)) != before
    absent = {name for statement in body for name in _not_there(statement)}
    found = {name: effect for name, effect in found.items() if effect.is_there}
    elsewhere = {name: effect for name, effect in found.items() if effect.uses & absent}
    return {name: effect for name, effect in found.items() if name not in elsewhere}, elsewhere


def _not_there(statement: ast.stmt) -> Iterator[str]:
    """The names of modules that a submission cannot import."""
    if isinstance(statement, ast.Import):
        yield from (
            alias.asname or alias.name.split(".")[0]
            for alias in statement.names
            if alias.name.split(".")[0] not in _THERE
        )
    elif isinstance(statement, ast.ImportFrom) and (statement.module or "").split(".")[0] not in _THERE:
        yield from (alias.asname or alias.name for alias in statement.names)


def _effect(function: ast.FunctionDef) -> _Effect:
    effect = _Effect()
    arguments = {node.arg for node in ast.walk(function.args) if isinstance(node, ast.arg)}
    bound: set[str] = set()
    for node in ast.walk(function):
        if isinstance(node, ast.Global):
            effect.names |= set(node.names)
        elif isinstance(node, ast.Name):
            (effect.uses if isinstance(node.ctx, ast.Load) else bound).add(node.id)
    own = (bound | arguments) - effect.names
    for root in _changed(function):
        if root in arguments:
            effect.is_of_arguments = True
        elif root not in own:
            effect.names.add(root)
    return effect


def _changed(tree: ast.AST) -> Iterator[str]:
    """The names that something in the tree changes without binding them."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute | ast.Subscript) and not isinstance(node.ctx, ast.Load):
            yield _root(node)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in _CHANGING:
            yield _root(node.func)


def _called(statement: ast.stmt) -> Iterator[str]:
    """The functions that a statement calls by their names."""
    for tree in _at_once(statement):
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                yield node.func.id


def _at_once(statement: ast.stmt) -> Sequence[ast.AST]:
    """What of it runs where it stands: of a definition only its decorators."""
    if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return [ast.Call(func=each, args=[], keywords=[]) for each in statement.decorator_list]
    return [statement]


def _made_and_used(statement: ast.stmt, effects: Mapping[str, _Effect]) -> tuple[set[str], set[str]]:
    """The names that a statement binds or changes, and those of the notebook that it needs, in functions too."""
    top = symtable.symtable(ast.unparse(statement), "notebook", "exec")
    made = {symbol.get_name() for symbol in top.get_symbols() if symbol.is_assigned() or symbol.is_imported()}
    used = {symbol.get_name() for symbol in top.get_symbols() if symbol.is_referenced()}
    tables = top.get_children()
    while tables:
        table = tables.pop()
        used |= {symbol.get_name() for symbol in table.get_symbols() if symbol.is_global()}
        tables += table.get_children()
    for tree in _at_once(statement):
        made |= set(_changed(tree))
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in effects:
                effect = effects[node.func.id]
                made |= effect.names
                if effect.is_of_arguments:
                    made |= {_root(each) for each in (*node.args, *(word.value for word in node.keywords))}
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Call):
        made.add(_root(statement.value.func))  # controller.tune(...), whatever that does
        if isinstance(statement.value.func, ast.Name):
            made.discard(statement.value.func.id)
    return made - {""}, used


def _root(node: ast.AST) -> str:
    """The name that an expression such as `a`, `a.b` or `a.b[c].d` begins with; "" if it begins otherwise."""
    while isinstance(node, ast.Attribute | ast.Subscript):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""
