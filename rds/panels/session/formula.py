"""A formula of time that a user typed: read as a formula and never run as Python, and kept as a file of rows.

    3*sin(2*pi*0.5*t) + (t > 2)

Numbers, t (s), pi, e, + - * / % **, comparisons (1 where true, 0 elsewhere) and the functions of FUNCTIONS.
"""

from __future__ import annotations

import ast
import hashlib
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.core.private_files import make_folder

FOLDER = "signals"  # of the files made from formulas
LONGEST = 500  # characters
MOST_ROWS = 100_000
FUNCTIONS: Mapping[str, Callable[..., Any]] = MappingProxyType(
    {
        name: getattr(np, name)
        for name in ("sin", "cos", "tan", "exp", "log", "sqrt", "abs", "sign", "floor", "minimum", "maximum", "tanh")
    }
    | {"min": np.minimum, "max": np.maximum}
)
_TWO = ("minimum", "maximum", "min", "max")  # functions of two arguments
_NAMES = MappingProxyType({"pi": math.pi, "e": math.e})
_OPERATORS: Mapping[type, Callable[..., Any]] = MappingProxyType(
    {
        ast.Add: np.add,
        ast.Sub: np.subtract,
        ast.Mult: np.multiply,
        ast.Div: np.divide,
        ast.Mod: np.mod,
        ast.Pow: np.power,
        ast.USub: np.negative,
        ast.UAdd: np.positive,
        ast.Lt: np.less,
        ast.LtE: np.less_equal,
        ast.Gt: np.greater,
        ast.GtE: np.greater_equal,
    }
)


def formula_values(text: str, times: np.ndarray) -> np.ndarray:
    """The formula's value at each of `times` (s). InputError for what is no formula, or not finite somewhere."""
    tree = _read(text)
    with np.errstate(all="ignore"):
        try:
            values = np.broadcast_to(np.asarray(_value(tree, times), dtype=float), times.shape)
        except (OverflowError, RecursionError) as error:
            raise InputError(f"the formula cannot be worked out: {error}") from error
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise InputError(f"the formula is {values[bad[0]]:g} at t = {times[bad[0]]:g} s; it must be finite throughout")
    return values


def check_formula(text: str) -> None:
    """InputError with the reason if `text` is no formula."""
    formula_values(text, np.array([0.0, 0.1, 1.0]))


def formula_file(folder: Path, text: str, duration: float, T: float) -> str:
    """Write the formula's values at every sample as a file of rows for a signal; its name from `folder` on.

    One more row than samples, so that the last sample lies between rows. The same formula has the same file.
    InputError for too many samples, or a folder that cannot be written to.
    """
    count = math.ceil(duration / T) + 2
    if count > MOST_ROWS:
        raise InputError(
            f"a formula can have {MOST_ROWS} samples, not {count}; shorten the final time, lengthen the sample "
            f"period, or give a CSV file"
        )
    times = np.arange(count) * T
    rows = zip(times.tolist(), formula_values(text, times).tolist(), strict=True)
    lines = "".join(f"{time!r},{value!r}\n" for time, value in rows)
    content = f"# {' '.join(text.split())}\ntime,value\n{lines}".encode()
    name = f"{FOLDER}/formula-{hashlib.sha256(content).hexdigest()[:12]}.csv"
    path = folder / name
    if not path.is_file() or path.read_bytes() != content:
        try:
            make_folder(path.parent)
        except OSError as error:
            raise InputError(f"cannot be made: {error.strerror}", str(path.parent)) from error
        write_whole(path, content)
    return name


def _read(text: str) -> ast.expr:
    if len(text) > LONGEST:
        raise InputError(f"the formula has {len(text)} characters; {LONGEST} are allowed; give a CSV file instead")
    try:
        return ast.parse(text.strip(), mode="eval").body
    except SyntaxError as error:
        place = f"at character {error.offset}" if error.offset else "at its end"
        raise InputError(f"not a formula of t: {error.msg} {place}; write it as in 3*sin(2*pi*t) + 1") from error
    except (ValueError, RecursionError, MemoryError) as error:
        raise InputError(f"not a formula of t: {error}") from error


def _value(node: ast.AST, t: np.ndarray) -> Any:
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        return float(node.value)  # type: ignore[arg-type]
    if isinstance(node, ast.Name):
        return t if node.id == "t" else _known(node.id, _NAMES)
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return _OPERATORS[type(node.op)](_value(node.left, t), _value(node.right, t))
    if isinstance(node, ast.UnaryOp) and type(node.op) in _OPERATORS:
        return _OPERATORS[type(node.op)](_value(node.operand, t))
    if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in _OPERATORS:
        compared = _OPERATORS[type(node.ops[0])](_value(node.left, t), _value(node.comparators[0], t))
        return np.asarray(compared, dtype=float)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        function, wanted = _known(node.func.id, FUNCTIONS), 2 if node.func.id in _TWO else 1
        if len(node.args) != wanted:
            raise InputError(f"{node.func.id}() takes {wanted} value{'s' if wanted > 1 else ''}, not {len(node.args)}")
        return function(*(_value(each, t) for each in node.args))
    raise InputError(f"`{ast.unparse(node)[:60]}` cannot stand in a formula of t; as in 3*sin(2*pi*0.5*t)")


def _known(name: str, names: Mapping[str, Any]) -> Any:
    if name not in names:
        raise InputError(f"the formula knows no {name!r}; it knows t, {', '.join((*_NAMES, *FUNCTIONS))}")
    return names[name]
