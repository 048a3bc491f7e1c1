"""A program step by step: each line as it is executed, with the words in force after it and where the tool then is.

Nothing moves here: it is for finding a fault in a program, and tells of lines that move nothing, too. A run that rests
after each line that moves is another thing, a live value of its motion (`rds.modes.loop.program.SINGLE_STEP`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from rds.nc.active import Follower, Modes
from rds.nc.language.context import INCH
from rds.nc.language.dialect import Dialect
from rds.nc.language.errors import ProgramError
from rds.nc.language.fast_lane import NEVER
from rds.nc.language.tools import Tool

_SHOWN = 200  # characters of a line
_LOOKED_AT = 5000  # numbered parameters: those above follow the machine


@dataclass(frozen=True)
class Step:
    """A line that has been executed. `position`: X Y Z A B C in work coordinates and in the unit in force; `depth`:
    subroutine calls around it; `changed`: parameters that it gave another value (`#5`, `#<name>`); `skipped`: it was
    passed over by a branch, a loop or a definition."""

    file: str
    line: int
    text: str
    modes: Modes
    position: tuple[float, ...]
    depth: int
    changed: Mapping[str, float]
    skipped: bool = False

    @property
    def machine_position(self) -> tuple[float, float, float]:
        """X Y Z in machine coordinates, mm."""
        unit = INCH if "G20" in self.modes.words else 1.0
        return self.modes.machine(*(unit * value for value in self.position[:3]))

    def __str__(self) -> str:
        place = " ".join(f"{axis}{value:.4f}" for axis, value in zip("XYZ", self.position, strict=False))
        values = "".join(f" {name} = {value:g}" for name, value in self.changed.items())
        words = " ".join(self.modes.words)
        feed, speed = f" F{self.modes.feed:g}", f" S{self.modes.speed:g}"
        return f"{self.line:>5}  {self.text}\n       {place}  [{words} T{self.modes.tool}{feed}{speed}]{values}"


def steps(
    source: str | Path | IO[Any],
    *,
    tools: Path | Iterable[Tool] | None = None,
    parameters: Path | Mapping[int, float] | None = None,
    options: Dialect = Dialect(),  # noqa: B008 (frozen)
) -> Iterator[Step]:
    """The lines of a program in the order in which they are executed; arguments as those of `interpret`.

    Lines that are passed over come once, as skipped. Raises ProgramError at the first fault, after the steps before it.
    """
    stepper = _Stepper(source, tools=tools, parameters=parameters, options=options)
    try:
        for _ in stepper.run():
            yield from stepper.taken()
    except ProgramError:
        yield from stepper.taken()
        raise
    finally:
        stepper.close()
    yield from stepper.taken()


class _Stepper(Follower):
    def __init__(self, *given: Any, **options: Any):
        super().__init__(*given, **options)
        self.lane.wait = NEVER  # each line comes by itself
        self._steps: list[Step] = []
        self._numbers = self.context.parameters.numbers[:_LOOKED_AT]  # as the line before left them
        self._globals: dict[str, float] = {}
        self._locals: list[dict[str, float]] = []  # of each call within another, the program's first

    def taken(self) -> list[Step]:
        """The steps since the last call."""
        found, self._steps = self._steps, []
        return found

    def _line(self, raw: bytes) -> bool:
        source, skipping = self.control.source, bool(self.control.skipping)
        file, line = source.name, source.line
        ended = super()._line(raw)
        state = self.context.state
        text = raw.decode("utf-8", "replace").strip()[:_SHOWN]
        skipped = skipping and bool(self.control.skipping)
        position, depth = tuple(float(value) for value in state.position()), self.control.depth
        self._steps.append(Step(file, line, text, self._modes(state), position, depth, self._changed(), skipped))
        return ended

    def _changed(self) -> dict[str, float]:
        """Parameters whose values are others than after the line before; not those that follow the position."""
        parameters = self.context.parameters
        numbers, depth = parameters.numbers[:_LOOKED_AT], len(parameters.locals) - 1
        pairs = enumerate(zip(numbers, self._numbers, strict=True))
        changed = {f"#{k}": now for k, (now, before) in pairs if now != before}
        own = self._locals[depth] if depth < len(self._locals) else {}
        for names, known in ((parameters.globals, self._globals), (parameters.locals[-1], own)):
            changed |= {f"#<{name}>": value for name, value in names.items() if known.get(name) != value}
        self._numbers, self._globals = numbers, parameters.globals.copy()
        self._locals[depth:] = [parameters.locals[-1].copy()]  # those of calls that have ended are forgotten
        return changed
