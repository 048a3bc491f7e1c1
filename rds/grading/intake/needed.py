"""Which statements of a notebook make the names that are asked for, and what these need. Nothing is run.

A statement makes the names that it binds, those whose parts it sets (`params["Kp"] = 2.0`, `params.update(...)`), and
those that a function of the notebook changes when it calls it (`def tune(): params["Kp"] = 2.0`, then `tune()`, or
`minimize_scalar(tune)`). What is changed under one name is changed under all that it has (`q = params`, `for q in
[params]`, `tuner = Tuner(params)`).
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from itertools import chain

from rds.grading.intake import followed
from rds.grading.intake.bindings import (
    CHANGING,
    at_once,
    bound,
    from_elsewhere,
    imported,
    last_word,
    mutable,
    not_there,
    root,
    stored,
    table_of,
)
from rds.grading.intake.files import Files
from rds.grading.intake.overwritten import Overwriting

_BY_FIRST_ARGUMENT = frozenset({"setattr", "delattr", "setitem", "delitem"})
"""Functions that change their first argument, whatever module they are taken from."""


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
    absent = from_elsewhere(body, wanted, Files.of(body))
    alike = _names_of_the_same(body, absent)
    facts = [
        _made_and_used(statement, effects, alike, wanted, there) for statement, there in zip(body, absent, strict=True)
    ]
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
    makes = _Makers(wanted, facts, makers)
    distinct = {id(names): names for names in absent}
    wider = {number: names | elsewhere.keys() for number, names in distinct.items()}
    there_too = [wider[id(names)] for names in absent]
    is_set_again = Overwriting(body)
    _follow(body, makes, keep, known, there_too, is_set_again)
    _leave_out(body, makes, keep, there_too, is_set_again)
    able = _able(body, keep, there_too)
    left_out = set()
    functions = {each.name: each for each in body if isinstance(each, ast.FunctionDef)}
    for number, name in ((n, name) for n, each in enumerate(body) if n not in keep for name in _called(each)):
        if name in elsewhere and elsewhere[name].names & known:
            left_out.add(name)
            given = _from_experiments(functions[name], there_too[number]) & elsewhere[name].names & known
            if given and not is_set_again(able, number, given):
                raise NotFollowed(body[number].lineno, _NEEDS_MORE)
    return keep, tuple(sorted(left_out))


class NotFollowed(Exception):
    """What is graded may be changed by a statement that cannot be run where it is graded: its line, and why."""

    def __init__(self, line: int, why: str):
        super().__init__(why)
        self.line, self.why = line, why


@dataclass(frozen=True)
class _Makers:
    wanted: set[str]
    facts: Sequence[tuple[set[str], set[str]]]  # by statement, what it makes and what it uses
    of: Mapping[str, list[int]]  # by name, the statements that make it

    def add(self, number: int, keep: set[int], known: set[str]) -> None:
        """Keep a statement, and those that make what it uses."""
        todo = [number]
        while todo:
            number = todo.pop()
            if number not in keep:
                keep.add(number)
                new = self.facts[number][1] - known
                known |= new
                todo += [each for name in new for each in self.of.get(name, ())]


def _follow(
    body: Sequence[ast.stmt],
    makes: _Makers,
    keep: set[int],
    known: set[str],
    absent: Sequence[Set[str]],
    is_set_again: Overwriting,
) -> None:
    """Keep also what may change the data in ways that its text does not name. NotFollowed where that cannot be run."""
    modules = dict(chain.from_iterable(map(imported, body)))
    functions = {each.name: each for each in body if isinstance(each, followed.FUNCTIONS)}
    for number, statement in enumerate(body):
        if said := followed.namespaces_in(statement, absent[number]):
            raise NotFollowed(statement.lineno, f"{said} reaches names that nobody can see there")
    blocked: set[int] = set()
    before = -1
    handed = makes.wanted | {
        each.value.id
        for each in body
        if isinstance(each, ast.Assign) and isinstance(each.value, ast.Name) and {*_set_by(each)} & makes.wanted
    }
    seen = followed.Known(set(), set(), modules, functions, set(), handed)
    seen = followed.with_methods(body, seen, absent[-1] if absent else set())
    while before != (before := len(keep) + len(seen.data) + len(seen.code) + len(seen.changes_arguments)):
        seen.data |= mutable(body, known, functions.keys()) - modules.keys() - functions.keys()
        for number, statement in enumerate(body):
            seen.absent = absent[number]
            if followed.effect(statement, seen) == followed.CHANGES:
                if number not in keep and _at_once_names(statement) & absent[number]:
                    blocked.add(number)
                elif number not in keep:
                    makes.add(number, keep, known)
    able = _able(body, keep, absent)
    for number in sorted(blocked):
        named = followed.names_in(body[number]) & seen.data & known
        if not is_set_again(able, number, named or makes.wanted & seen.data):
            raise NotFollowed(body[number].lineno, _NEEDS_MORE)


_NEEDS_MORE = "it may change what is graded, and needs files or modules that are not there"


def _leave_out(
    body: Sequence[ast.stmt], makes: _Makers, keep: set[int], absent: Sequence[Set[str]], is_set_again: Overwriting
) -> None:
    """Leave out what cannot be run, where what it makes is set again later, or used only by what is left out as well.

    NotFollowed where it is neither.
    """
    unable = sorted(keep - _able(body, keep, absent))
    keep.difference_update(unable)
    used = _used(body, makes, keep)
    modules = {name for statement in body for name, _ in imported(statement)}
    functions = {each.name: each for each in body if isinstance(each, ast.FunctionDef)}
    changeable = mutable(body, used | makes.wanted, functions.keys())
    for number in unable:
        made = (makes.facts[number][0] & (used | makes.wanted)) - modules
        made &= changeable | _rebound(body[number], functions)
        if not is_set_again(keep, number, made):
            raise NotFollowed(body[number].lineno, _NEEDS_MORE)
    for number in sorted(keep):  # modules that only these needed
        names = {name for name, _ in imported(body[number])}
        if any(not_there(body[number])) and names.isdisjoint(used | {"*"}):
            keep.discard(number)


def _able(body: Sequence[ast.stmt], keep: Set[int], absent: Sequence[Set[str]]) -> set[int]:
    """Those of `keep` that need nothing which is not there, or have a way out."""
    kinds = ast.Import | ast.ImportFrom | ast.ClassDef | ast.Try
    files = Files.of(body)
    return {
        number
        for number in keep
        if isinstance(body[number], kinds)
        or not (_at_once_names(body[number]) & absent[number] or _reads_file_at_once(body[number], files))
    }


def _rebound(statement: ast.stmt, functions: Mapping[str, ast.FunctionDef]) -> set[str]:
    """The names that a statement, or a function that it names, binds anew: a number cannot change in another way."""
    trees = at_once(statement)
    named = {each.id for tree in trees for each in ast.walk(tree) if isinstance(each, ast.Name)}
    found = {name for each in named & functions.keys() for name in _effect(functions[each]).names}
    if isinstance(statement, followed.FUNCTIONS):
        found.add(statement.name)
    patterns = (each for tree in trees for each in ast.walk(tree) if isinstance(each, ast.MatchAs | ast.MatchStar))
    return found.union({each.name for each in patterns if each.name}, *map(stored, trees))


def _reads_file_at_once(statement: ast.stmt, files: Files) -> bool:
    return not isinstance(statement, followed.FUNCTIONS) and files.read_by(statement)


def _used(body: Sequence[ast.stmt], makes: _Makers, keep: set[int]) -> set[str]:
    """The names that the statements in `keep` use; functions that none of them uses are taken out of it."""
    while True:
        used = set().union(*(makes.facts[number][1] for number in keep))
        idle = {
            number
            for number in keep
            if isinstance(each := body[number], ast.FunctionDef)
            and not each.decorator_list
            and each.name not in makes.wanted
            and not any(each.name in makes.facts[other][1] for other in keep - {number})
        }
        if not idle:
            return used
        keep -= idle


def _from_experiments(function: ast.FunctionDef, absent: Set[str]) -> set[str]:
    """The names that a function gives values to, or to whose parts, which come from modules that are not there."""
    found: set[str] = set()
    before = -1
    while before != (before := len(found)):
        for targets, value in map(bound, ast.walk(function)):
            if value is not None and followed.names_in(value) & (absent | found):
                found |= set(map(followed.root, targets)) | set().union(*map(followed.names_in, targets))
    return found


def _at_once_names(statement: ast.stmt) -> set[str]:
    """The names that it reads where it stands."""
    walked = chain.from_iterable(map(ast.walk, at_once(statement)))
    return {each.id for each in walked if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Load)}


def _set_by(statement: ast.stmt) -> Iterator[str]:
    """The names that a plain statement gives values to, or to whose parts."""
    if isinstance(statement, ast.Assign | ast.AugAssign | ast.AnnAssign):
        targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
        yield from map(root, targets)
    elif isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Call):
        yield followed.root(statement.value)


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
    absent = {name for statement in body for name in not_there(statement)}
    found = {name: effect for name, effect in found.items() if effect.is_there}
    elsewhere = {name: effect for name, effect in found.items() if effect.uses & absent}
    return {name: effect for name, effect in found.items() if name not in elsewhere}, elsewhere


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
    alike = _names_of_the_same(function.body, [set() for _ in function.body])
    for changed in _changed(function):
        for name in {changed} | alike.get(changed, set()):
            if name in arguments:
                effect.is_of_arguments = True
            elif name not in own:
                effect.names.add(name)
    effect.arguments = arguments
    calls = [node for node in ast.walk(function) if isinstance(node, ast.Call)]
    effect.handed = {root(each) for node in calls for each in node.args} - (bound - arguments) - {""}
    return effect


def _changed(tree: ast.AST) -> Iterator[str]:
    """The names that something in the tree changes without binding them."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute | ast.Subscript) and not isinstance(node.ctx, ast.Load):
            yield root(node)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in CHANGING:
            yield root(node.func)
            if node.args:
                yield root(node.args[0])  # dict.update(params, ...)
        elif isinstance(node, ast.Call) and node.args and last_word(node.func) in _BY_FIRST_ARGUMENT:
            yield root(node.args[0])
        elif isinstance(node, ast.AugAssign):
            yield root(node.target)  # params |= {...}


