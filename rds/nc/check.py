"""From a part program's file to its verdict and its compiled form, and back from that when nothing has changed."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any

from rds.core.atomic import write_files
from rds.core.errors import InputError
from rds.core.installed import version
from rds.core.progress import Progress
from rds.machines import Machine
from rds.nc.compiled_file import Compiled, beside, file_sha256, is_ours, open_compiled, write_compiled
from rds.nc.configuration import configured
from rds.nc.language.canon import Call, MotionBlock
from rds.nc.language.errors import ProgramError
from rds.nc.language.rest_of_file import RestOfFile, faults_never_run
from rds.nc.lathe_words import meant_otherwise
from rds.nc.passed_over import Report
from rds.nc.path_block import PathBlock
from rds.nc.setup import Setup
from rds.nc.tool_centre import ToolCentre
from rds.nc.toolpath import raise_it, toolpath
from rds.nc.validate import Validator
from rds.nc.validation import Validation

Item = MotionBlock | Call
_MOST_NOTES, _LONGEST_NOTE = 5, 300  # of a program, characters: they stand in the last line of the compiled form
_LARGEST_READ_TWICE = 4 << 20  # bytes; larger programs are made by machines, and their subroutines are called
_LONGEST_NAME = 200  # bytes, of a subroutine that may have a file
_BLANKS = b" \t\r"  # which say nothing, even within a name or a number
_CALLS = re.compile(  # by O words, GR and M98 P: a name, a number, or what begins one that is worked out
    rb"(?:o|gr|m[ \t\r0]*9[ \t\r]*8[^\n(;p]*p)[ \t\r]*(?:<([^>\n]+)>|(\d[\d \t\r]*)|([#\[]))", re.IGNORECASE
)


def motion(
    program: Path,
    machine: Machine,
    setup: Setup,
    progress: Progress | None = None,
    notes: list[str] | None = None,
) -> Iterator[PathBlock]:
    """The machine's motion for a program, checked as it comes: raises ProgramError at the first fault.

    `notes`, when given, gets at the end what is no fault and worth a look, by line.
    """
    setup = setup.on(machine, program)
    validator = validator_of(program, machine, setup)
    for block in watched(
        followed(setup.interpret(program, validator.warn), program, progress), validator, setup, raise_it
    ):
        validator.look(block)
        if not validator.ok:
            raise validator.result().faults[0]
        yield block
    if notes is not None:
        notes += notes_of(validator.result())


def watched(items: Iterable[Item], validator: Validator, setup: Setup, report: Report) -> Iterator[PathBlock]:
    """The motion of canonical calls on the validator's machine; it hears of what is assumed and hardly meant."""
    return toolpath(
        items,
        report=report,
        warn=validator.warn_of_spindle,
        default_feed=validator.default_feed if setup.options.default_feed else None,
        assume=validator.warn_of_feed,
        tool_centre=_tool_centre(validator.machine, setup),
    )


def _tool_centre(machine: Machine, setup: Setup) -> ToolCentre | InputError | None:
    """What moves for the tip go through; the InputError of a machine that has none, raised if it is to be corrected."""
    if not (setup.correct or setup.options.tcp):
        return None
    try:
        return ToolCentre(machine, setup.correct)
    except InputError as error:
        if setup.correct:
            raise
        return error


def notes_of(validation: Validation) -> list[str]:
    """The warnings of a valid program as sentences, the first few: what a reader of its run should know."""
    return [f"line {found.line}: {found.reason}"[:_LONGEST_NOTE] for found in validation.warnings[:_MOST_NOTES]]


def check_program(
    program: Path, machine: Machine, setup: Setup, progress: Progress | None = None, place: Path | None = None
) -> tuple[Validation, Path | None]:
    """Whether a machine can run a program: all faults, and the compiled form that a valid one leaves at `place`.

    The default is beside the program. A program with faults leaves none, and one of before is removed. Raises
    InputError for files that cannot be read or written, or change while they are read, and where the place of the
    compiled form is taken by a file that is none.
    """
    setup = setup.on(machine, program)
    header = describe(program, machine, setup)
    place = place or beside(program)
    if place.exists() and not is_ours(place):
        raise InputError("is no compiled program, and one would be written here; rename or move it", str(place))
    validator = validator_of(program, machine, setup)
    items = followed(setup.interpret(program, validator.warn), program, progress)
    blocks = validator.watch(watched(items, validator, setup, validator.report))
    if program.stat().st_size <= _LARGEST_READ_TWICE:
        for fault in faults_never_run(program, setup.options):
            validator.warn(in_dead_code(fault))

    def at_the_end() -> dict[str, Any]:
        if describe(program, machine, setup) != header:
            raise InputError("changed while it was read; check it again when it is saved", str(program))
        return _summary(validator)

    try:
        write_files({place: write_compiled(header, _while_valid(blocks, validator), at_the_end)})
    except _Faulty:
        for _ in blocks:  # the rest is looked at all the same
            pass
        if validator.stopped is not None:
            later = RestOfFile(validator.stopped, setup.options)
            for fault in later.faults():
                validator.report(fault, f"{fault.column}: {fault.reason}")
            validator.read_on = later.some
        place.unlink(missing_ok=True)
        return validator.result(), None
    return validator.result(), place


