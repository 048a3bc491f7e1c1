"""Whether a notebook sets anew what a statement set that cannot be run where it is graded. Nothing is run.

`params["Kp"] = fit.gain` may be left out where `params["Kp"] = 30.0` follows, and not where `params["Kd"] = 0.2` does:
then the gain that the notebook ran is another one than what would be graded.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

from rds.grading.intake.bindings import CHANGING, at_once, bound, root, stored, used_within


@dataclass(frozen=True)
class _Set:
    """What a plain statement sets of a name: all of it, or the `keys` of a table."""

    name: str
    keys: frozenset[object] | None = None


def is_set_again(body: Sequence[ast.stmt], later: Iterable[int], number: int, names: Iterable[str]) -> bool:
    """Whether the statements `later` set all of `names` that statement `number` sets, before one of them reads it."""
    after = sorted(each for each in later if each > number)
    functions = {each.name: each for each in body if isinstance(each, ast.FunctionDef)}
    return all(_is_set_again(body, after, number, name, functions) for name in names)


def _is_set_again(
    body: Sequence[ast.stmt], after: Sequence[int], number: int, name: str, functions: Mapping[str, ast.FunctionDef]
) -> bool:
    left = _keys_set(body[number], name, functions) or _keys_there(body[:number], name)
    for each in after:
        sets = [one for one in _plainly_set(body[each]) if one.name == name]
        if name in _read(body[each], functions):
            return False
        for one in sets:
            if one.keys is None:
                return True
            if left and not (left := left - one.keys):
                return True
    return False


def _keys_set(statement: ast.stmt, name: str, functions: Mapping[str, ast.FunctionDef]) -> frozenset[object]:
    """The keys of the table `name` that a statement sets, with the functions that it names; none if it may set all."""
    trees = [*at_once(statement)]
    named = {each.id for tree in trees for each in ast.walk(tree) if isinstance(each, ast.Name)}
    trees += [functions[each] for each in named & functions.keys()]
    keys: set[object] = set()
    for node in chain.from_iterable(map(ast.walk, trees)):
        if isinstance(node, ast.Subscript) and not isinstance(node.ctx, ast.Load) and root(node) == name:
            if not isinstance(node.value, ast.Name) or not isinstance(node.slice, ast.Constant):
                return frozenset()
            keys.add(node.slice.value)
        elif isinstance(node, ast.Name | ast.Attribute) and not isinstance(node.ctx, ast.Load) and root(node) == name:
            return frozenset()
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and root(node.func) == name:
            given = _keys_given(node)
            if node.func.attr in CHANGING and (node.func.attr != "update" or given is None):
                return frozenset()
            keys |= (given if node.func.attr == "update" else None) or set()
    return frozenset(keys)


def _keys_there(before: Sequence[ast.stmt], name: str) -> frozenset[object]:
    """The keys of the table `name` from where it was last bound on; none where these are not known."""
    added: frozenset[object] = frozenset()
    for statement in reversed(before):
        sets = [one.keys for one in _plainly_set(statement) if one.name == name]
        if None in sets:
            keys = _keys_of(bound(statement)[1])
            return frozenset() if keys is None else keys | added
        if not all(sets) or (not sets and _is_set_within(statement, name)):
            return frozenset()
        added = added.union(*filter(None, sets))
    return frozenset()


def _keys_of(value: ast.AST | None) -> frozenset[object] | None:
    """The keys of a table that is written out; None where these are not known."""
    if isinstance(value, ast.Dict) and all(isinstance(key, ast.Constant) for key in value.keys):
        return frozenset(key.value for key in value.keys if isinstance(key, ast.Constant))
    if isinstance(value, ast.Call) and isinstance(value.func, ast.Name) and value.func.id == "dict":
        words = [word.arg for word in value.keywords]
        return None if value.args or None in words else frozenset(words)
    return None


def _is_set_within(statement: ast.stmt, name: str) -> bool:
    """Whether a statement, such as a loop, sets a name or parts of what it stands for."""
    return any(
        isinstance(node, ast.Name | ast.Attribute | ast.Subscript)
        and not isinstance(node.ctx, ast.Load)
        and root(node) == name
        for node in chain.from_iterable(map(ast.walk, at_once(statement)))
    )


def _plainly_set(statement: ast.stmt) -> Iterator[_Set]:
    """What a statement at the left margin sets, whatever was there before."""
    if isinstance(statement, ast.FunctionDef | ast.ClassDef):
        yield _Set(statement.name)
    elif isinstance(statement, ast.Assign | ast.AnnAssign):
        for target in bound(statement)[0] if statement.value is not None else ():
            for part in target.elts if isinstance(target, ast.Tuple | ast.List) else [target]:
                if isinstance(part, ast.Name):
                    yield _Set(part.id)
                elif isinstance(part, ast.Subscript) and isinstance(part.value, ast.Name):
                    key = part.slice
                    if isinstance(key, ast.Constant):
                        yield _Set(part.value.id, frozenset({key.value}))
    elif isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Call):
        method = statement.value.func
        if isinstance(method, ast.Attribute) and method.attr == "update" and isinstance(method.value, ast.Name):
            yield _Set(method.value.id, frozenset(_keys_given(statement.value) or ()))


def _keys_given(called: ast.Call) -> set[object] | None:
    """The keys of what `update(...)` is called with; None where these are not known."""
    keys: set[object] = set()
    for given in called.args:
        if not isinstance(given, ast.Dict) or not all(isinstance(key, ast.Constant) for key in given.keys):
            return None
        keys |= {key.value for key in given.keys if isinstance(key, ast.Constant)}
    for word in called.keywords:
        if word.arg is None:
            return None
        keys.add(word.arg)
    return keys


def _read(statement: ast.stmt, functions: Mapping[str, ast.FunctionDef]) -> set[str]:
    """The names whose values a statement uses where it stands, also by the functions that it names.

    Not those whose parts it only sets.
    """
    only_set: set[int] = set()
    if isinstance(statement, ast.Assign | ast.AnnAssign):
        parts = chain.from_iterable(map(ast.walk, bound(statement)[0]))
        only_set = {id(part.value) for part in parts if isinstance(part, ast.Subscript | ast.Attribute)}
    elif isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Call):
        function = statement.value.func
        if isinstance(function, ast.Attribute) and function.attr == "update":
            only_set = {id(function.value)}
    found = set()
    for node in chain.from_iterable(map(ast.walk, [*at_once(statement), *_run_by_definition(statement)])):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and id(node) not in only_set:
            found.add(node.id)
        elif isinstance(node, ast.AugAssign):
            found |= {root(node.target), *stored(node.target)}
    called: set[str] = set()
    while more := (found & functions.keys()) - called:
        called |= more
        found = found.union(*(used_within(functions[each]) for each in more))
    return found


def _run_by_definition(statement: ast.stmt) -> Sequence[ast.AST]:
    """What a definition runs where it stands, beside decorators: a function's defaults, and a class's statements."""
    if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef):
        return [default for default in (*statement.args.defaults, *statement.args.kw_defaults) if default is not None]
    if isinstance(statement, ast.ClassDef):
        within = ((*at_once(each), *_run_by_definition(each)) for each in statement.body)
        return [*statement.bases, *chain.from_iterable(within)]
    return []
