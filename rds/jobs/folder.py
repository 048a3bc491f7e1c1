"""The one folder whose files jobs may name, and where their results go."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.private_files import make_folder
from rds.core.toml_file import read_toml

RESULTS = "runs"
_LONGEST = 200  # characters of a name
_NO_FILES = ("title", "channel")  # keys of an experiment whose values are no names of files


class Folder:
    """A folder whose files are named by their path in it. InputError where it is no folder."""

    def __init__(self, path: str | Path):
        if not Path(path).is_dir():
            raise InputError("is no folder; name the one that holds the part programs and experiments", str(path))
        self.path = Path(path).resolve()

    def file(self, name: str) -> Path:
        """The file of this name. InputError for one that is not there, or outside of the folder, be it by a link."""
        found = self._named(name)
        if not _is_there(found):
            raise InputError(f"file = {name!r} is no file in {self.path}")
        return found

    def machine(self, name: str, key: str) -> str:
        """A machine by its name, or the path of its file in the folder. InputError for any other file; see `file`."""
        if name.endswith(".toml"):
            found = self.file(name)
            self.check_words(found)
            return str(found)
        if "/" in name or "\\" in name:
            raise InputError(f"{key} = {name!r} must be the name of a machine, or a .toml file in the folder")
        return name

    def new_file(self, name: str, suffix: str) -> Path:
        """Where a new file of this name goes. InputError for one that is there, or would be outside of the folder."""
        found = self._named(name)
        if found.suffix != suffix:
            raise InputError(f"file = {name!r} must end with {suffix}")
        if found.exists() or not found.parent.is_dir():
            why = "is there already" if found.exists() else "is in a folder that is not there"
            raise InputError(f"file = {name!r} {why}; choose another name")
        return found

    def _named(self, name: str) -> Path:
        if not name or len(name) > _LONGEST or "\0" in name:
            raise InputError(f"file = {name[:40]!r} must be the path of a file in the served folder")
        return self._inside(self.path / name, f"file = {name!r}")

    def check_words(self, file: Path) -> None:
        """Refuse an experiment whose words name files outside of the folder, those of its own TOML files included."""
        todo, seen = [file], set()
        while todo:
            path = todo.pop()
            seen.add(path)
            for key, word in _texts(read_toml(path)[0]):
                named = path.parent / word
                if key in _NO_FILES or "\0" in word or len(word) > 4096:
                    continue
                if "/" not in word and "\\" not in word and not _is_there(named):
                    continue  # a name of the library
                named = self._inside(named, f"{path.name}: {key} = {word!r}")
                if named.suffix == ".toml" and _is_there(named) and named not in seen:
                    todo.append(named)

    def results(self, name: str) -> Path:
        """A new folder for the results of a job, made."""
        above = self._inside(self.path / RESULTS, f"the folder for results, {RESULTS}/,")
        make_folder(above)
        number = 1
        while (folder := above / f"{Path(name).stem}-{number}").exists() or folder.is_symlink():
            number += 1
        make_folder(folder)
        return folder

    def relative(self, path: Path) -> str:
        """A path as clients name it."""
        return path.relative_to(self.path).as_posix()

    def _inside(self, path: Path, what: str) -> Path:
        try:
            found = path.resolve()
        except (OSError, RuntimeError) as error:  # a circle of links
            raise InputError(f"{what} leads nowhere: {error}") from error
        if not found.is_relative_to(self.path):
            raise InputError(f"{what} leads out of the served folder; jobs may only use files in {self.path}")
        return found


def _is_there(path: Path) -> bool:
    """Whether it is a file, or a link to anything; a text too long for a name is none."""
    try:
        return path.is_symlink() or path.is_file()
    except OSError:
        return False


def _texts(value: Any, key: str = "") -> Iterator[tuple[str, str]]:
    """Every text in a table, with its key."""
    if isinstance(value, str):
        yield key, value
    elif isinstance(value, dict):
        for inner, each in value.items():
            yield from _texts(each, str(inner))
    elif isinstance(value, list):
        for each in value:
            yield from _texts(each, key)
