"""Values as bytes for another process of the same user."""

from __future__ import annotations

import sys
import threading
from typing import Any

_LOCK = threading.RLock()  # what is pickled may be made of what is pickled


def portable(value: Any) -> bytes:
    """The value pickled: a student's functions travel by value, what can be imported there as well by its name."""
    import cloudpickle

    from rds.core.load import STUDENT_MODULE  # numpy comes with it, which not every worker needs

    with _LOCK:  # cloudpickle's list of modules is the process's, and not made for threads
        students = [module for name, module in list(sys.modules.items()) if name.startswith(STUDENT_MODULE)]
        for module in students:
            cloudpickle.register_pickle_by_value(module)
        try:
            data: bytes = cloudpickle.dumps(value)
            return data
        finally:
            for module in students:
                cloudpickle.unregister_pickle_by_value(module)
