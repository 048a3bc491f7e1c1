"""Which statements of a notebook may change what is graded, by ways that their text does not name.

`params["Kp"] = 2.0` names what it changes. `put = params.update`, then `put(Kp=2.0)`, does not, nor do
`Tuner(params).go()` or `list(map(put, [2.0]))`. Nothing is run: an expression is given a rank by what it could hand
on. Where that cannot be told, it is assumed to change things, and is graded with the rest.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from itertools import chain

NOTHING, READS, GIVES, CHANGES = range(4)
"""What a statement or an expression does to data that are graded: nothing; it reads them; its value is, or holds, such
an object; it changes them, or its value does when it is called."""

_SCALAR = frozenset(
    {"print", "display", "len", "float", "int", "str", "repr", "round", "abs", "isinstance", "sum", "bool", "format"}
    | {"hash", "id", "any", "all", "range", "callable", "hasattr", "divmod", "pow", "complex", "type"}
)
_COPIES = frozenset({"dict", "list", "tuple", "set", "frozenset", "sorted", "copy", "deepcopy", "array", "asarray"})
_GIVING = frozenset({"zip", "enumerate", "reversed", "filter", "map", "min", "max", "iter"})
_READING = frozenset(
    {"get", "keys", "values", "items", "copy", "index", "count", "format", "join", "split", "strip"}
    | {"tolist", "mean", "sum", "min", "max", "std", "any", "all", "astype", "flatten", "round", "ravel", "reshape"}
    | {"dot", "transpose", "item", "conj", "cumsum"}
)
_METHODS = frozenset([*dir(dict), *dir(list), *dir(set), "fill", "put", "appendleft", "popleft", "rotate"])
"""Of tables, lists and arrays: `put = params.update` hands on what changes the data; other attributes are data."""

_PURE = frozenset({"numpy", "math", "cmath", "json", "statistics", "copy", "scipy", "control", "pprint", "itertools"})
_CHANGING_OF_PURE = frozenset({"fill", "copyto", "put", "place", "putmask", "shuffle", "fill_diagonal"})
_NAMESPACES = frozenset({"exec", "eval", "globals", "locals"})
_EXPRESSIONS = (ast.BinOp, ast.UnaryOp, ast.Compare, ast.JoinedStr, ast.FormattedValue)
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
_COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.GeneratorExp, ast.DictComp)


@dataclass
class Known:
    """What is known of a notebook's names: `data` that are graded, `code` that may change them, modules by name."""

    data: set[str]
    code: set[str]
    modules: Mapping[str, str]
    functions: Mapping[str, ast.FunctionDef | ast.AsyncFunctionDef]
    absent: Set[str]  # modules that are not there, and what comes from them
    graded: set[str]  # functions that are graded: an experiment that is handed one does not change it
    changes_arguments: set[str] = field(default_factory=set)

    def within(self, hidden: Iterable[str], data: Iterable[str] = ()) -> Known:
        """The same inside a function, whose own names are `hidden`; of these, `data` are graded data."""
        own = set(hidden)
        return Known(
            (self.data - own) | set(data),
            self.code - own,
            self.modules,
            self.functions,
            self.absent - own,
            self.graded - own,
            self.changes_arguments,
        )


def root(node: ast.AST) -> str:
    """The name that an expression such as `a`, `a.b`, `a.b[c]` or `a.b()` begins with; "" if it begins otherwise."""
    while isinstance(node, ast.Attribute | ast.Subscript | ast.Call):
        node = node.func if isinstance(node, ast.Call) else node.value
    return node.id if isinstance(node, ast.Name) else ""


def names_in(node: ast.AST) -> set[str]:
    """All names in a tree, with those that patterns bind."""
    found = {each.id for each in ast.walk(node) if isinstance(each, ast.Name)}
    return found | {
        name
        for each in ast.walk(node)
        if isinstance(name := getattr(each, "name", None), str) and isinstance(each, ast.MatchAs | ast.MatchStar)
    }


