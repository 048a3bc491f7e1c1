"""The grader's side of a run: a question of fixed size out, an answer of fixed size back, in step."""

from __future__ import annotations

import os
from collections.abc import Callable
from math import isfinite
from typing import Any, NoReturn

from rds.grading.grade import Status
from rds.grading.sandbox import records
from rds.grading.sandbox.cell import Cell
from rds.grading.sandbox.output import printable
from rds.grading.sandbox.shared_channel import ChannelClosed, SharedChannel

LONGEST_REASON = 600  # characters of what a submission's error says

Sample = tuple[tuple[float, ...], tuple[float, ...]]
"""What was asked and what was answered."""


class Run:
    """A run of `what` (control, model, rows) with samples of `T` s, begun in `cell`. `k` is the next sample.

    With `through_memory` question and answer go through shared memory, else through the cell's pipes. A counted run's
    answers carry a `seal`.
    """

    def __init__(
        self, cell: Cell, what: str, layout: records.Layout, T: float, through_memory: bool = False, seal: int = 0
    ):
        self.cell, self.what, self.layout, self.T = cell, what, layout, T
        self.is_single = layout.answers == 1
        self.k = 0
        self.has_ended = False
        self._seal, self._ok = seal, records.OK ^ seal
        self._asked: list[tuple[float, ...]] = []
        self._answered: list[tuple[Any, ...]] = []
        self._shared: SharedChannel | None = None
        if through_memory:
            memory, question_bell, answer_bell = cell.shared
            self._shared = SharedChannel(memory, answer_bell, question_bell, cell.answers, asks=True)
            cell.signs.append(self._has_answer)
        self._exchange = self._shared.asker(layout) if self._shared else self._pipes()

    def ask(self, *values: float) -> tuple[Any, ...]:
        """Sample number, code, answer to `values`, all finite; SubmissionError if there is none, or to something else.

        Not cut, as this is done at every sample.
        """
        cell, k = self.cell, self.k
        if cell.is_closed:
            raise ValueError("this run has ended; begin another one")
        cell.turn += 1
        try:
            answer = self._exchange(k, values)
        except ChannelClosed:
            cell.fail()
        # a sum is finite only if all its parts are; the other way round it may only be too large
        if answer[0] != k or answer[1] != self._ok or not isfinite(sum(answer)):
            self._judge(answer[0], answer[1] ^ self._seal, all(map(isfinite, answer)))
        cell.turn += 1
        self.k = k + 1
        self._asked.append(values)
        self._answered.append(answer)
        return answer

    def _pipes(self) -> Callable[[int, tuple[float, ...]], tuple[Any, ...]]:
        cell, pack, answer = self.cell, self.layout.question.pack, self.layout.answer
        unpack, size = answer.unpack, answer.size
        questions, answers, write, read = cell.questions, cell.answers, os.write, os.read

        def exchange(k: int, values: tuple[float, ...]) -> tuple[Any, ...]:
            try:
                write(questions, pack(k, *values))
            except BrokenPipeError:
                raise ChannelClosed from None
            data = read(answers, size)
            return unpack(data if len(data) == size else cell.receive(size, data))

        return exchange

    def close(self) -> None:
        """Let go of the shared memory; what was recorded stays."""
        if self._shared is not None:
            self._shared.close()

    def _has_answer(self) -> bool:
        return self._shared is not None and self._shared.has_come_to(self.k + 1)

    def recorded(self, most: int | None = None) -> list[Sample]:
        """What was asked and answered so far, of the first `most` samples."""
        return [(asked, answer[2:]) for asked, answer in zip(self._asked[:most], self._answered[:most], strict=True)]

    def total(self) -> int:
        """After the last sample of a counted run: its events; -1 where the counter was found gone."""
        self.cell.turn += 1
        try:
            number, code, told, *_ = self._exchange(records.TOTAL, (0.0,) * self.layout.asks)
        except ChannelClosed:
            self.cell.fail()
        if number != records.TOTAL or code != self._ok or not isfinite(told):
            self.give_up("it wrote into the grader's pipe")
        self.cell.turn += 1
        return int(told)

    def _judge(self, number: int, code: int, is_finite: bool) -> None:
        if number == self.k and code == records.OK and is_finite:
            return
        if number == self.k and code == records.END and self.what == "rows" and is_finite:
            self.has_ended = True
        elif number == self.k and code == records.FAULT:
            answer = self.cell.frame()
            self.give_up(reason(answer.get("error") if isinstance(answer, dict) else None))
        elif number == self.k and code in (records.OK, records.END) and not is_finite:
            self.give_up(f"at t = {self.k * self.T:.3f} s it answered what is not finite")
        else:
            self.give_up("it wrote into the grader's pipe")

    def give_up(self, why: str) -> NoReturn:
        """SubmissionError: the submission has broken its contract."""
        self.cell.kill(Status.BROKE_CONTRACT, why)
        self.cell.fail()


def reason(said: object) -> str:
    """What came out of a sandbox as an error's text: one line that can be shown."""
    if not isinstance(said, str) or not said:
        return "it failed, and did not say why"
    text = " ".join(printable(said).split())
    return text if len(text) <= LONGEST_REASON else text[: LONGEST_REASON - 1] + "…"
