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

_DEFINITIONS = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


@dataclass(frozen=True)
class _Set:
    """What a plain statement sets of a name: all of it, or the `keys` of a table."""

    name: str
    keys: frozenset[object] | None = None


class Overwriting:
    """Asked of one notebook, statement by statement; what is the same for all of them is looked up once."""

    def __init__(self, body: Sequence[ast.stmt]) -> None:
        self._body = body
        self._code = {each.name: each for each in body if isinstance(each, _DEFINITIONS)}
        self._has_another_name: dict[str, bool] = {}
        self._reads: dict[int, set[str]] = {}

    def __call__(self, later: Iterable[int], number: int, names: Iterable[str]) -> bool:
        """Whether the statements `later` set all of `names` that statement `number` sets, before one reads it."""
        after = sorted(each for each in later if each > number)
        return all(self._is_set_again(after, number, name) for name in names)

    def _is_set_again(self, after: Sequence[int], number: int, name: str) -> bool:
        body, code = self._body, self._code
        if name not in self._has_another_name:
            self._has_another_name[name] = _has_another_name(body, name)
        keys = frozenset() if self._has_another_name[name] else _keys_set(body[number], name, code)
        left = keys or _keys_there(body[:number], name)
        for each in after:
            if each not in self._reads:
                self._reads[each] = _read(body[each], code)
            if name in self._reads[each]:
                return False
            for one in _plainly_set(body[each]):
                if one.name != name:
                    continue
                if one.keys is None:
                    return True
                if left and not (left := left - one.keys):
                    return True
        return False


def _has_another_name(body: Sequence[ast.stmt], name: str) -> bool:
    """Whether the object `name`, or what changes it, is given another name, as in `put = params.update`."""
    return any(_hands_on(bound(node)[1], name) for node in chain.from_iterable(map(ast.walk, body)))


def _hands_on(value: ast.AST | None, name: str) -> bool:
    if isinstance(value, ast.Name | ast.Attribute):
        return root(value) == name
    if isinstance(value, ast.Call | ast.Subscript | ast.Lambda | None):  # an experiment has a table of its own
        return False
    return any(_hands_on(each, name) for each in ast.iter_child_nodes(value))


def _run_by(statement: ast.stmt, code: Mapping[str, ast.stmt]) -> list[ast.AST]:
    """What runs where a statement stands, with the functions and classes of the notebook that it names."""
    found: list[ast.AST] = [*at_once(statement)]
    done: set[str] = set()
    for tree in found:  # it grows
        named = {each.id for each in ast.walk(tree) if isinstance(each, ast.Name)} & code.keys() - done
        done |= named
        found += [code[each] for each in sorted(named)]
    return found


def _keys_set(statement: ast.stmt, name: str, code: Mapping[str, ast.stmt]) -> frozenset[object]:
    """The keys of the table `name` that a statement sets, with the functions that it names; none if it may set all."""
    keys: set[object] = set()
    for node in chain.from_iterable(map(ast.walk, _run_by(statement, code))):
        if isinstance(node, ast.Subscript) and not isinstance(node.ctx, ast.Load) and root(node) == name:
            if not isinstance(node.value, ast.Name) or not isinstance(node.slice, ast.Constant):
                return frozenset()
            keys.add(node.slice.value)
        elif isinstance(node, ast.Name | ast.Attribute) and not isinstance(node.ctx, ast.Load) and root(node) == name:
            return frozenset()
        elif isinstance(node, ast.Call):
            given = [*node.args, *(word.value for word in node.keywords)]
            if root(node.func) in code and any(_hands_on(each, name) for each in given):
                return frozenset()
            if isinstance(node.func, ast.Attribute) and root(node.func) == name:
                known = _keys_given(node)
                if node.func.attr in CHANGING and (node.func.attr != "update" or known is None):
                    return frozenset()
                keys |= (known if node.func.attr == "update" else None) or set()
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


def _read(statement: ast.stmt, code: Mapping[str, ast.stmt]) -> set[str]:
    """The names whose values a statement uses where it stands: not those whose parts it only sets."""
    trees = [*_run_by(statement, code), *_run_by_definition(statement)]
    found: set[str] = set()
    for tree in trees:
        read = _loaded(tree)
        found |= read & used_within(tree) if isinstance(tree, _DEFINITIONS) else read
    return found


def _loaded(tree: ast.AST) -> set[str]:
    only_set: set[int] = set()
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign | ast.AnnAssign):
            parts = chain.from_iterable(map(ast.walk, bound(node)[0]))
            only_set |= {id(part.value) for part in parts if isinstance(part, ast.Subscript | ast.Attribute)}
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            function = node.value.func
            if isinstance(function, ast.Attribute) and function.attr == "update":
                only_set.add(id(function.value))
        elif isinstance(node, ast.AugAssign):
            found |= {root(node.target), *stored(node.target)}
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and id(node) not in only_set:
            found.add(node.id)
    return found


def _run_by_definition(statement: ast.stmt) -> Sequence[ast.AST]:
    """What a definition runs where it stands, beside decorators: a function's defaults, and a class's statements."""
    if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef):
        return [default for default in (*statement.args.defaults, *statement.args.kw_defaults) if default is not None]
    if isinstance(statement, ast.ClassDef):
        within = ((*at_once(each), *_run_by_definition(each)) for each in statement.body)
        return [*statement.bases, *chain.from_iterable(within)]
    return []
