"""What a submission prints: kept up to a limit, counted beyond it, and harmless to show."""

from __future__ import annotations

import os

_READ = 1 << 16


class Output:
    """The outer end of a submission's stdout and stderr; `descriptor` does not block.

    `most_bytes` are kept, and more than `flood_bytes` are no longer talk but an attack.
    """

    def __init__(self, descriptor: int, most_bytes: int, flood_bytes: int):
        self.descriptor = descriptor
        os.set_blocking(descriptor, False)
        self._kept = bytearray()
        self._most, self._flood = most_bytes, flood_bytes
        self._seen = 0
        self._from_byte, self._from_seen = 0, 0  # of what is shown

    def collect(self) -> bool:
        """Take what there is; False once nothing more can come."""
        while True:
            try:
                data = os.read(self.descriptor, _READ)
            except BlockingIOError:
                return True
            except OSError:
                return False
            if not data:
                return False
            self._seen += len(data)
            self._kept += data[: max(self._most - len(self._kept), 0)]
            if self.is_flood:
                return True

    @property
    def is_flood(self) -> bool:
        """Whether it is far more than anyone reads."""
        return self._seen > self._flood

    @property
    def seen(self) -> int:
        """How many bytes were printed, those that were cut among them."""
        return self._seen

    @property
    def so_far(self) -> tuple[bytes, int]:
        """What was kept, and how many bytes were printed."""
        return bytes(self._kept), self._seen

    def skip(self) -> None:
        """What was printed so far is shown elsewhere, and not again in `text`."""
        self._from_byte, self._from_seen = len(self._kept), self._seen

    @property
    def text(self) -> str:
        """What was kept, without control characters, and how much is missing."""
        shown = bytes(self._kept[self._from_byte :])
        missing = self._seen - self._from_seen - len(shown)
        return printable(shown.decode(errors="replace")) + (f"\n… {missing} bytes more were cut" if missing else "")


def printable(text: str) -> str:
    """`text` without characters that move a terminal's cursor or hide others; lines and tabs stay."""
    return "".join(each if each.isprintable() or each in "\n\t" else "\N{REPLACEMENT CHARACTER}" for each in text)
