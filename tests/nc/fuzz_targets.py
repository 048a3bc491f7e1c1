"""What fuzzing feeds with bytes: programs (both ways of reading them), tool tables, parameter files.

Each target raises for anything but a result or a ProgramError with a place that exists and a message. `fuzz.py` drives
them by coverage, `test_fuzz.py` by hypothesis and by what was found before (`fuzz_cases/`).
"""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

from rds.nc import Dialect, ProgramError
from rds.nc.language import canon, canon_text
from rds.nc.language.fast_lane import NEVER, kernel
from rds.nc.language.interpreter import Interpreter
from rds.nc.language.parameters import COUNT, read_parameters
from rds.nc.language.state import State
from rds.nc.language.tools import Tool, read_tools

NAME = "p.ngc"
TOOLS = (Tool(1, 1, 3.0), Tool(2, 2, 6.0, (0.0, 0.0, 10.0, 0.0, 0.0, 0.0)), Tool(9, 3, -2.0))
DIALECTS = (
    Dialect(max_jumps=100),
    Dialect(block_delete=True, gr=True, max_jumps=100),
    Dialect(program_numbers=True, max_jumps=100),
    Dialect(inch_machine=True, any_exit=True, max_jumps=100),
)


def outcome(program: bytes, wait: int, options: Dialect = DIALECTS[0]) -> dict[str, Any]:
    """Everything that can be told apart after a run; rows as the bytes that they are made of.

    `wait`: 0, and each line is offered to the fast lane; NEVER, and none is.
    """
    if not wait:
        kernel()  # a program of this length would not wait for the compiler
    interpreter = Interpreter(io.BytesIO(program), name=NAME, options=options, tools=TOOLS)
    interpreter.lane.wait = NEVER if options.program_numbers else wait
    items: list[Any] = []
    fault: ProgramError | None = None
    names = canon.MOTION.names or ()
    try:
        with patch("rds.nc.language.fast_lane.LONGEST_PAUSE", 0):
            for item in interpreter.run():
                if isinstance(item, canon.Call):
                    items.append(item)
                else:
                    assert 0 < len(item) <= canon.BLOCK_ROWS
                    items += [(item.file, *(row[name].tobytes() for name in names)) for row in item.rows]
    except ProgramError as error:
        fault = error
    state = interpreter.context.state
    left = {name: repr(getattr(state, name)) for name in State.__slots__}
    said = fault and (str(fault), fault.line, fault.column, fault.word)
    return {"items": items, "fault": fault, "said": said, "state": left, "line": interpreter.control.source.line}


def same(program: bytes, options: Dialect = DIALECTS[0]) -> dict[str, Any]:
    """Assert that both ways give the same; return it."""
    fast, usual = outcome(program, 0, options), outcome(program, NEVER, options)
    fast_fault, usual["fault"] = usual["fault"], fast["fault"]
    assert fast == usual, (fast_fault, fast["fault"])
    return fast


def check_fault(fault: ProgramError, file: str, lines: list[bytes]) -> None:
    """The place exists, and there is something to read."""
    assert fault.file == file
    assert fault.reason.strip()
    assert str(fault).encode()
    assert fault.line <= max(len(lines), 1)
    if fault.column:
        assert fault.line >= 1
        text = lines[fault.line - 1].decode("utf-8", "replace") if lines else ""
        assert 1 <= fault.column <= len(text) + 1, (fault.column, text)


def program(data: bytes) -> None:
    """The first byte chooses options; the rest is the program."""
    options = DIALECTS[(data[0] if data else 0) % len(DIALECTS)]
    found = same(data[1:], options)
    if found["fault"]:
        check_fault(found["fault"], NAME, data[1:].split(b"\n"))
    elif len(found["items"]) < 1000:
        calls = [item for item in found["items"] if isinstance(item, canon.Call)]
        for line in canon_text.text(calls):  # a line of (PRINT, ) is empty
            line.encode("utf-8", "surrogateescape")


def _file(data: bytes, read: Callable[[Path], Any]) -> Any:
    with tempfile.NamedTemporaryFile(suffix=".txt") as file:
        file.write(data)
        file.flush()
        try:
            return read(Path(file.name))
        except ProgramError as fault:
            check_fault(fault, file.name, data.split(b"\n"))
    return None


def tool_table(data: bytes) -> None:
    """Any bytes as a tool table."""
    for tool in _file(data, read_tools) or ():
        assert tool.number >= 1
        assert all(abs(value) <= 1e9 for value in (tool.diameter, *tool.offset))


def parameter_file(data: bytes) -> None:
    """Any bytes as a parameter file; a program starts with what it holds."""
    values = _file(data, read_parameters)
    if values is not None:
        assert all(1 <= number < COUNT and value - value == 0.0 for number, value in values.items())
        try:
            list(Interpreter("G0 X1\nG28\nG54\nG55 X1\nG92.3\nM2\n", parameters=values).run())
        except ProgramError as fault:
            assert fault.reason


TARGETS: dict[str, Callable[[bytes], None]] = {
    "program": program,
    "tool_table": tool_table,
    "parameter_file": parameter_file,
}
