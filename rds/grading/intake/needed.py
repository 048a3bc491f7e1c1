"""Which statements of a notebook make the names that are asked for, and what these need. Nothing is run.

A statement makes the names that it binds, those whose parts it sets (`params["Kp"] = 2.0`, `params.update(...)`), and
those that a function of the notebook changes when it calls it (`def tune(): params["Kp"] = 2.0`, then `tune()`, or
`minimize_scalar(tune)`). What is changed under one name is changed under all that it has (`q = params`, `for q in
[params]`, `tuner = Tuner(params)`).
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

_BY_FIRST_ARGUMENT = frozenset({"setattr", "delattr", "setitem", "delitem"})
"""Functions that change their first argument, whatever module they are taken from."""

_THERE = frozenset({*sys.stdlib_module_names, *ALLOWED})  # modules that a submission can import


@dataclass
class _Effect:
    """What a call of a function of the notebook's changes: `names` of the notebook, or its arguments."""

    names: set[str] = field(default_factory=set)
    is_of_arguments: bool = False
    uses: set[str] = field(default_factory=set)
    handed: set[str] = field(default_factory=set)  # what it calls functions with
    arguments: set[str] = field(default_factory=set)

    @property
    def is_there(self) -> bool:
        return bool(self.names) or self.is_of_arguments


def needed(body: Sequence[ast.stmt], wanted: set[str]) -> tuple[set[int], tuple[str, ...]]:
    """The numbers of the statements that make the `wanted` names, and of those that make what these use.

    Also the functions that change such a name, but cannot be called where it is graded, as they need modules that are
    not there: their calls are left out.
    """
    effects, elsewhere = _effects(body)
    alike = _names_of_the_same(body, {name for statement in body for name in _not_there(statement)})
    facts = [_made_and_used(statement, effects, alike) for statement in body]
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
            before = len(effect.names), len(effect.uses), effect.is_of_arguments
            for other in [found[name] for name in effect.uses & found.keys()]:
                effect.names |= other.names
                effect.uses |= other.uses
                if other.is_of_arguments:  # those that it hands on: its own, or the notebook's
                    effect.names |= effect.handed - effect.arguments
                    effect.is_of_arguments |= bool(effect.handed & effect.arguments)
            after = len(effect.names), len(effect.uses), effect.is_of_arguments
            has_grown |= after != before
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
    alike = _names_of_the_same(function.body, set())
    for root in _changed(function):
        for name in {root} | alike.get(root, set()):
            if name in arguments:
                effect.is_of_arguments = True
            elif name not in own:
                effect.names.add(name)
    effect.arguments = arguments
    calls = [node for node in ast.walk(function) if isinstance(node, ast.Call)]
    effect.handed = {_root(each) for node in calls for each in node.args} - (bound - arguments) - {""}
    return effect


def _changed(tree: ast.AST) -> Iterator[str]:
    """The names that something in the tree changes without binding them."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute | ast.Subscript) and not isinstance(node.ctx, ast.Load):
            yield _root(node)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in _CHANGING:
            yield _root(node.func)
            if node.args:
                yield _root(node.args[0])  # dict.update(params, ...)
        elif isinstance(node, ast.Call) and node.args and _last_word(node.func) in _BY_FIRST_ARGUMENT:
            yield _root(node.args[0])
        elif isinstance(node, ast.AugAssign):
            yield _root(node.target)  # params |= {...}


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


def _names_of_the_same(body: Sequence[ast.stmt], absent: set[str]) -> dict[str, set[str]]:
    """By name all names that may stand for the same object: by assignments, loops and `with`."""
    groups: dict[str, set[str]] = {}
    for statement in body:
        for tree in _at_once(statement):
            for node in ast.walk(tree):
                targets, value = _bound(node)
                names = {each.id for target in targets for each in ast.walk(target) if isinstance(each, ast.Name)}
                own = _handed_on(value, absent)
                if names and own:
                    whole = set().union(names, own, *(groups.get(name, ()) for name in names | own))
                    groups |= dict.fromkeys(whole, whole)
    return groups


def _bound(node: ast.AST) -> tuple[Sequence[ast.AST], ast.AST | None]:
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


def _handed_on(value: ast.AST | None, absent: set[str]) -> set[str]:
    """The names whose objects an expression gives, alone or in a list; what a call gives may hold its arguments.

    What modules give that are not `there` holds runs and pictures, and nothing that is graded.
    """
    if isinstance(value, ast.Name):
        return {value.id}
    if isinstance(value, ast.Attribute | ast.Subscript):
        return {_root(value)} - {""}
    if isinstance(
        value, ast.List | ast.Tuple | ast.Set | ast.Dict | ast.IfExp | ast.BoolOp | ast.Starred | ast.NamedExpr
    ):
        return set().union(*(_handed_on(each, absent) for each in ast.iter_child_nodes(value)))
    if isinstance(value, ast.Call) and _root(value.func) not in absent:
        given = [*value.args, *(word.value for word in value.keywords)]
        return set().union(
            *(_handed_on(each, absent) for each in given if not isinstance(each, ast.Attribute | ast.Subscript))
        )
    return set()


def _made_and_used(
    statement: ast.stmt, effects: Mapping[str, _Effect], alike: Mapping[str, set[str]]
) -> tuple[set[str], set[str]]:
    """The names that a statement binds or changes, and those of the notebook that it needs, in functions too."""
    top = symtable.symtable(ast.unparse(statement), "notebook", "exec")
    made = {symbol.get_name() for symbol in top.get_symbols() if symbol.is_assigned() or symbol.is_imported()}
    used = {symbol.get_name() for symbol in top.get_symbols() if symbol.is_referenced()}
    tables = top.get_children()
    while tables:
        table = tables.pop()
        used |= {symbol.get_name() for symbol in table.get_symbols() if symbol.is_global()}
        tables += table.get_children()
    changed: set[str] = set()
    for tree in _at_once(statement):
        changed |= set(_changed(tree))
        for node in ast.walk(tree):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and node.id in effects:
                changed |= effects[node.id].names  # called here, or by what it is handed to
            called = node.func.id if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) else ""
            if isinstance(node, ast.Call) and called in effects and effects[called].is_of_arguments:
                changed |= {_root(each) for each in (*node.args, *(word.value for word in node.keywords))}
    given = statement.value if isinstance(statement, ast.Expr) else None
    if isinstance(given, ast.Call) and isinstance(given.func, ast.Attribute):
        changed.add(_root(given.func))  # tuner.go()
    made |= changed.union(*(alike.get(name, ()) for name in changed))
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Call):
        made.add(_root(statement.value.func))  # controller.tune(...), whatever that does
        if isinstance(statement.value.func, ast.Name):
            made.discard(statement.value.func.id)
    return made - {""}, used


def _last_word(node: ast.AST) -> str:
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""


def _root(node: ast.AST) -> str:
    """The name that an expression such as `a`, `a.b` or `a.b[c].d` begins with; "" if it begins otherwise."""
    while isinstance(node, ast.Attribute | ast.Subscript):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""
