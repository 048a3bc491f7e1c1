"""The text of a part program: opened, edited, saved, and never lost, since what is not saved is kept as a draft."""

from __future__ import annotations

import contextlib
import hashlib
import re
from pathlib import Path

from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.nc.bundled import bundled
from rds.panels.session.latest import stamp

ENDINGS = (".ngc", ".nc", ".gcode", ".tap", ".cnc")
LARGEST = 2 << 20  # bytes of a program that is edited here
_NAME = re.compile(r"[^\x00-\x1f/\\:*?\"<>|]{1,100}")


def check_name(name: str) -> None:
    """InputError unless `name` is that of a part program in the folder itself."""
    if not _NAME.fullmatch(name) or name.startswith("."):
        raise InputError(f"{name!r:.60} is no name of a file in your folder; write one like part.ngc")
    if Path(name).suffix.lower() not in ENDINGS:
        raise InputError(f"a part program's name ends with {', '.join(ENDINGS)}; {name!r} does not")


def programs(folder: Path) -> list[str]:
    """The part programs of a folder by name, those with nothing but a draft included."""
    found = set()
    with contextlib.suppress(OSError):
        for each in folder.iterdir():
            name = each.name
            if name.startswith(".") and name.endswith(".draft"):
                name = name[1:].removesuffix(".draft")
            if Path(name).suffix.lower() in ENDINGS and not name.startswith(".") and each.is_file():
                found.add(name)
    return sorted(found)


class ProgramText:
    """One file that is edited. InputError for a name that will not do, or a file that cannot be edited here.

    A file that is not there begins with the text of the bundled program of its name, or with `begin`.
    """

    def __init__(self, folder: Path, name: str, begin: str = ""):
        check_name(name)
        self.name = name
        self._begin = begin
        self.path = folder / name
        self.draft = folder / f".{name}.draft"
        self._open()

    def _open(self) -> None:
        self._stamp = stamp(self.path)
        saved, draft = _read(self.path), _read(self.draft)
        self._digest = _digest(saved)
        self._saved = saved
        begin = bundled()[self.name].text() if self.name in bundled() else self._begin
        self.text = draft if draft is not None else saved if saved is not None else begin
        self._drafted = draft  # what the draft holds

    @property
    def is_new(self) -> bool:
        """Whether there is no such file yet."""
        return self._saved is None and not self.path.exists()

    @property
    def changed(self) -> bool:
        """Whether something here is not saved."""
        return self.text != self._saved

    def on_disk(self) -> Path:
        """A file that holds the text as it is now: the program itself, or its draft, written where it holds another.

        InputError where it cannot be written.
        """
        if not self.changed:
            return self.path
        if self._drafted != self.text or not self.draft.exists():
            self._keep()
        return self.draft

    def _keep(self) -> None:
        text = self.text
        write_whole(self.draft, _data(text))
        self._drafted = text

    @property
    def replaced(self) -> bool:
        """Whether somebody else has written the file since it was read or saved here."""
        return stamp(self.path) != self._stamp

    def accept(self) -> None:
        """Say no more that the file was replaced, as it is now."""
        self._stamp = stamp(self.path)

    def lost(self) -> None:
        """The file has gone: its text is not saved any more, and kept as a draft. InputError as `edit`."""
        self._saved = self._digest = self._stamp = None
        self.edit(self.text)

    def edit(self, text: str) -> None:
        """Take the text, and keep it as a draft; InputError where it is too long or the draft cannot be written."""
        data = _data(text)
        if len(data) > LARGEST:
            raise InputError(f"a program of more than {LARGEST >> 20} MB is not edited here; `rds nc` runs such files")
        self.text = text
        if text == self._saved:
            self.draft.unlink(missing_ok=True)
        else:
            self._keep()

    def save(self) -> None:
        """Write the file; InputError where it has changed on disk since it was opened, or cannot be written."""
        now = _read(self.path)
        if _digest(now) != self._digest and now != self.text:
            raise InputError(
                f"{self.name} was changed by another program since it was opened here; save under another name, or "
                "discard your changes to see the other's"
            )
        write_whole(self.path, _data(self.text))
        self._saved, self._digest, self._stamp = self.text, _digest(self.text), stamp(self.path)
        self.draft.unlink(missing_ok=True)

    def save_as(self, name: str) -> ProgramText:
        """The same text under another name, which is open from then on; InputError if there is such a file."""
        check_name(name)
        other = self.path.with_name(name)
        if other.exists() or other.with_name(f".{name}.draft").exists():
            raise InputError(f"there is a {name} already; open it, or choose another name")
        write_whole(other, _data(self.text))
        return ProgramText(self.path.parent, name)

    def discard(self) -> None:
        """Give the draft up: the text is the file's, as it is on disk now."""
        self.draft.unlink(missing_ok=True)
        self._open()


def _data(text: str) -> bytes:
    return text.encode("utf-8", "replace")


def _digest(text: str | None) -> str | None:
    return None if text is None else hashlib.sha256(_data(text)).hexdigest()


def _read(path: Path) -> str | None:
    """The text of a file; None where there is none. InputError where it cannot be edited."""
    try:
        if path.is_symlink() and path.name.startswith("."):
            raise InputError("is a link, and a draft is none; remove it", str(path))
        with path.open("rb") as stream:
            data = stream.read(LARGEST + 1)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", str(path)) from error
    if len(data) > LARGEST:
        raise InputError(f"is larger than {LARGEST >> 20} MB, too much to edit here; `rds nc` runs it", str(path))
    try:
        return data.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise InputError(f"is no text at byte {error.start + 1}; name a part program", str(path)) from error