def _called(statement: ast.stmt) -> Iterator[str]:
    """The functions that a statement calls by their names."""
    for tree in at_once(statement):
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                yield node.func.id


def _names_of_the_same(body: Sequence[ast.stmt], absent: Sequence[Set[str]]) -> dict[str, set[str]]:
    """By name all names that may stand for the same object: by assignments, loops and `with`."""
    groups: dict[str, set[str]] = {}
    for statement, there in zip(body, absent, strict=True):
        for tree in at_once(statement):
            for node in ast.walk(tree):
                targets, value = bound(node)
                targets = [each for each in targets if followed.root(each) not in there]
                names = {each.id for target in targets for each in ast.walk(target) if isinstance(each, ast.Name)}
                own = _handed_on(value, there)
                if names and own:
                    whole = set().union(names, own, *(groups.get(name, ()) for name in names | own))
                    groups |= dict.fromkeys(whole, whole)
    return groups


def _handed_on(value: ast.AST | None, absent: Set[str]) -> set[str]:
    """The names whose objects an expression gives, alone or in a list; what a call gives may hold its arguments.

    What modules give that are not `there` holds runs and pictures, and nothing that is graded.
    """
    if isinstance(value, ast.Name):
        return {value.id}
    if isinstance(value, ast.Attribute | ast.Subscript):
        return {root(value)} - {""}
    if isinstance(
        value, ast.List | ast.Tuple | ast.Set | ast.Dict | ast.IfExp | ast.BoolOp | ast.Starred | ast.NamedExpr
    ):
        return set().union(*(_handed_on(each, absent) for each in ast.iter_child_nodes(value)))
    if isinstance(value, ast.Call) and root(value.func) not in absent:
        given = [*value.args, *(word.value for word in value.keywords)]
        return set().union(
            *(_handed_on(each, absent) for each in given if not isinstance(each, ast.Attribute | ast.Subscript))
        )
    return set()


