"""A part program looked at while it is written: faults at their words, the path, the modes, the cycle time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from rds.core.errors import RdsError
from rds.machines import Machine
from rds.nc.active import Follower, Modes
from rds.nc.check import validator_of, watched
from rds.nc.cycle_time import CycleTime, cycle_time
from rds.nc.language.errors import ProgramError
from rds.nc.language.parameters import read_parameters
from rds.nc.language.rest_of_file import RestOfFile
from rds.nc.path_block import PathBlock
from rds.nc.run.prepare import least_seconds, require_room
from rds.nc.setup import Setup
from rds.nc.tool_centre import shown
from rds.nc.trace import Trace
from rds.nc.validation import Validation
from rds.panels.kit.field_names import in_fields
from rds.panels.program.stock import Cut, cut, shapes
from rds.panels.session.task import Task

_MOST_FAULTS = 50  # of a cut that are marked in the text


@dataclass(frozen=True)
class Mark:
    """What was found: at `line` (0: of the whole program) from `column` on (0: the line) over `length` characters."""

    line: int
    column: int
    length: int
    text: str
    kind: str = "error"  # or "warning"

    def to_json(self) -> dict[str, Any]:
        """As the editor takes it."""
        found = {name: getattr(self, name) for name in ("line", "column", "length", "kind")}
        return found | {"text": in_fields(self.text)}


@dataclass(frozen=True)
class CheckState:
    """What one look found. `cycle`, `trouble` (why it cannot be planned), `cut` and `uncut` (why there is none) are of
    valid programs.
    """

    marks: tuple[Mark, ...]
    validation: Validation | None = None
    trace: Trace = field(default_factory=Trace)
    modes: Mapping[int, Modes] = field(default_factory=dict)
    cycle: CycleTime | None = None
    trouble: str = ""
    cut: Cut | None = None
    uncut: str = ""

    @property
    def ok(self) -> bool:
        """Whether the machine can run it."""
        return self.validation is not None and self.validation.ok and not self.trouble

    @property
    def sentence(self) -> str:
        """The verdict in one line."""
        faults = [mark for mark in self.marks if mark.kind == "error"]
        if faults:
            more = self.validation.more if self.validation is not None else 0
            count, first = len(faults) + more, faults[0]
            place = f"line {first.line}: " if first.line else ""
            return f"{count} fault{'s' * (count > 1)}; {place}{first.text}"
        if self.trouble or self.validation is None:
            return self.trouble or "nothing to run"
        moves = self.validation.segments
        time = "its time is being planned" if self.cycle is None else f"{self.cycle.total:.2f} s"
        return f"the machine can run it: {moves} move{'s' * (moves != 1)}, {time}"


def look(
    task: Task[Any],
    source: Path,
    name: str,
    machine: Machine,
    setup: Setup,
    early: Callable[[CheckState], None] = lambda found: None,
    stock: str = "",
    part: Path | None = None,
) -> CheckState:
    """Read, follow, plan and cut the program in `source`, which is called `name` for whoever reads this.

    `stock` and `part` are those of `rds.panels.program.stock.cut`. `early` gets what was found before planning and
    before the cut, which take longer. Writes nothing. Raises Stopped when it should end; faults are marks and never
    raised.
    """
    try:
        tools = setup.tool_list()
        parameters = read_parameters(setup.parameters) if setup.parameters else None
    except RdsError as error:
        return CheckState((Mark(0, 0, 0, str(error)),))
    setup = setup.on(machine, source)
    label = str(source)
    try:
        validator, trace = validator_of(source, machine, setup), Trace()
    except ProgramError as error:  # a configuration script of another machine
        return CheckState((Mark(error.line, 0, 0, error.reason),))
    try:
        follower = Follower(
            source,
            tools=tools,
            parameters=parameters,
            options=setup.options,
            name=label,
            remark=validator.warn,
            between=lambda: task.advance(0.0, 0.0, "checking"),
        )
    except ProgramError as error:
        return CheckState((Mark(0, 0, 0, error.reason),))
    kept: list[PathBlock] = []
    try:
        for block in validator.watch(watched(follower.run(), validator, setup, validator.report)):
            trace.add(shown(block.segments, validator.machine))
            kept.append(block)
    finally:
        follower.close()
    if validator.stopped is not None:
        later = RestOfFile(validator.stopped, setup.options)
        for fault in later.faults():
            validator.report(fault)
        validator.read_on = later.some
    result = validator.result()
    marks = tuple(_marks(result, label))
    if not result.ok:
        return CheckState(marks, result, trace, follower.modes)
    try:
        task.note = "planning"
        require_room(least_seconds(kept), machine, machine.sample_period, Path(name))
        early(CheckState(marks, result, trace, follower.modes))
        cycle = cycle_time(_divided(kept, task), machine)
        cycle.certificate.require(name)
    except RdsError as error:
        return CheckState(marks, result, trace, follower.modes, trouble=str(error).replace(label, name))
    found = CheckState(marks, result, trace, follower.modes, cycle)
    early(found)
    task.note = "cutting"
    try:
        made = cut(kept, follower.modes, shapes(setup.tools), stock, part, lambda: task.advance(0.0, 0.0))
    except RdsError as error:
        return replace(found, uncut=str(error))
    return found if made is None else replace(found, cut=made, marks=(*marks, *_cut_marks(made)))


def _cut_marks(made: Cut) -> Iterator[Mark]:
    for fault in made.faults[:_MOST_FAULTS]:
        yield Mark(fault.line, 0, 0, str(fault).partition(": ")[2], "warning")


def _divided(blocks: Iterable[PathBlock], task: Task[Any]) -> Iterator[PathBlock]:
    for block in blocks:
        task.advance(0.0, 0.0)
        yield block


def _marks(result: Validation, label: str) -> Iterator[Mark]:
    for kind, found in (("error", result.faults), ("warning", result.warnings)):
        for fault in found:
            text = f"{fault.word}: {fault.reason}" if fault.word else fault.reason
            if fault.file == label:
                yield Mark(fault.line, fault.column, len(fault.word), text, kind)
            else:  # of a subroutine's file
                yield Mark(0, 0, 0, f"{Path(fault.file).name}:{fault.line}: {text}", kind)
