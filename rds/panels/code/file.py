"""A file of the user's code: found in the folder, opened, and kept on disk while it is edited."""

from __future__ import annotations

import ast
import contextlib
import re
from pathlib import Path

from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.panels.code.templates import TEMPLATES
from rds.panels.equipment.build import LARGEST

_NAME = re.compile(r"[^\x00-\x1f/\\:*?\"<>|]{1,100}")


def check_name(name: str) -> str:
    """The name, ended with .py; InputError unless it can be that of a file in the folder itself."""
    name = name.strip()
    if name and not name.endswith(".py"):
        name += ".py"
    if not _NAME.fullmatch(name) or name.startswith("."):
        raise InputError(f"{name!r:.60} is no name of a file in your folder; write one like my_controller.py")
    return name


def role_of(text: str) -> str | None:
    """What the functions at the outermost level make of a file; None for neither controller, model nor interpolator."""
    try:
        body = ast.parse(text).body
        names = {each.name for each in body if isinstance(each, ast.FunctionDef)}
    except (SyntaxError, ValueError, RecursionError, MemoryError):  # half typed
        names = set(re.findall(r"(?m)^def (\w+)", text))
    return next((role for role, each in TEMPLATES.items() if names.intersection(each.functions)), None)


def code_files(folder: Path, role: str) -> list[str]:
    """The Python files of `folder` that are of `role`, by name."""
    found = []
    with contextlib.suppress(OSError):
        for path in folder.glob("*.py"):
            with contextlib.suppress(OSError, InputError):
                if not path.name.startswith(".") and role_of(read(path)) == role:
                    found.append(path.name)
    return sorted(found)


def free_name(folder: Path, name: str) -> str:
    """`name`, or the same with a number, whichever no file has yet."""
    stem, number = name.removesuffix(".py"), 1
    while (folder / name).exists():
        number += 1
        name = f"{stem}_{number}.py"
    return name


def read(path: Path) -> str:
    """Its text. InputError for one that is too long, or no text."""
    with path.open("rb") as stream:
        data = stream.read(LARGEST + 1)
    if len(data) > LARGEST:
        raise InputError(f"is larger than {LARGEST >> 20} MB, too much to edit here", str(path))
    try:
        return data.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise InputError(f"is no text at byte {error.start + 1}; choose a Python file", str(path)) from error


class CodeFile:
    """One file that is edited; what is typed is on disk at once. A file that is not there begins with the template.

    What another program writes meanwhile is taken over, and never written over by a text that was typed before it.
    """

    def __init__(self, folder: Path, name: str, role: str):
        """InputError for a name that will not do, or a file that cannot be edited here."""
        self.name, self.role = check_name(name), role
        self.path = folder / self.name
        self.text = ""
        self.is_new = False
        self._open()

    def _open(self) -> None:
        self._on_disk = self._read()
        self.is_new = self._on_disk is None
        self.text = TEMPLATES[self.role].text if self._on_disk is None else self._on_disk

    def edit(self, text: str) -> None:
        """Take the text and write it; InputError where another program has changed the file, or it cannot be written.

        The other's text is `text` then.
        """
        if len(text.encode("utf-8", "replace")) > LARGEST:
            raise InputError(f"a file of more than {LARGEST >> 20} MB is not edited here")
        if self.refresh():
            raise InputError(
                f"{self.name} was changed by another program meanwhile; its text is shown now, and your last keys "
                "are not in it"
            )
        self.text = text
        self.save()

    def save(self) -> None:
        """Write the file, if it is not as it should be."""
        if self._on_disk != self.text:
            write_whole(self.path, self.text.encode("utf-8", "replace"))
            self._on_disk, self.is_new = self.text, False

    def refresh(self) -> bool:
        """Take over what another program has written; whether it has. InputError where that cannot be edited here."""
        now = self._read()
        if now is None or now in (self._on_disk, self.text):  # one that was deleted is written again
            self._on_disk = now
            return False
        self._open()
        return True

    def _read(self) -> str | None:
        """What is on disk; None where there is no such file."""
        try:
            return read(self.path)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror}", str(self.path)) from error
