"""Questions and answers through shared memory, for grader and submission on two processors. Used on both sides.

Each side writes its record, then its counter; the other one looks at the counter again and again for a while before it
goes to sleep. Waking a processor up takes 50 µs and more in a virtual machine, looking 1 µs. The order of two writes by
one processor is seen by all others on x86 (total store order) but not elsewhere: `can_be_used` says so.

The memory is sealed at its size: whoever shares it cannot make the other side's reads fail. Its content is read once,
then checked, as that of a pipe is.
"""

from __future__ import annotations

import fcntl
import mmap
import os
import platform
import select
import struct
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from rds.grading.sandbox.records import Layout

SIZE = 4096  # bytes
QUESTION, ANSWER = 512, 2048  # where the records are

_ASKED, _ANSWERED = 16, 32  # the counters, as 8-byte words in cache lines of their own; beside each: who sleeps
_LOOKS = 2000  # about 80 µs
_SLEEP = 5  # ms; a bell that was rung just before its hearer fell asleep costs that much
_SEALS = 0x0001 | 0x0002 | 0x0004  # no further seal, no shrinking, no growing
_ADD_SEALS = 1033


def can_be_used() -> bool:
    """Whether this processor's memory is ordered as this needs it."""
    return platform.machine() in ("x86_64", "AMD64")


def make_memory() -> int:
    """The descriptor of shared memory whose size nobody can change."""
    descriptor = os.memfd_create("rds-channel", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
    os.ftruncate(descriptor, SIZE)
    fcntl.fcntl(descriptor, _ADD_SEALS, _SEALS)
    return descriptor


def make_bell() -> int:
    """The descriptor that one side sleeps at, and the other rings."""
    return os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)


class ChannelClosed(Exception):
    """The other side has ended."""


class SharedChannel:
    """One side of it: the grader's if `asks`. `memory`, `own_bell` and `other_bell` are descriptors.

    `sign_of_life` is a pipe's that hangs up when the other side ends.
    """

    def __init__(self, memory: int, own_bell: int, other_bell: int, sign_of_life: int, asks: bool):
        self._memory = mmap.mmap(memory, SIZE)
        self._words = memoryview(self._memory).cast("Q")
        self._own, self._other = (_ASKED, _ANSWERED) if asks else (_ANSWERED, _ASKED)
        self._own_bell, self._other_bell = own_bell, other_bell
        self._poll = select.poll()
        self._poll.register(own_bell, select.POLLIN)
        self._poll.register(sign_of_life, 0)  # POLLHUP and POLLERR come unasked

    def asker(self, layout: Layout) -> Callable[[int, tuple[float, ...]], tuple[Any, ...]]:
        """The grader's function: sample number and doubles out, (number, code, doubles) back, or `ChannelClosed`.

        Both functions are written out flat: a call within them costs as much as the hand-over itself.
        """
        memory, words, pack_into, unpack_from = self._memory, self._words, *_codecs(layout.question, layout.answer)
        ring, sleep, looks, number = self._ring, self._sleep, range(_LOOKS), 0

        def ask(k: int, values: tuple[float, ...]) -> tuple[Any, ...]:
            nonlocal number
            number += 1
            pack_into(memory, QUESTION, k, *values)
            words[_ASKED] = number
            if words[_ANSWERED + 1]:
                ring()
            for _ in looks:
                if words[_ANSWERED] == number:
                    return unpack_from(memory, ANSWER)
            sleep(number)
            return unpack_from(memory, ANSWER)

        return ask

    def answerer(self, layout: Layout) -> tuple[Callable[[], tuple[Any, ...]], Callable[..., None]]:
        """The submission's functions: one takes the next question, one gives its answer; `ChannelClosed` at the end."""
        memory, words, pack_into, unpack_from = self._memory, self._words, *_codecs(layout.answer, layout.question)
        ring, sleep, looks, number = self._ring, self._sleep, range(_LOOKS), 0

        def receive() -> tuple[Any, ...]:
            nonlocal number
            number += 1
            for _ in looks:
                if words[_ASKED] == number:
                    return unpack_from(memory, QUESTION)
            sleep(number)
            return unpack_from(memory, QUESTION)

        def send(*answer: Any) -> None:
            pack_into(memory, ANSWER, *answer)
            words[_ANSWERED] = number
            if words[_ASKED + 1]:
                ring()

        return receive, send

    def has_come_to(self, number: int) -> bool:
        """Whether the other side's counter is at `number`; so it is once the memory was let go of."""
        try:
            return bool(self._words[self._other] == number)
        except ValueError:
            return True

    def close(self) -> None:
        """Let go of the memory."""
        self._words.release()
        self._memory.close()  # a second time does nothing, for either

    def _ring(self) -> None:
        with suppress(BlockingIOError):  # it has been rung often enough
            os.eventfd_write(self._other_bell, 1)

    def _sleep(self, number: int) -> None:
        """Until the other side has come to `number`; `ChannelClosed` if it has ended before."""
        words, asleep = self._words, self._own + 1
        words[asleep] = 1
        try:
            while words[self._other] != number:
                for descriptor, _ in self._poll.poll(_SLEEP):
                    if descriptor == self._own_bell:
                        with suppress(BlockingIOError):
                            os.eventfd_read(descriptor)
                    elif words[self._other] != number:
                        raise ChannelClosed
        finally:
            words[asleep] = 0


def _codecs(out: struct.Struct, back: struct.Struct) -> tuple[Callable[..., None], Callable[..., tuple[Any, ...]]]:
    return out.pack_into, back.unpack_from
