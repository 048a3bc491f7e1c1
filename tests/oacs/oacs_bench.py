"""A module on a bench in bus time: no bus, no clock, no waiting."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from rds.bus.modules.oacs import codes as words
from rds.bus.modules.oacs import messages
from rds.bus.modules.oacs.messages import Decoded
from rds.bus.modules.oacs.module import OacsModule
from rds.bus.modules.oacs.module_data import read_modules
from rds.machines import load_machine

MACHINE = load_machine("mrmt-oacs")
START = 100.0  # s, bus time


class Bench:
    """One module in bus time: no bus, no clock, no waiting. `now` is the time, `heard` what the module said."""

    def __init__(self, name: str, **changes: Any):
        data = replace(read_modules(MACHINE)[name], **changes)
        slot = list(MACHINE.axes).index(name)
        self.module = OacsModule(MACHINE.axis(name), data, slot, MACHINE.sample_period, START, serial=77)
        self.now = START
        self.heard: list[tuple[float, Decoded]] = []

    def say(self, kind: str, **fields: Any) -> None:
        """A message to the module."""
        frame = messages.encode(kind, 0 if kind == "GeneralCall" else self.module.node, **fields)
        self.frame(frame.identifier, frame.data)

    def frame(self, identifier: int, data: bytes) -> None:
        """Any frame to the module."""
        self._note(self.module.receive(identifier, data, self.now))

    def move(self, move: words.Move, **fields: Any) -> None:
        """A move command."""
        self.say("Command", Code=words.Code.MOVE, Move=move, **fields)

    def run(self, seconds: float, alive: bool = True) -> None:
        """Let time pass; `alive`: the host says something now and then."""
        end = self.now + seconds
        while self.now < end:
            if alive:
                self.module.mover.heard = self.now
            expires = self.module.expires
            self.now = min(end, self.now + 0.05 if expires is None else max(expires, self.now + 1e-6))
            self._note(self.module.expire(self.now))

    def until_done(self, longest: float = 200.0) -> words.Result:
        """Let time pass until the motion has ended; its result."""
        end = self.now + longest
        while self.now < end:
            self.run(0.05)
            ends = [r for r in self.results() if r != words.Result.ACCEPTED]
            if ends and self.module.mover.motion is None:
                return ends[-1]
        raise AssertionError("the motion does not end")

    def results(self) -> list[words.Result]:
        """Of the acknowledgements so far."""
        return [words.Result(m.fields["Result"]) for m in self.said("Reply") if "Result" in m.fields]

    def said(self, kind: str) -> list[Decoded]:
        """Messages of a kind so far."""
        return [message for _, message in self.heard if message.kind == kind]

    def _note(self, out: list[messages.Frame]) -> None:
        for identifier, data, extended in out:
            if extended or messages.kind_of(identifier) is not None:
                self.heard.append((self.now, messages.decode(identifier, data, extended)))
