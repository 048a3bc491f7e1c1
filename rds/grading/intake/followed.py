"""Which statements of a notebook may change what is graded, by ways that their text does not name.

`params["Kp"] = 2.0` names what it changes. `put = params.update`, then `put(Kp=2.0)`, does not, nor do
`Tuner(params).go()` or `list(map(put, [2.0]))`. Nothing is run: an expression is given a rank by what it could hand
on. Where that cannot be told, it is assumed to change things, and is graded with the rest.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from itertools import chain

NOTHING, READS, GIVES, CHANGES = range(4)
"""What a statement or an expression does to data that are graded: nothing; it reads them; its value is, or holds, such
an object; it changes them, or its value does when it is called."""

_SCALAR = frozenset(
    {"print", "display", "len", "float", "int", "str", "repr", "round", "abs", "isinstance", "sum", "bool", "format"}
    | {"hash", "id", "any", "all", "range", "callable", "hasattr", "divmod", "pow", "complex"}
)
_COPIES = frozenset({"dict", "list", "tuple", "set", "frozenset", "sorted", "copy", "deepcopy", "array"})
_GIVING = frozenset({"zip", "enumerate", "reversed", "filter", "map", "min", "max", "iter", "type"})
_READING = frozenset(
    {"get", "keys", "values", "items", "copy", "index", "count", "format", "join", "split", "strip"}
    | {"tolist", "mean", "sum", "min", "max", "std", "any", "all", "astype", "flatten", "round", "ravel", "reshape"}
    | {"dot", "transpose", "item", "conj", "cumsum", "prod", "cumprod", "var", "argmax", "argmin", "argsort", "nonzero"}
    | {"clip", "squeeze", "diagonal", "trace", "ptp", "take", "repeat", "swapaxes", "searchsorted"}
)
_METHODS = frozenset([*dir(dict), *dir(list), *dir(set), "fill", "put", "appendleft", "popleft", "rotate"])
"""Of tables, lists and arrays: `put = params.update` hands on what changes the data; other attributes are data."""

_PURE = frozenset({"numpy", "math", "cmath", "json", "statistics", "copy", "scipy", "control", "pprint", "itertools"})
_CHANGING_OF_PURE = frozenset(
    {"fill", "copyto", "put", "put_along_axis", "place", "putmask", "shuffle", "fill_diagonal", "at"}
)
_ONE = ("sqrt", "square", "negative", "absolute", "abs", "fabs", "sign", "exp", "log", "sin", "cos", "floor", "ceil")
_TWO = ("add", "subtract", "multiply", "divide", "true_divide", "power", "maximum", "minimum", "mod", "dot", "matmul")
_TAKES = {**dict.fromkeys(_ONE, 1), **dict.fromkeys(_TWO, 2), "round": 2, "clip": 3, "cumsum": 3, "cumprod": 3}
"""Arguments of numpy's functions that put the result into what is given after them."""
_NAMESPACES = frozenset({"exec", "eval", "globals", "locals"})
_BY_NAME = frozenset({"__init__", "__post_init__", "__new__", "__call__", "__setitem__", "__delitem__", "__setattr__"})
"""Methods of Python's own that are not called by operators, loops and `with`."""
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
    # of the notebook: by class the names in it, or None where its objects share what can be changed
    classes: Mapping[str, Set[str] | None] = field(default_factory=dict)
    methods: Set[str] = frozenset()  # of these classes, those that may change what they are called on
    reading: Mapping[str, bool] = field(default_factory=dict)  # the others: whether they spare their arguments, too

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
            self.classes,
            self.methods,
            self.reading,
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
        if isinstance(node, ast.Attribute) and node.attr in ("f_globals", "f_locals", "__globals__"):
            return f".{node.attr}"
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
        is_method |= isinstance(node, ast.Attribute) and node.attr in known.methods
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
    if isinstance(node, _EXPRESSIONS):
        found = _used(found, known)
        return READS if found == GIVES else found
    return found


def _used(found: int, known: Known) -> int:
    """The rank of what an operator, a loop or `with` uses, by methods that the text does not name."""
    return CHANGES if found == GIVES and any(m[:2] == "__" for m in known.methods - _BY_NAME) else found


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
        handed = [each for each in given if not _is_tried(each, known)]
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
    if any(word.arg == "out" and rank(word.value, known) == GIVES for word in node.keywords):
        return CHANGES
    if most == GIVES and any(_may_change(each, known) for each in given):
        return CHANGES
    if base == GIVES and last in known.reading and (most < GIVES or known.reading[last]):
        return GIVES
    if base == GIVES and isinstance(node.func, ast.Attribute):
        if last not in _READING or (last != "get" and GIVES in ranks[1 : len(node.args)]):  # as clip(0, 1, result)
            return CHANGES
        return READS if last == "copy" else GIVES
    if base == GIVES and "__call__" in known.methods and name not in known.classes:
        return CHANGES
    within = known.classes.get(name)
    if base == GIVES and most < GIVES and within is not None and not (within - {name}) & known.data:
        return READS  # a new object
    if base >= READS or most < GIVES:
        return READS if most else base
    if name in known.functions:
        return CHANGES if name in known.changes_arguments else GIVES
    module = known.modules.get(root(node.func), "")
    if (name or module) and last in _COPIES and all(isinstance(each, ast.Name) for each in given):
        return READS
    if module in _PURE and last not in _CHANGING_OF_PURE:
        return CHANGES if len(node.args) > _TAKES.get(last, len(node.args)) else GIVES
    if not module and name in _SCALAR:
        return READS
    return GIVES if not module and name in _GIVING | _COPIES else CHANGES


