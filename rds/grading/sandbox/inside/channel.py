"""The submission's ends of its two pipes: questions come in, answers go out."""

from __future__ import annotations

import os
from typing import Any

from rds.grading.sandbox import frames


class Closed(Exception):
    """The grader wants nothing more."""


class Channel:
    """Frames of text and records of fixed size over the descriptors `questions` and `answers`."""

    def __init__(self, questions: int, answers: int):
        self.questions, self.answers = questions, answers

    def receive(self, count: int) -> bytes:
        """Exactly `count` bytes."""
        data = b""
        while len(data) < count:
            part = os.read(self.questions, count - len(data))
            if not part:
                raise Closed
            data += part
        return data

    def send(self, data: bytes) -> None:
        """All of `data`."""
        while data:
            data = data[os.write(self.answers, data) :]

    def ask(self) -> Any:
        """The next frame."""
        return frames.decode(self.receive(frames.size(self.receive(frames.HEADER.size))))

    def tell(self, value: Any) -> None:
        """`value` as a frame."""
        self.send(frames.encode(value))
