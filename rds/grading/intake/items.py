"""One file of many that were handed in, wherever it lies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime

CODE = (".py", ".ipynb")
ARCHIVE = ".zip"
MOST_FILES = 200_000
DEEPEST = 12  # folders in folders

# what computers leave beside the files of their users
_CLUTTER = {"__MACOSX", "__pycache__", ".DS_Store", ".ipynb_checkpoints", ".git", "Thumbs.db", "desktop.ini"}
_CLUTTER |= {".venv", "site-packages", ".idea", ".vscode", ".mypy_cache", ".pytest_cache", ".ruff_cache"}


class Refusal(Exception):
    """Why a file is not opened: a sentence for its author."""


class Unreadable(Refusal):
    """The computer does not give the file to who grades: the author has done nothing wrong."""


@dataclass(frozen=True, slots=True)
class Item:
    """A file as it was found; nothing of it has been read.

    `parts` are the names of its folders and its own, below the place that was searched. `read(most)` gives its bytes,
    Refusal if there are more than `most`, or none can be had. `fault` says why it is not to be read at all. `time` is
    what the place says of when it came there, without a time zone where none is known. `is_unreadable`: whether the
    `fault` is that of who grades, and not the author's. `attempt` tells the attempts of one student apart.
    """

    parts: tuple[str, ...]
    read: Callable[[int], bytes]
    time: datetime | None = None
    fault: str = ""
    is_unreadable: bool = False
    attempt: str = ""

    @property
    def name(self) -> str:
        """Its own name."""
        return self.parts[-1]

    @property
    def is_code(self) -> bool:
        """Whether its name says that it is Python, or a notebook."""
        return self.name.lower().endswith(CODE)

    @property
    def is_archive(self) -> bool:
        """Whether its name says that it is a zip."""
        return self.name.lower().endswith(ARCHIVE)

    @property
    def is_handed_in(self) -> bool:
        """Whether it may be a submission, or a part of one: not a table or a note beside them."""
        return self.is_code or self.is_archive or bool(self.fault)


def is_clutter(parts: tuple[str, ...]) -> bool:
    """Whether no person made this file."""
    return not _CLUTTER.isdisjoint(parts) or (bool(parts) and parts[-1].startswith("._"))


def faulty(parts: tuple[str, ...], fault: str, is_unreadable: bool = False) -> Item:
    """An item that is not to be read."""

    def refuse(most: int) -> bytes:
        raise refusal(fault, is_unreadable)

    return Item(parts, refuse, fault=fault, is_unreadable=is_unreadable)


def refusal(fault: str, is_unreadable: bool) -> Refusal:
    """To be raised for an item with this fault."""
    return Unreadable(fault) if is_unreadable else Refusal(fault)