def _may_change(node: ast.expr, known: Known) -> bool:
    """Whether it is a method of the notebook that may change its arguments, handed to what calls it."""
    return isinstance(node, ast.Attribute) and (node.attr in known.methods or known.reading.get(node.attr) is False)


def _is_tried(node: ast.expr, known: Known) -> bool:
    """Whether it is what is graded, or a method, which an experiment calls and does not change."""
    if isinstance(node, ast.Attribute):
        return node.attr in known.methods and isinstance(node.value, ast.Name)
    return isinstance(node, ast.Name) and node.id in known.graded


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
        if isinstance(statement, ast.For | ast.AsyncFor) and value is statement.iter:
            got = _used(got, known)
        found = max(found, got)
        if got == CHANGES:  # what a method gives that changes its object does not change it once more
            reading = {**known.reading, **dict.fromkeys(known.methods, True)}
            got = rank(value, replace(known, reading=reading, changes_arguments=set()))
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
            found = max(found, _used(rank(child.context_expr, known), known))
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


def with_methods(body: Sequence[ast.stmt], known: Known, absent: Set[str]) -> Known:
    """`known` with the classes of the notebook, and which of their methods may change what they are called on.

    What is `absent` there, as an experiment, spares what it is handed.
    """
    classes = [each for each in body if isinstance(each, ast.ClassDef)]
    for each in classes:
        is_own = not (each.bases or each.keywords) and all(map(_is_own, each.body)) and not _reaches_class(each)
        known.classes = {**known.classes, each.name: names_in(each) if is_own else None}
    inner = chain.from_iterable(each.body for each in classes)
    methods = [each for each in inner if isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef) and each.args.args]
    stored = {
        node.attr
        for node in chain.from_iterable(map(ast.walk, body))
        if isinstance(node, ast.Attribute) and not isinstance(node.ctx, ast.Load)
    }
    changing: set[str] = set()
    before = -1
    while before != (before := len(changing)):
        known.methods = frozenset(changing)
        reading: dict[str, bool] = {}
        for method in methods:
            own = {node.arg for node in ast.walk(method.args) if isinstance(node, ast.arg)}
            if _of_body(method, known.within(own, [method.args.args[0].arg]), also_handing_out=False):
                changing.add(method.name)
            elif method.name not in stored | _METHODS:
                inside = known.within(own, own)
                inside.absent = absent - own
                spares = not _of_body(method, inside, also_handing_out=False)
                reading[method.name] = spares and reading.get(method.name, True)
        known.reading = {name: spares for name, spares in reading.items() if name not in changing}
    return known


def _reaches_class(statement: ast.ClassDef) -> bool:
    """Whether an object may change what it shares with all others: its class."""
    attributes = {each.attr for each in ast.walk(statement) if isinstance(each, ast.Attribute)}
    return bool(names_in(statement) & {"type", "classmethod", "__class__"} or "__class__" in attributes)


def _is_own(statement: ast.stmt) -> bool:
    """Whether a statement in a class gives its objects nothing that they share, and can change."""
    if isinstance(statement, FUNCTIONS):
        return all(
            isinstance(each, ast.Constant) for each in (*statement.args.defaults, *statement.args.kw_defaults) if each
        )
    is_plain = isinstance(statement, ast.Expr | ast.Assign | ast.AnnAssign) and isinstance(
        statement.value, ast.Constant | None
    )
    return is_plain or isinstance(statement, ast.Pass)


def _of_class(statement: ast.ClassDef, known: Known) -> int:
    at_once = max((rank(each, known) for each in (*statement.bases, *statement.decorator_list)), default=NOTHING)
    inside = known.within(())
    for each in statement.body:
        if isinstance(each, FUNCTIONS):
            if of_function(each, inside):
                known.code.add(statement.name)
        else:
            at_once = max(at_once, effect(each, inside))
    if inside.data - known.data:
        known.data.add(statement.name)
    if at_once == CHANGES:
        known.code.add(statement.name)
    return at_once
