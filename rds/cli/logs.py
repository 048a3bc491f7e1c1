"""The logs that commands on logged data take: files, their map, and the axis that is meant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rds.core.progress import Progress

if TYPE_CHECKING:
    from rds.identification.logs.log import Log

Bar = Callable[[str], Progress]


def read_logs(paths: Sequence[Path], map_: Path | None, axis: str | None, bar: Bar) -> list[Log]:
    """The logs in the files, of one axis. InputError where a file holds several and none is chosen, or not that one."""
    return [log for path in paths for log in _of_file(path, map_, axis, bar(f"reading {path.name}"))]


def _of_file(path: Path, map_: Path | None, axis: str | None, progress: Progress) -> list[Log]:
    from rds.core.errors import InputError
    from rds.identification.logs.read_log import read_log

    found = read_log(path, map_, progress)
    axes = list(dict.fromkeys(name for log in found if (name := _axis(log))))
    if axis is None and len(axes) > 1:
        raise InputError(f"it holds the axes {', '.join(axes)}; say which with --axis", str(path))
    if axis is not None and axes and axis not in axes:
        raise InputError(f"it holds no axis {axis!r}; it holds {', '.join(axes)}", str(path))
    return [log for log in found if axis is None or not axes or _axis(log) == axis]


def _axis(log: Log) -> str:
    """The axis that a log's name says, where its file holds several: `name:axis`, `name:axis part 2`."""
    return log.name.rpartition(":")[2].partition(" part ")[0] if ":" in log.name else ""
