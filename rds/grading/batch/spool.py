"""What a class handed in, in one file without a name: all of it together need not have room in memory."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from typing import IO, Any

from rds.core.errors import InputError


@dataclass(frozen=True, slots=True, eq=False)
class Spooled:
    """Bytes in a spool; in memory only where it was sent to another process."""

    size: int
    start: int = 0
    file: IO[bytes] | None = None
    data: bytes = b""

    def read(self) -> bytes:
        """The bytes."""
        return self.data if self.file is None else os.pread(self.file.fileno(), self.size, self.start)

    def __reduce__(self) -> tuple[Any, ...]:
        return Spooled, (self.size, 0, None, self.read())


class Spool:
    """Written by `put`. The file is gone when nobody holds the spool, or anything in it, any more."""

    def __init__(self) -> None:
        self._file: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115  # as long as anything in it is held
        self._end = 0

    def put(self, data: bytes) -> Spooled:
        """The same bytes, to be read again from here. InputError where the temporary folder has no room."""
        try:
            view = memoryview(data)
            while view:
                view = view[os.write(self._file.fileno(), view) :]
        except OSError as error:
            said = f"cannot take what was handed in: {error.strerror}; make room there, or let TMPDIR name another"
            raise InputError(said, tempfile.gettempdir()) from error
        found = Spooled(len(data), self._end, self._file)
        self._end += len(data)
        return found
