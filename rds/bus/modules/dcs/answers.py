"""The answers of units out of the bytes of a line, on which noise turns bits and bytes get lost.

CRC-8 finds every error of up to three bits in an answer, but of seven bytes at random one of 256 passes. So a damaged
answer is passed over whole, and the stream is searched byte by byte only where the next one is none either, which
happens where bytes are missing: of the seven windows that lie across two answers each would be another chance for
bytes that nobody has sent as an answer.
"""

from __future__ import annotations

from rds.bus.modules.dcs.frames import ANSWER_SIZE, Answer, decode_answer


class AnswerStream:
    """Bytes in, answers out; `damaged` counts the answers that were none."""

    def __init__(self) -> None:
        self.damaged = 0
        self._kept = bytearray()
        self._searching = False

    def add(self, data: bytes) -> None:
        """Bytes that have come."""
        self._kept += data

    def clear(self) -> None:
        """Forget what has come."""
        self._kept.clear()
        self._searching = False

    def next(self) -> Answer | None:
        """The next whole answer; None until more bytes come."""
        while len(self._kept) >= ANSWER_SIZE:
            answer = decode_answer(self._kept[:ANSWER_SIZE])
            if answer is not None:
                del self._kept[:ANSWER_SIZE]
                self._searching = False
                return answer
            self.damaged += not self._searching
            del self._kept[: 1 if self._searching else ANSWER_SIZE]
            self._searching = True
        return None
