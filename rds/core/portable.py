"""Values as bytes for another process of the same user."""

from __future__ import annotations

import io
import sys
import threading
from collections import ChainMap
from collections.abc import Callable
from functools import cache
from types import CodeType
from typing import Any

from rds.core.run_text import STUDENT_MODULE

_LOCK = threading.RLock()  # what is pickled may be made of what is pickled


def portable(value: Any) -> bytes:
    """The value pickled: a student's functions travel by value, what can be imported there as well by its name."""
    import cloudpickle

    with _LOCK:  # cloudpickle's list of modules is the process's, and not made for threads
        students = [module for name, module in list(sys.modules.items()) if name.startswith(STUDENT_MODULE)]
        for module in students:
            cloudpickle.register_pickle_by_value(module)
        try:
            data = io.BytesIO()
            _pickler()(data).dump(value)
            return data.getvalue()
        finally:
            for module in students:
                cloudpickle.unregister_pickle_by_value(module)


@cache
def _pickler() -> Any:
    """cloudpickle's, with the name of the file that code was written in: from 3.1.3 on it drops it, and no error of a
    student's code could say where it is.
    """
    import cloudpickle

    own = cloudpickle.CloudPickler.dispatch_table
    reduced = own[CodeType]

    def of(code: CodeType) -> tuple[Callable[..., CodeType], tuple[Any, ...]]:
        return _code, (*reduced(code), code.co_filename)

    return type("Pickler", (cloudpickle.CloudPickler,), {"dispatch_table": ChainMap({CodeType: of}, own)})


def _code(make: Callable[..., CodeType], arguments: tuple[Any, ...], file: str) -> CodeType:
    return make(*arguments).replace(co_filename=file)