def namespaces_in(statement: ast.stmt, absent: Set[str]) -> str:
    """The function by which a statement reaches names that its text does not say; "" if it has none.

    An experiment of a module that is `absent` there may be handed them, as in `Experiment(controller=globals())`.
    """
    tested = {id(each) for node in ast.walk(statement) if isinstance(node, ast.Compare) for each in node.comparators}
    handed = {
        id(each)
        for node in ast.walk(statement)
        if isinstance(node, ast.Call) and root(node.func) in absent
        for each in (*node.args, *(word.value for word in node.keywords))
        if isinstance(each, ast.Call) and not each.args
    }
    for node in ast.walk(statement):
        if id(node) in handed:
            continue
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _NAMESPACES:
            return f"{node.func.id}()"
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "vars" and not node.args:
            return "vars()"
        if isinstance(node, ast.Attribute) and node.attr in ("run_cell", "modules") and root(node):
            if id(node) in tested:
                continue  # `if "google.colab" in sys.modules` reaches nothing
            return f"{root(node)}.{node.attr}"
        if isinstance(node, ast.Import) and any(alias.name in ("__main__", "builtins") for alias in node.names):
            return f"import {node.names[0].name}"
    return ""


def rank(node: ast.AST | None, known: Known) -> int:
    """What an expression does to the data that are graded."""
    if isinstance(node, ast.Name):
        if node.id in known.absent and node.id not in known.functions:
            return NOTHING
        return CHANGES if node.id in known.code else GIVES if node.id in known.data else NOTHING
    if isinstance(node, ast.Call):
        return _of_call(node, known)
    if isinstance(node, ast.Attribute | ast.Subscript):
        base = _of_base(node.value, known)
        if isinstance(node, ast.Subscript) and rank(node.slice, known) == CHANGES:
            return CHANGES
        if base == GIVES and not isinstance(node.ctx, ast.Load):
            return CHANGES
        is_method = isinstance(node, ast.Attribute) and node.attr not in _READING and node.attr in _METHODS
        return CHANGES if base == GIVES and is_method else base
    if isinstance(node, ast.Lambda):
        inner = rank(node.body, known.within(each.arg for each in ast.walk(node.args) if isinstance(each, ast.arg)))
        return CHANGES if inner >= GIVES else inner
    if isinstance(node, _COMPREHENSIONS):
        given: set[str] = set()
        found = NOTHING
        for part in node.generators:
            over = rank(part.iter, known.within((), given))
            if over == GIVES:
                given |= names_in(part.target)
            found = max([found, over if over == CHANGES else READS, *(rank(each, known) for each in part.ifs)])
        inside = known.within((), given)
        parts = [node.key, node.value] if isinstance(node, ast.DictComp) else [node.elt]
        return max([min(found, CHANGES), *(rank(each, inside) for each in parts)])
    if isinstance(node, ast.Dict):
        whole = [rank(v, known) if k is not None or not isinstance(v, ast.Name) else READS for k, v in _items(node)]
        return max([*whole, *(rank(key, known) for key in node.keys)], default=NOTHING)
    if node is None or isinstance(node, ast.Constant):
        return NOTHING
    ranks = [rank(child, known) for child in ast.iter_child_nodes(node)]
    found = max(ranks, default=NOTHING)
    return min(found, READS) if isinstance(node, _EXPRESSIONS) and found < CHANGES else found


def _of_base(node: ast.expr, known: Known) -> int:
    """The same of what has an attribute or an item: made where it stands, as `Tuner(params)`, it may hold the data."""
    found = rank(node, known)
    if found == READS and isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        given = [node.func, *node.args, *(word.value for word in node.keywords)]
        if rank(node.func, known) == GIVES and any(rank(each, known) == GIVES for each in given[1:]):
            return GIVES
    return found


def _items(node: ast.Dict) -> Iterator[tuple[ast.expr | None, ast.expr]]:
    return zip(node.keys, node.values, strict=True)


