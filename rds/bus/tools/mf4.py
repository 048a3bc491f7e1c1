"""asammdf, the package behind logs in MF4: imported when such a log is opened, and closed without noise.

`import can` imports asammdf where it is installed, and pandas with it: more than a second in each process on a bus, for
a kind of log that few of them touch. Our own programs (the command `rds`, the target, the servers of modules, the loop
that jogs, the kernels of `rds app`) call `put_off_asammdf()` as the first thing they do. In any other interpreter,
which is the user's, `import rds...` changes nothing: python-can imports asammdf there as it does without rds.
"""

from __future__ import annotations

import contextlib
import importlib
import sys
from collections.abc import Sequence
from pathlib import Path
from traceback import walk_tb
from types import ModuleType
from typing import Any

from rds.core.errors import InputError
from rds.core.extras import missing

_WHAT, _WHILE = "asammdf", "can"


class _NotYet:
    """Python's import system does not find asammdf while python-can is being imported.

    No importlib.abc.MetaPathFinder, which takes as long to import as Python takes to start.
    """

    def find_spec(self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None) -> None:
        importing = getattr(getattr(sys.modules.get(_WHILE), "__spec__", None), "_initializing", False)
        if name == _WHAT and importing:
            raise ModuleNotFoundError(f"{_WHAT} is imported when an MF4 file is read or written", name=_WHAT)
        return None


def put_off_asammdf() -> None:
    """From now on `import can` in this process does without asammdf, and `bring_asammdf` imports it.

    It changes how this interpreter imports, so only a program that owns its interpreter may call it, once, before it
    imports python-can. Everybody else who imports asammdf gets it as always.
    """
    sys.meta_path.insert(0, _NotYet())


def bring_asammdf() -> None:
    """Let python-can have asammdf, if it is installed: before an MF4 file is opened."""
    import can.io.mf4

    if can.io.mf4.asammdf is None and sys.modules.get(_WHAT, can) is not None:  # None: it is not to be had
        # into the same module: the classes that python-can has registered look for their names there
        importlib.reload(can.io.mf4)


def asammdf_missing(path: Path) -> InputError:
    """What to say where MDF can't be read or written."""
    return missing("asammdf", "an MDF file", "use .blf", str(path))


def close_unopened(error: BaseException | None) -> None:
    """Close the file that asammdf failed to open, given the error.

    asammdf closes a file in its object's `__del__`, also one that it could not open; that fails once more, and Python
    prints it on stderr after our own message. So the objects are taken from the error's traceback and closed here.
    """
    from asammdf.blocks.mdf_v3 import MDF3
    from asammdf.blocks.mdf_v4 import MDF4

    while error is not None:
        for frame, _ in walk_tb(error.__traceback__):
            file: Any = frame.f_locals.get("self")
            if isinstance(file, MDF3 | MDF4):
                with contextlib.suppress(Exception):
                    file.close()
                file.close = _closed  # type: ignore[method-assign]
        error = error.__context__


def _closed() -> None:
    """In place of `close` of a file that has been closed."""
