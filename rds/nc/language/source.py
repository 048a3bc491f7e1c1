"""The text of a program, block by block, from a file, a string or a file object, with places to come back to."""

from __future__ import annotations

import codecs
import io
import os
from collections.abc import Iterator
from typing import IO, TYPE_CHECKING, Any, NamedTuple

from rds.nc.language.errors import ProgramError

if TYPE_CHECKING:
    from pathlib import Path

CHUNK = 1 << 18  # bytes read at once
LONGEST = 252  # characters of a line, as in LinuxCNC
NOT_A_FILE = "is a pipe or a device, and a program is read more than once; give a file"
_NO_PROGRAMS = {  # by the file's ending
    ".py": "is a Python file, and no part program; `rds check` looks at it",
    ".toml": "is a TOML file, and no part program; `rds run` runs an experiment, `rds interpolate` takes a path",
}
_WINDOW = LONGEST + 4  # a block with `;` and a line break, and one character more


class SourcePosition(NamedTuple):
    """Where a block begins: bytes from the file's start, line (from 1), characters before it on its line."""

    offset: int
    line: int
    column: int


_KNOWN_MOST = 20_000  # blocks remembered


class Source:
    """Blocks of a program as bytes: a line each, or with `semicolons` up to the next `;` outside of comments.

    `buffer` holds text already read, from byte `at` on not yet taken; what takes lines from it by itself says so by
    `skip`. Memory does not grow with the length of the program.
    """

    def __init__(
        self,
        stream: IO[bytes],
        name: str,
        *,
        folder: str | None = None,
        semicolons: bool = False,
        owned: bool = True,
    ):
        self.name = name
        self._owned = owned
        self.folder = folder
        self.line = 0  # of the block read last
        self.column = 0  # characters before that block on its line
        self.place = SourcePosition(0, 1, 0)  # of the block read last
        self.buffer = b""
        self.at = 0
        self._stream = stream
        self._base = stream.tell()  # of the buffer's first byte
        self._next = SourcePosition(self._base, 1, 0)
        self._semicolons = semicolons
        self._ended = False
        self._fresh = True  # nothing has been read
        self._known: dict[int, tuple[bytes, SourcePosition]] = {}  # blocks read again, and what follows

    def size(self) -> int:
        """Bytes of the whole program; 0 when that is not known before it is read."""
        if isinstance(self._stream, _Spool):
            return 0
        here = self._stream.tell()
        end = self._stream.seek(0, os.SEEK_END)
        self._stream.seek(here)
        return end

    def fill(self) -> bool:
        """Read on until the buffer holds a whole line after `at` (or the program's end). False: nothing is left."""
        while not self._ended and self.buffer.find(b"\n", self.at) < 0:
            more = self._stream.read(CHUNK)
            if self._fresh:
                self._fresh = False
                more = self._without_mark(more)
            self._ended = not more
            self._base += self.at
            self.buffer = self.buffer[self.at :] + more
            self.at = 0
            if len(self.buffer) > 2 * CHUNK and b"\n" not in self.buffer:
                break  # the line is too long anyway
        return self.at < len(self.buffer)

    def _without_mark(self, text: bytes) -> bytes:
        """What some editors put before the text to tell its coding is none of it. Raises ProgramError for UTF-16."""
        if text.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            raise ProgramError(
                "the file is in the coding UTF-16; save it as UTF-8 or plain ASCII", file=self.name, line=1
            )
        if text.startswith(codecs.BOM_UTF8):
            text = text[len(codecs.BOM_UTF8) :]
            self._base += len(codecs.BOM_UTF8)
            self._next = SourcePosition(self._base, 1, 0)
        return text

    def read_again(self) -> bytes:
        """As `read`, for a program whose blocks are read many times: those that have been are remembered."""
        place = self._next
        known = self._known.get(place.offset)
        if known is not None and self.at + len(known[0]) <= len(self.buffer):
            self.place = place
            self.line, self.column = place.line, place.column
            raw, self._next = known
            self.at += len(raw)
            return raw
        raw = self.read()
        if len(self._known) < _KNOWN_MOST and raw[-1:] == b"\n":
            self._known[place.offset] = raw, self._next
        return raw

    def read(self) -> bytes:
        """The next block, with the line break that ends it; b"" at the end."""
        raw = self._short_block() if self._semicolons else b""
        if not raw:
            end = self.buffer.find(b"\n", self.at) + 1
            if not end:
                if not self.fill():
                    return b""
                end = self.buffer.find(b"\n", self.at) + 1 or len(self.buffer)
            raw = self.buffer[self.at : end]
        self.place = place = self._next
        self.line, self.column = place.line, place.column
        self.at += len(raw)
        if raw[-1] == 10:
            self._next = SourcePosition(place.offset + len(raw), place.line + 1, 0)
        else:
            self._next = SourcePosition(place.offset + len(raw), place.line, place.column + len(raw))
        return raw

    def _short_block(self) -> bytes:
        """The next block up to its `;` when it is not too long: of a long line only so much is looked at."""
        if self.buffer.find(b"\n", self.at, self.at + _WINDOW) < 0 and len(self.buffer) - self.at < _WINDOW:
            self.fill()
        line, end, _ = self.buffer[self.at : self.at + _WINDOW].partition(b"\n")
        line += end
        return line[: _block_end(line)]

    def skip(self, size: int, lines: int) -> None:
        """`size` bytes of the buffer, which are `lines` whole lines, have been taken by someone else."""
        self.at += size
        offset, line, _ = self._next
        self._next = SourcePosition(offset + size, line + lines, 0)
        self.line = line + lines - 1

    @property
    def next_line(self) -> int:
        """The line of the block that comes next."""
        return self._next.line

    def following(self) -> SourcePosition:
        """Where the next block begins."""
        return self._next

    def go_to(self, place: SourcePosition) -> None:
        """Read on from there."""
        inside = place.offset - self._base
        if 0 <= inside <= len(self.buffer):
            self.at = inside
        else:
            self._stream.seek(place.offset)
            self._base, self.buffer, self.at, self._ended = place.offset, b"", 0, False
        self._next = place

    def close(self) -> None:
        if self._owned:
            self._stream.close()