def _of_call(node: ast.Call, known: Known) -> int:
    given = [*node.args, *(word.value for word in node.keywords)]
    ranks = [rank(each, known) for each in given]
    most = max(ranks, default=NOTHING)
    if root(node.func) in known.absent:
        handed = [each for each in given if not (isinstance(each, ast.Name) and each.id in known.graded)]
        return CHANGES if any(rank(each, known) == CHANGES for each in handed) else NOTHING
    if most == CHANGES:
        return CHANGES
    if root(node.func) in known.modules and any(root(each) in known.absent for each in given):
        return NOTHING  # partial(run, params=params) of another module's run
    name = node.func.id if isinstance(node.func, ast.Name) else ""
    base = _of_base(node.func.value, known) if isinstance(node.func, ast.Attribute) else rank(node.func, known)
    if base == CHANGES:
        return CHANGES
    last = node.func.attr if isinstance(node.func, ast.Attribute) else name
    if base == GIVES and isinstance(node.func, ast.Attribute):
        return CHANGES if last not in _READING else READS if last == "copy" else GIVES
    if base >= READS or most < GIVES:
        return READS if most else base
    if name in known.functions:
        return CHANGES if name in known.changes_arguments else GIVES
    module = known.modules.get(root(node.func), "")
    if last in _COPIES and all(isinstance(each, ast.Name) for each in given):
        return READS
    if module in _PURE and last not in _CHANGING_OF_PURE and all(word.arg != "out" for word in node.keywords):
        return GIVES
    if not module and name in _SCALAR:
        return READS
    return GIVES if not module and name in _GIVING | _COPIES else CHANGES


def effect(statement: ast.AST, known: Known) -> int:
    """What a statement does where it stands; `known` learns the names that it binds."""
    if isinstance(statement, FUNCTIONS):
        is_code = of_function(statement, known)
        if is_code:
            known.code.add(statement.name)
        decorated = max((rank(each, known) for each in statement.decorator_list), default=NOTHING)
        return CHANGES if decorated == CHANGES or (is_code and statement.decorator_list) else NOTHING
    if isinstance(statement, ast.ClassDef):
        return _of_class(statement, known)
    found = NOTHING
    for targets, value in _bindings(statement):
        got = rank(value, known)
        found = max(found, got)
        for target in targets:
            found = max(found, _bind(target, got, known))
    for name, value in _put_into(statement):
        if name and name not in known.absent and name not in known.modules:
            _hold(name, value, known)
    if isinstance(statement, ast.Delete):
        if any(rank(each, known) >= GIVES for each in statement.targets):
            found = CHANGES
    elif isinstance(statement, ast.Global | ast.Nonlocal):
        found = CHANGES if known.data & set(statement.names) else found
    elif isinstance(statement, ast.AugAssign) and rank(statement.target, known) >= GIVES:
        found = CHANGES
    for child in ast.iter_child_nodes(statement):
        if isinstance(child, ast.stmt | ast.ExceptHandler | ast.match_case):
            found = max(found, effect(child, known))
        elif isinstance(child, ast.withitem):
            found = max(found, rank(child.context_expr, known))
        elif isinstance(child, ast.expr) and isinstance(getattr(child, "ctx", ast.Load()), ast.Load):
            found = max(found, rank(child, known))
    return found


def _bindings(statement: ast.AST) -> Iterator[tuple[Sequence[ast.AST], ast.AST | None]]:
    if isinstance(statement, ast.Assign):
        yield statement.targets, statement.value
    elif isinstance(statement, ast.AnnAssign):
        yield [statement.target], statement.value
    elif isinstance(statement, ast.For | ast.AsyncFor):
        yield [statement.target], statement.iter
    elif isinstance(statement, ast.With | ast.AsyncWith):
        for item in statement.items:
            if item.optional_vars is not None:
                yield [item.optional_vars], item.context_expr
    elif isinstance(statement, ast.Match):
        yield [case.pattern for case in statement.cases], statement.subject
    for node in _own(statement):
        if isinstance(node, ast.NamedExpr):
            yield [node.target], node.value


def _own(statement: ast.AST) -> Iterator[ast.AST]:
    """What a statement is made of, without the statements in it."""
    own = [child for child in ast.iter_child_nodes(statement) if not isinstance(child, ast.stmt)]
    return chain.from_iterable(map(ast.walk, own))


