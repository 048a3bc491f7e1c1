"""The submission's ends of its two pipes: questions come in, answers go out."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from rds.grading.sandbox import frames
from rds.grading.sandbox.inside import walls
from rds.grading.sandbox.records import Layout
from rds.grading.sandbox.shared_channel import ChannelClosed, SharedChannel

_LONGEST = 2000  # characters of an error

Receive = Callable[[], tuple[Any, ...]]
Send = Callable[..., None]


class Channel:
    """Frames of text and records of fixed size, over the descriptors `questions` and `answers` or shared memory."""

    def __init__(self, questions: int, answers: int, memory: int, question_bell: int, answer_bell: int):
        self.questions, self.answers = questions, answers
        self._shared = (memory, question_bell, answer_bell)

    def records(self, layout: Layout, through_memory: bool) -> tuple[Receive, Send]:
        """Functions: one takes the next question (number, doubles), one gives its answer (number, code, doubles)."""
        unpack, pack, size = layout.question.unpack, layout.answer.pack, layout.question.size
        if not through_memory:
            return lambda: unpack(self.receive(size)), lambda *answer: self.send(pack(*answer))
        return SharedChannel(*self._shared, self.questions, asks=False).answerer(layout)

    def receive(self, count: int) -> bytes:
        """Exactly `count` bytes."""
        data = os.read(self.questions, count)
        while len(data) != count:  # hardly ever: a pipe hands over small writes whole
            part = os.read(self.questions, count - len(data))
            if not part:
                raise ChannelClosed
            data += part
        return data

    def send(self, data: bytes) -> None:
        """All of `data`."""
        done = os.write(self.answers, data)
        while done != len(data):
            done += os.write(self.answers, data[done:])

    def ask(self) -> Any:
        """The next frame."""
        return frames.decode(self.receive(frames.size(self.receive(frames.HEADER.size))))

    def tell(self, value: Any) -> None:
        """`value` as a frame."""
        self.send(frames.encode(value))

    def tell_error(self, said: str) -> None:
        """What went wrong, for the submission's author. Half a character in it, which no file can hold, becomes `?`."""
        whole = said.replace(f"{walls.HOME}/", "").encode("utf-8", "replace").decode()
        self.tell({"error": whole[:_LONGEST]})