def in_dead_code(fault: ProgramError) -> ProgramError:
    said = f"{fault.reason} (in a subroutine that nothing calls)"
    return ProgramError(said, file=fault.file, line=fault.line, column=fault.column, word=fault.word)


def validator_of(program: Path, machine: Machine, setup: Setup) -> Validator:
    """What looks at the program, for the machine as limits and script leave it. ProgramError for another chain."""
    own, remarks = configured(program, machine, setup.options)
    validator = Validator(own, setup.tool_list(), str(program))
    for remark in remarks:
        validator.warn(remark)
    if "Y" not in own.axes and program.stat().st_size <= _LARGEST_READ_TWICE:
        with program.open(encoding="latin-1") as lines:
            for line, word, said in meant_otherwise(lines):
                validator.warn(ProgramError(said, file=str(program), line=line), word)
    return validator


class _Faulty(Exception):
    """A fault was found: nothing is written."""


def _while_valid(blocks: Iterable[PathBlock], validator: Validator) -> Iterator[PathBlock]:
    for block in blocks:
        if not validator.ok:
            raise _Faulty
        yield block
    if not validator.ok:
        raise _Faulty


def _summary(validator: Validator) -> dict[str, Any]:
    result = validator.result()
    about = {"cutting_mm": result.cutting, "rapid_mm": result.rapid, "tools": list(result.tools)}
    return about | {"notes": notes_of(result)}


def compiled_if_current(program: Path, machine: Machine, setup: Setup) -> Compiled | None:
    """The compiled form beside a program, if this user's rds made it of just this program, machine, tools and options.

    None where there is none, or it is of something else or somebody else, or damaged. Raises InputError when the
    program can't be read.
    """
    wanted = describe(program, machine, setup)
    try:
        found = open_compiled(beside(program))
    except InputError:
        return None
    return found if found.is_own and dict(found.header) == wanted else None


def describe(program: Path, machine: Machine, setup: Setup) -> dict[str, Any]:
    """Everything that the motion depends on, with its SHA-256: the header of the compiled form."""
    setup = setup.on(machine, program)
    return {
        "rds": version(),
        "program": program.name,
        "sources": {path.name: file_sha256(path) for path in sources(program)},
        "machine": machine.name,
        "machine_sha256": file_sha256(Path(machine.path)),
        "tools_sha256": file_sha256(setup.tools) if setup.tools else None,
        "parameters_sha256": file_sha256(setup.parameters) if setup.parameters else None,
        "options": setup.options._asdict(),
        "correct": setup.correct,
    }


def sources(program: Path) -> list[Path]:
    """A program's file and the files beside it of subroutines that it may call: name.ngc for O<name> CALL, 100.ngc for
    O100 CALL and M98 P100; all with a number for a name where that is worked out, as in O#1 CALL.
    """
    found: dict[Path, None] = {}
    waiting = [program]
    while waiting:
        path = waiting.pop()
        found[path] = None
        for name in _called(path):
            other = program.parent / f"{name}.ngc"
            if other not in found and other.is_file():
                waiting.append(other)
    return list(found)


def _called(path: Path) -> set[str]:
    try:
        with path.open("rb") as stream:
            if not stream.seek(0, 2):
                return set()
            with mmap(stream.fileno(), 0, access=ACCESS_READ) as text:
                found = {match.groups() for match in _CALLS.finditer(text)}
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror}); check the path", str(path)) from error
    given = {name.translate(None, _BLANKS).decode("utf-8", "replace") for name, _, _ in found if name}
    wanted = given | {name.lower() for name in given}
    wanted |= {(number.translate(None, _BLANKS).lstrip(b"0") or b"0").decode() for _, number, _ in found if number}
    if any(worked_out for *_, worked_out in found):
        wanted |= {beside.stem for beside in path.parent.glob("*.ngc") if re.fullmatch("-?[0-9]+", beside.stem)}
    return {name for name in wanted if "/" not in name and name.isprintable() and len(name.encode()) <= _LONGEST_NAME}


def followed(items: Iterable[Item], program: Path, progress: Progress | None) -> Iterator[Item]:
    """The same items; `progress` hears how many of the program's lines have been read, and of how many."""
    if progress is None:
        yield from items
        return
    try:
        with program.open("rb") as stream:
            lines = sum(chunk.count(b"\n") for chunk in iter(lambda: stream.read(1 << 20), b""))
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror}); check the path", str(program)) from error
    seen = 0
    for item in items:
        line = int(item.rows["line"][-1]) if isinstance(item, MotionBlock) and len(item) else getattr(item, "line", 0)
        if line > seen + lines // 200:
            seen = line
            progress(min(seen, lines), lines)
        yield item
