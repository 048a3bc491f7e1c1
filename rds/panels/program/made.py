"""Part programs that a panel makes: its own are written anew, whatever else has the name is kept."""

from __future__ import annotations

from pathlib import Path

from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.panels.program.state import program_choices
from rds.panels.session.session import Session


class MadePrograms:
    """The programs that one panel has made in this sitting, of a `kind` that messages name."""

    def __init__(self, session: Session, kind: str):
        self._session, self._kind = session, kind
        self._written: dict[Path, bytes] = {}

    def offered(self, stem: str) -> str:
        """The first of STEM.ngc, STEM-2.ngc, ... that is free, or was made here and not changed since."""
        number, name = 1, f"{stem}.ngc"
        while not self._is_free(self._session.folder / name):
            number += 1
            name = f"{stem}-{number}.ngc"
        return name

    def write(self, name: str, text: str) -> bool:
        """Write it, and open it in the program panel; whether one that was made before is replaced.

        InputError for a file of that name that was not written from here, or has changes that are not saved.
        """
        path, data = self._session.folder / name, text.encode()
        before = path.read_bytes() if path.is_file() else None
        if before is not None and before not in (data, self._written.get(path)):
            raise InputError(f"there is a {name} already, which is not of this {self._kind}; choose another name")
        if _draft(path).exists():
            raise InputError(f"{name} has changes in the program panel that are not saved; choose another name")
        write_whole(path, data)
        self._written[path] = data
        program_choices(self._session).set("file", name)
        return before not in (None, data)

    def _is_free(self, path: Path) -> bool:
        if _draft(path).exists():
            return False
        return not path.exists() or (path.is_file() and path.read_bytes() == self._written.get(path))


def _draft(path: Path) -> Path:
    return path.with_name(f".{path.name}.draft")