def _block_end(raw: bytes) -> int:
    """Bytes up to and with the first `;` outside of a comment, and a line break right after; 0 when there is none."""
    comment = False
    for index, byte in enumerate(raw):
        if comment:
            comment = byte != 41
        elif byte == 40:
            comment = True
        elif byte == 59:
            rest = raw[index + 1 :]
            return len(raw) if rest.isspace() and rest.endswith(b"\n") else index + 1
    return 0


class _Spool(io.RawIOBase):
    """A file object that can only be read on, made one that can be gone back in: what was read is kept on disk."""

    def __init__(self, lines: Iterator[Any]):
        self._lines = lines
        import tempfile  # for what cannot be read again

        self._kept = tempfile.SpooledTemporaryFile(max_size=1 << 22)  # noqa: SIM115 (closed by close)
        self._at = 0
        self._end = 0

    def tell(self) -> int:
        return self._at

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        self._at = offset
        return offset

    def read(self, size: int = -1) -> bytes:
        if self._at == self._end:
            self._kept.seek(self._end)
            for line in self._lines:
                data = line.encode("utf-8", "surrogateescape") if isinstance(line, str) else line
                self._kept.write(data)
                self._end += len(data)
                if self._end - self._at >= size:
                    break
        self._kept.seek(self._at)
        data = self._kept.read(size)
        self._at += len(data)
        return data

    def close(self) -> None:
        self._kept.close()
        super().close()


def open_source(source: str | Path | IO[Any] | Source, name: str = "", *, semicolons: bool = False) -> Source:
    """A Path is a file; a str is the program itself; a file object is read as it goes. Raises ProgramError."""
    if isinstance(source, Source):
        return source
    if isinstance(source, os.PathLike):  # not Path, whose import takes as long as a thousand lines
        return open_file(source, name or str(source), semicolons=semicolons)
    owned = True
    if isinstance(source, str):
        if source and source.isprintable() and len(source) <= LONGEST and os.path.isfile(source):
            raise ProgramError("is the name of a file, and a str is the program itself; give Path(...)", file=source)
        stream: IO[bytes] = io.BytesIO(source.encode("utf-8", "surrogatepass"))
    elif isinstance(source, io.BufferedIOBase | io.RawIOBase) and source.seekable():
        stream, owned = source, False
    else:
        stream = _Spool(iter(source))  # type: ignore[assignment]
    return Source(stream, name or str(getattr(source, "name", "")), semicolons=semicolons, owned=owned)


def not_a_file(path: str | Path) -> bool:
    """Whether the path is a pipe's or a device's: a program is read more than once, and /dev/zero has no end."""
    return os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path)


def open_file(path: str | Path, name: str, *, semicolons: bool = False) -> Source:
    if not_a_file(path):
        raise ProgramError(NOT_A_FILE, file=name)
    if other := _NO_PROGRAMS.get(os.path.splitext(path)[1].lower()):
        raise ProgramError(other, file=name)
    try:
        stream = open(path, "rb")  # noqa: SIM115 (closed by close)
    except OSError as error:
        raise ProgramError(f"cannot be read ({error.strerror}); check the path", file=name) from None
    return Source(stream, name, folder=os.path.dirname(path), semicolons=semicolons)
