"""The kernels of the fast lane as files, compiled by numba once. Importing this needs numba, and is slow."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

from llvmlite import binding as llvm
from numba import carray, njit, types

from rds.core.private_files import make_folder, open_private, write_private
from rds.nc.language.batch import FLOATS, FOUND, MODES, WORDS
from rds.nc.language.extended_angles import NAMES
from rds.nc.language.fast_lane_files import FOLDER, digest, family, file_of
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


def _read(data, size, at, line, state, modes, work, found, kinds, digits, ns, lines, values, room, answer):
    work_room = carray(work, (WORDS + 6,))
    done = read_lines(
        carray(data, (size,)),
        at,
        size,
        line,
        carray(state, (FLOATS,)),
        carray(modes, (MODES,)),
        work_room[:WORDS],
        work_room[WORDS:],
        carray(found, (FOUND,)),
        carray(kinds, (room,)),
        carray(digits, (room,)),
        carray(ns, (room,)),
        carray(lines, (room,)),
        carray(values, (room, 9)),
    )
    answer[0], answer[1], answer[2], answer[3] = done
    return 0


def _write(number, kinds, digits, ns, values, rows, text, text_size, out, size, answer):
    answer[0], answer[1] = write_rows(
        number,
        carray(kinds, (rows,)),
        carray(digits, (rows,)),
        carray(ns, (rows,)),
        carray(values, (rows, 9)),
        carray(text, (text_size,)),
        carray(out, (size,)),
    )
    return 0


_ENTRIES = {
    "rds_read_lines": (
        _read,
        (
            *(_BYTES, _N, _N, _N, _FLOATS, _COUNTS, _FLOATS, _COUNTS),
            *(_SMALL, _SMALL, _WHOLE, _WHOLE, _FLOATS, _N, _COUNTS),
        ),
    ),
    "rds_write_rows": (_write, (_N, _SMALL, _SMALL, _WHOLE, _FLOATS, _N, _BYTES, _N, _BYTES, _N, _COUNTS)),
}


# Angles in extended precision (extended_angles.py), which numba does not know: by the C library's functions.
_PI, _HALF_TURN = "0xK4000C90FDAA22168C235", "0xK4006B400000000000000"  # and 180
_CIRCULAR = f"""
declare x86_fp80 @NAMEl(x86_fp80)
define double @rds_NAME(double %degrees) {{
  %wide = fpext double %degrees to x86_fp80
  %times = fmul x86_fp80 %wide, {_PI}
  %radians = fdiv x86_fp80 %times, {_HALF_TURN}
  %found = call x86_fp80 @NAMEl(x86_fp80 %radians)
  %narrow = fptrunc x86_fp80 %found to double
  ret double %narrow
}}
"""
_DEGREES = f"""
define double @rds_degrees(double %share) {{
  %wide = fpext double %share to x86_fp80
  %found = fdiv x86_fp80 %wide, {_PI}
  %narrow = fptrunc x86_fp80 %found to double
  ret double %narrow
}}
"""


def _angles() -> dict[str, str]:
    """LLVM's text of the functions of angles; nothing for a processor without numbers of 80 bits."""
    if os.uname().machine != "x86_64":
        return {}
    return {"rds_angles": "".join(_CIRCULAR.replace("NAME", name) for name in NAMES[:3]) + _DEGREES}


def compiled() -> dict[str, str] | None:
    """LLVM's text of each entry; None where one would need more of numba than a file of its own can have."""
    found = {}
    for name, (function, arguments) in _ENTRIES.items():
        options: dict[str, Any] = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        plain: Any = njit(types.int64(*arguments), **options)
        overload = plain(function).overloads[arguments]
        text = _NO_DESTRUCTOR.sub(r"define internal \1 { ret void }", overload.library.get_llvm_str())
        if not all(_FROM_OUTSIDE.fullmatch(symbol.strip('"')) for symbol in _DECLARED.findall(text)):
            return None
        module = llvm.parse_assembly(text)
        module.get_function(overload.fndesc.llvm_func_name).name = name
        found[name] = str(module)
    return found


def objects(texts: dict[str, str], shared: bool) -> dict[str, bytes]:
    """An object file of each entry, for a shared library or to be loaded as it is."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = target_machine(shared)
    return {name: machine.emit_object(llvm.parse_assembly(text)) for name, text in texts.items()}


def keep(texts: dict[str, str]) -> None:
    """A shared library, where there is a linker, else the object files; each whole or not at all, if it can be kept.

    What this Python made from earlier sources is removed.
    """
    linker = shutil.which("ld")
    library = _linked(linker, objects(texts | _angles(), shared=True)) if linker else None
    files = {"so": library} if library else {f"{name}.o": code for name, code in objects(texts, shared=False).items()}
    with suppress(OSError):
        make_folder(FOLDER)
        for old in Path(FOLDER).glob(f"{family()}.*"):
            old.unlink(missing_ok=True)
        for what, content in files.items():
            new = Path(FOLDER) / f"{what}.{os.getpid()}"
            with open_private(new, "wb", is_own=True) as stream:
                stream.write(content + digest(content))
            new.replace(file_of(what))


def _linked(linker: str, files: dict[str, bytes]) -> bytes | None:
    """The shared library of object files; None where the linker fails, whatever the reason."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        for name, content in files.items():
            write_private(place / f"{name}.o", content, is_own=True)
        words = [linker, "-shared", "-z", "noexecstack", "-o", "kernels.so", *(f"{name}.o" for name in files)]
        with suppress(OSError, subprocess.SubprocessError):
            subprocess.run(words, cwd=place, capture_output=True, check=True, timeout=60)
            return (place / "kernels.so").read_bytes()
    return None
