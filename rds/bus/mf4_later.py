"""python-can without the wait for asammdf.

`import can` imports asammdf where it is installed, and pandas with it: one and a half seconds in each process on a bus,
for a kind of log that few of them touch. While python-can itself is being imported, asammdf is not to be found here;
`bring_mf4` imports it for who reads or writes such a log.
"""

from __future__ import annotations

import contextlib
import importlib
import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

_WHAT, _WHILE = "asammdf", "can"


class _NotYet(MetaPathFinder):
    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        importing = getattr(getattr(sys.modules.get(_WHILE), "__spec__", None), "_initializing", False)
        if name == _WHAT and importing:
            raise ModuleNotFoundError(f"{_WHAT} is imported when an MF4 file is read or written", name=_WHAT)
        return None


def put_off_mf4() -> None:
    """From now on `import can` does without asammdf, if it has not been imported yet."""
    if not any(isinstance(finder, _NotYet) for finder in sys.meta_path):
        sys.meta_path.insert(0, _NotYet())


def bring_mf4() -> None:
    """Let python-can have asammdf, if it is installed: before an MF4 file is opened."""
    import can.io.mf4

    if can.io.mf4.asammdf is None and sys.modules.get(_WHAT, can) is not None:  # None: it is not to be had
        # into the same module: the classes that python-can has registered look for their names there
        importlib.reload(can.io.mf4)
    if can.io.mf4.asammdf is not None:
        end_quietly()


def end_quietly() -> None:
    """asammdf closes a file in `__del__`, also one that it could not open: Python would print that error on stderr,
    after ours has been said.
    """
    from asammdf.blocks.mdf_v3 import MDF3
    from asammdf.blocks.mdf_v4 import MDF4

    def end(self: Any) -> None:
        with contextlib.suppress(Exception):
            self.close()

    for kind in (MDF3, MDF4):
        if "__del__" in vars(kind):
            kind.__del__ = end  # type: ignore[method-assign]