def _made_and_used(
    statement: ast.stmt,
    effects: Mapping[str, _Effect],
    alike: Mapping[str, set[str]],
    wanted: set[str],
    absent: Set[str],
) -> tuple[set[str], set[str]]:
    """The names that a statement binds or changes, and those of the notebook that it needs, in functions too."""
    top = table_of(statement)
    made = {symbol.get_name() for symbol in top.get_symbols() if symbol.is_assigned() or symbol.is_imported()}
    used = {symbol.get_name() for symbol in top.get_symbols() if symbol.is_referenced()}
    used |= {root(node.target) for node in ast.walk(statement) if isinstance(node, ast.AugAssign)} - {""}
    tables = top.get_children()
    while tables:
        table = tables.pop()
        shared = [symbol for symbol in table.get_symbols() if symbol.is_global()]
        used |= {symbol.get_name() for symbol in shared}
        if not isinstance(statement, (*followed.FUNCTIONS, ast.ClassDef)):  # `[k := v for v in ...]`, or in an `if`
            made |= {symbol.get_name() for symbol in shared if symbol.is_assigned()}
        tables += table.get_children()
    changed: set[str] = set()
    for tree in at_once(statement):
        changed |= set(_changed(tree)) - absent
        tried = {id(each) for node in ast.walk(tree) for each in _tried(node, wanted, absent)}
        for node in ast.walk(tree):
            if id(node) in tried:
                continue
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and node.id in effects:
                changed |= effects[node.id].names  # called here, or by what it is handed to
            called = node.func.id if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) else ""
            if isinstance(node, ast.Call) and called in effects and effects[called].is_of_arguments:
                changed |= {root(each) for each in (*node.args, *(word.value for word in node.keywords))}
    given = statement.value if isinstance(statement, ast.Expr) else None
    if isinstance(given, ast.Call) and isinstance(given.func, ast.Attribute):
        changed.add(root(given.func))  # tuner.go()
    made |= changed.union(*(alike.get(name, ()) for name in changed))
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Call):
        made.add(root(statement.value.func))  # controller.tune(...), whatever that does
        if isinstance(statement.value.func, ast.Name):
            made.discard(statement.value.func.id)
    return made - {""}, used


def _tried(node: ast.AST, wanted: set[str], absent: Set[str]) -> Iterator[ast.AST]:
    """What is graded and handed to an experiment: that is called there, and never where it is graded."""
    if isinstance(node, ast.Call) and followed.root(node.func) in absent:
        given = [*node.args, *(word.value for word in node.keywords)]
        yield from (each for each in given if isinstance(each, ast.Name) and each.id in wanted)