def _put_into(statement: ast.AST) -> Iterator[tuple[str, ast.expr]]:
    """What becomes part of what a name stands for: `steps.append(tune)`, `steps["tune"] = tune`, `steps += [tune]`."""
    if isinstance(statement, ast.Assign):
        yield from ((root(t), statement.value) for t in statement.targets if not isinstance(t, ast.Name))
    elif isinstance(statement, ast.AugAssign):
        yield root(statement.target), statement.value
    for node in _own(statement):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            yield from ((root(node.func), each) for each in (*node.args, *(word.value for word in node.keywords)))


def _hold(name: str, value: ast.expr, known: Known) -> None:
    """`known` learns that `name` holds functions that change the data, or the data: no results of such functions."""
    for each in value.elts if isinstance(value, ast.List | ast.Tuple | ast.Set) else [value]:
        is_function = isinstance(each, ast.Lambda) or (isinstance(each, ast.Name) and each.id in known.functions)
        if is_function and rank(each, known) == CHANGES:
            known.code.add(name)
        elif isinstance(each, ast.Name) and each is not value and rank(each, known) == GIVES:
            known.data.add(name)


def _bind(target: ast.AST, got: int, known: Known) -> int:
    """A target is given a value of this rank."""
    if isinstance(target, ast.Attribute | ast.Subscript):
        if rank(target.value, known) >= GIVES:
            return CHANGES
        if got >= GIVES and (name := root(target)) and name not in known.absent:
            (known.code if got == CHANGES else known.data).add(name)
        return NOTHING
    if isinstance(target, ast.Tuple | ast.List | ast.Starred):
        return max((_bind(each, got, known) for each in ast.iter_child_nodes(target)), default=NOTHING)
    if got >= GIVES:
        names = names_in(target) - known.absent
        (known.code if got == CHANGES else known.data).update(names)
    return NOTHING


def of_function(function: ast.FunctionDef | ast.AsyncFunctionDef, known: Known) -> bool:
    """Whether calls of a function may change the data, or hand them out; and whether it changes its arguments."""
    arguments = {each.arg for each in ast.walk(function.args) if isinstance(each, ast.arg)}
    said = {name for each in ast.walk(function) if isinstance(each, ast.Global) for name in each.names}
    bound = {each.id for each in ast.walk(function) if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Store)}
    own = (arguments | bound) - said
    values = (*function.args.defaults, *(each for each in function.args.kw_defaults if each is not None))
    defaults = [rank(each, known) for each in values]
    inside = known.within(own, arguments if GIVES in defaults else ())
    if _of_body(function, inside):
        return True
    if function.name not in known.changes_arguments:
        handed = known.within(own | known.data, arguments - {"self", "cls"})
        handed.code = set()
        if _of_body(function, handed, also_handing_out=False):
            known.changes_arguments.add(function.name)
    return False


def _of_body(function: ast.FunctionDef | ast.AsyncFunctionDef, inside: Known, also_handing_out: bool = True) -> bool:
    before = -1
    while before != (before := len(inside.data) + len(inside.code)):  # a loop's end comes before its beginning
        if any(effect(each, inside) == CHANGES for each in function.body):
            return True
    if not also_handing_out:
        return False
    handed = [each.value for each in ast.walk(function) if isinstance(each, ast.Return | ast.Yield | ast.YieldFrom)]
    inner = any(each.name in inside.code for each in ast.walk(function) if isinstance(each, FUNCTIONS))
    return inner or any(rank(each, inside) >= GIVES for each in handed)


def _of_class(statement: ast.ClassDef, known: Known) -> int:
    at_once = max((rank(each, known) for each in (*statement.bases, *statement.decorator_list)), default=NOTHING)
    inside = known.within(())
    for each in statement.body:
        if isinstance(each, FUNCTIONS):
            if of_function(each, inside):
                known.code.add(statement.name)
        else:
            at_once = max(at_once, effect(each, inside))
    if at_once == CHANGES:
        known.code.add(statement.name)
    return at_once
