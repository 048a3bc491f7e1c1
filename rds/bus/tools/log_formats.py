"""Formats of bus logs, by the ending of their files: one row here is a format at every door.

Logs are read and written by it (logs.py), `rds bus record` and `rds report` name it, data are described and fitted from
it, and the data panel lists its files. Light to import: classes are named as "module:class", and imported on use.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from rds.bus.tools import log_lines
from rds.bus.tools.log_lines import Rules

Unkept = Callable[[Any], str | None]


def _all_kept(message: Any) -> str | None:
    return None


def _without_fd(message: Any) -> str | None:
    return "CAN FD frames" if message.is_fd else None


def _without_empty_fd(message: Any) -> str | None:
    return "CAN FD frames without data" if message.is_fd and not message.data else None


def _data_only(message: Any) -> str | None:
    if message.is_remote_frame:
        return "remote frames"
    return "error frames" if message.is_error_frame else _without_fd(message)


@dataclass(frozen=True)
class LogFormat:
    """A format of bus logs: what it is called, what it `keeps`, and what a recorder that is killed leaves (`killed`).

    `writer` takes the path, that of a text the open file, and has the methods of `log_writers.Writer`, of a text those
    of python-can's writers. A text has the `rules` of its lines and a `reader` over them; python-can's `LogReader`
    reads all others, after `look(path)`, which raises InputError for what must not be handed to it. `unkept(message)`
    names the kind of a frame that the format cannot hold.
    """

    title: str
    keeps: str
    writer: str
    killed: str = "a readable log"
    rules: Rules | None = None
    reader: str = ""
    look: str = ""
    unkept: Unkept = _all_kept


FORMATS: dict[str, LogFormat] = {
    ".asc": LogFormat(
        "Vector ASCII",
        "all but CAN FD frames without data",
        "can:ASCWriter",
        rules=log_lines.ASC,
        reader="can:ASCReader",
        unkept=_without_empty_fd,
    ),
    ".blf": LogFormat(
        "Vector binary", "all", "rds.bus.tools.log_writers:BlfWriter", look="rds.bus.tools.blf:check_containers"
    ),
    ".log": LogFormat(
        "candump -L",
        "all",
        "rds.bus.tools.log_writers:CandumpWriter",
        rules=log_lines.CANDUMP,
        reader="can:CanutilsLogReader",
    ),
    ".trc": LogFormat(
        "PEAK",
        "classic data frames only",
        "can:TRCWriter",
        rules=log_lines.TRC,
        reader="can:TRCReader",
        unkept=_data_only,
    ),
    ".csv": LogFormat(
        "python-can",
        "all but CAN FD frames",
        "can:CSVWriter",
        rules=log_lines.CSV,
        reader="can:CSVReader",
        unkept=_without_fd,
    ),
    ".db": LogFormat(
        "SQLite",
        "all but CAN FD frames",
        "rds.bus.tools.log_writers:DatabaseWriter",
        look="rds.bus.tools.log_bombs:check_table",
        unkept=_without_fd,
    ),
    ".mf4": LogFormat(
        "ASAM MDF 4",
        "all",
        "rds.bus.tools.log_writers:Mf4Writer",
        killed="nothing",
        look="rds.bus.tools.log_bombs:check_mf4",
    ),
}
READ_ONLY = (".txt", ".crtd", ".can")  # of other tools, told apart by their first lines (other_logs.py)
ENDINGS = tuple(FORMATS)
TEXTS = tuple(name for name, each in FORMATS.items() if each.rules is not None)
PACKED = tuple(f"{name}.gz" for name in TEXTS)


def in_words() -> str:
    """The endings, for a help text."""
    return f"{' '.join(ENDINGS)}, or {' '.join(PACKED)}"


def named(place: str) -> Any:
    """The class or function at "module:name"."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)
