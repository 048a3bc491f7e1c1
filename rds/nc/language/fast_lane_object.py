"""The kernels of the fast lane as object files, compiled by numba once. Importing this needs numba, and is slow."""

from __future__ import annotations

import re
from typing import Any

from llvmlite import binding as llvm
from numba import carray, njit, types

from rds.nc.language.fast_lane_kernel import read_lines
from rds.nc.language.fast_lane_target import target_machine
from rds.nc.language.fast_lane_text import write_rows

_BYTES, _SMALL = types.CPointer(types.uint8), types.CPointer(types.int8)
_WHOLE, _COUNTS, _FLOATS = types.CPointer(types.int32), types.CPointer(types.int64), types.CPointer(types.float64)
_N = types.int64
# What the object may ask the process for, besides the compiler's own: the mathematics of C.
_FROM_OUTSIDE = re.compile(r"llvm\..*|a?(?:sin|cos|tan)|atan2|sqrt|floor|fabs|copysign|mem(?:set|cpy|move)")
_DECLARED = re.compile(r'^declare .*?@("?[\w.$-]+"?)\(', re.MULTILINE)
# Called for arrays that numba has allocated, and there are none.
_NO_DESTRUCTOR = re.compile(r"^declare (void @NRT_MemInfo_call_dtor\([^)]*\)).*$", re.MULTILINE)


def _read(data, size, at, line, state, modes, work, kinds, digits, ns, lines, values, room, answer):
    work_room = carray(work, (18,))
    found = read_lines(
        carray(data, (size,)),
        at,
        size,
        line,
        carray(state, (8,)),
        carray(modes, (5,)),
        work_room[:12],
        work_room[12:],
        carray(kinds, (room,)),
        carray(digits, (room,)),
        carray(ns, (room,)),
        carray(lines, (room,)),
        carray(values, (room, 9)),
    )
    answer[0], answer[1], answer[2] = found
    return 0


def _write(number, kinds, digits, ns, values, rows, out, size, answer):
    answer[0], answer[1] = write_rows(
        number,
        carray(kinds, (rows,)),
        carray(digits, (rows,)),
        carray(ns, (rows,)),
        carray(values, (rows, 9)),
        carray(out, (size,)),
    )
    return 0


_ENTRIES = {
    "rds_read_lines": (
        _read,
        (*(_BYTES, _N, _N, _N, _FLOATS, _COUNTS, _FLOATS), *(_SMALL, _SMALL, _WHOLE, _WHOLE, _FLOATS, _N, _COUNTS)),
    ),
    "rds_write_rows": (_write, (_N, _SMALL, _SMALL, _WHOLE, _FLOATS, _N, _BYTES, _N, _COUNTS)),
}


def compiled() -> dict[str, bytes] | None:
    """The object file of each entry; None where one would need more of numba than an object file can have."""
    machine = target_machine()
    found = {}
    for name, (function, arguments) in _ENTRIES.items():
        options: dict[str, Any] = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        plain: Any = njit(types.int64(*arguments), **options)
        overload = plain(function).overloads[arguments]
        text = _NO_DESTRUCTOR.sub(r"define \1 { ret void }", overload.library.get_llvm_str())
        if not all(_FROM_OUTSIDE.fullmatch(symbol.strip('"')) for symbol in _DECLARED.findall(text)):
            return None
        module = llvm.parse_assembly(text)
        module.get_function(overload.fndesc.llvm_func_name).name = name
        found[name] = machine.emit_object(module)
    return found
