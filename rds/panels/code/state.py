"""The code of one role ("controller", "model", "interpolator") without widgets: its files, faults and versions."""

from __future__ import annotations

import ast
from collections.abc import Callable
from pathlib import Path

from rds.core.errors import InputError
from rds.panels.code.completions import Word, words
from rds.panels.code.file import CodeFile, check_name, code_files, free_name, role_of
from rds.panels.code.templates import TEMPLATES
from rds.panels.code.versions import Version, versions
from rds.panels.equipment.build import Builds, Checked, Mark
from rds.panels.session.file_params import file_params
from rds.panels.session.latest import Latest
from rds.panels.session.session import Session
from rds.panels.session.task import Task


class Code:
    """The file that is open. `tick()` is called ten times a second and gives what was found, once for each text."""

    def __init__(
        self,
        session: Session,
        role: str,
        builds: Builds,
        period: Callable[[], float],
        axes: Callable[[], int] = lambda: 0,
    ):
        """A check calls the code with the sample period `period()` (s); `axes()` as in `Builds.check`."""
        self.session, self.role = session, role
        self._builds, self._period, self._axes = builds, period, axes
        here = code_files(session.folder, role)
        self.file = CodeFile(session.folder, here[0] if here else TEMPLATES[role].name, role)
        self._latest: Latest[Checked] | None = None  # none until something was typed: opening a file runs nothing

    def files(self) -> list[str]:
        """The names to choose among: those of this role in the folder, and the one that is open."""
        return sorted({*code_files(self.session.folder, self.role), self.file.name})

    def open(self, name: str) -> None:
        """Open a file of the folder; InputError where it cannot be edited here."""
        self.file = CodeFile(self.session.folder, name, self.role)
        self._latest = None

    def new(self, name: str = "") -> None:
        """Begin a file with the template, under a name of its own where none is given; InputError if there is one."""
        folder = self.session.folder
        name = check_name(name) if name.strip() else free_name(folder, TEMPLATES[self.role].name)
        if (folder / name).exists():
            raise InputError(f"there is a {name} already; open it in the list, or choose another name")
        self.open(name)
        self.file.save()

    def take(self, name: str, content: bytes) -> str:
        """Keep a file that was dropped here and open it; its name, which has a number if there was another of it."""
        try:
            text = content.decode("utf-8-sig").replace("\r\n", "\n")
        except UnicodeDecodeError as error:
            raise InputError(f"{name} is no text; drop a Python file (.py)") from error
        if not name.endswith(".py"):
            raise InputError(f"{name} is no Python file; drop one that ends with .py")
        found = role_of(text)
        if found is not None and found != self.role:
            raise InputError(f"{name} holds a {found}, not a {self.role}; drop it where {found}s are edited")
        folder, name = self.session.folder, check_name(Path(name).name)
        here = folder / name
        if not here.exists() or here.read_bytes() != content:
            name = free_name(folder, name)
            made = CodeFile(folder, name, self.role)
            made.edit(text)
        self.open(name)
        return name

    def edit(self, text: str) -> None:
        """Take what was typed: onto the disk, and into the check, which begins at the next tick."""
        if text == self.file.text and not self.file.is_new:
            return
        self.file.edit(text)
        if self._latest is None:
            self._latest = Latest(self._check)
        else:
            self._latest.again()

    @property
    def checking(self) -> bool:
        """Whether what was typed last is still being checked."""
        return self._latest is not None and self._latest.going_on

    def tick(self) -> Checked | None:
        """What was found in the text as it is now, once."""
        task = self._latest.tick() if self._latest is not None else None
        if task is None:
            return None
        if task.result is None:
            return Checked(self.role, self.file.path, self.file.text, (Mark(None, str(task.error)),))
        return task.result

    def words(self) -> list[Word]:
        """What the editor offers while one types."""
        return words(self.role, file_params(self.file.path))

    def versions(self) -> list[Version]:
        """The texts with which it ran, the latest first."""
        return versions(self.session.folder, self.file.name)

    def _check(self) -> Task[Checked]:
        path, text, T, axes = self.file.path, self.file.text, self._period(), self._axes()

        def work(task: Task[Checked]) -> Checked:
            fault = syntax_fault(text)  # without a process of its own: most texts that are half typed end here
            if fault is not None:
                return Checked(self.role, path, text, (fault,))
            return self._builds.check(self.role, path, T, task.pulse, axes)

        return self.session.work("check", work)


def syntax_fault(text: str) -> Mark | None:
    """Where Python cannot read a text, with what it says; None where it can."""
    try:
        ast.parse(text)
    except SyntaxError as error:
        line = min(error.lineno or 1, text.count("\n") + 1)
        return Mark(line, f"Python cannot read this line: {error.msg}")
    except (ValueError, RecursionError, MemoryError) as error:
        return Mark(None, f"Python cannot read it: {error}")
    return None
