"""LinuxCNC's stand-alone interpreter, which the tests compare with where it is installed."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

from rds.nc import Dialect, ProgramError, interpret
from rds.nc.language.canon_text import text
from rds.nc.language.tools import read_tools

needs_rs274 = pytest.mark.skipif(shutil.which("rs274") is None, reason="rs274 (Debian's linuxcnc-uspace) is missing")

TOOLS = """\
T1 P1 Z0.511 D0.125 ;an end mill
T2 P2 X0.1 Y-0.2 Z0.25 A1.5 D0.25 ;a larger one
T7 P3 Z-0.3 D0.0625
"""  # inches: the machine of rs274 has them
END = ("ON_RESET()", "FINISH()")


def rs274(program: bytes, folder: Path | None = None, variables: str = "") -> tuple[list[str], str]:
    """The canonical calls that rs274 prints of a program, and its complaint ("" when it has none).

    `folder` is where it looks for subroutine files.
    """
    with tempfile.TemporaryDirectory() as place:
        home = Path(place)
        (home / "tool.tbl").write_text(TOOLS)
        (home / "p.var").write_text(variables)
        (home / "p.ngc").write_bytes(program)
        words = ["rs274", "-t", "tool.tbl", "-v", "p.var", "-n", "2", "-g", "p.ngc"]
        if folder is not None:
            words = [str(home / word) if "." in word else word for word in words]
        ran = subprocess.run(
            words, cwd=folder or home, env=os.environ | {"HOME": place}, capture_output=True, timeout=60, check=False
        )
    said = ran.stderr.decode("utf-8", "replace").removeprefix("executing\n").strip()
    printed = ran.stdout.decode("utf-8", "surrogateescape").splitlines()
    return printed, said or ("refused" if ran.returncode else "")


def ours(program: bytes | Path, variables: dict[int, float] | None = None) -> tuple[list[str], str]:
    """The same by our interpreter, on a machine in inches like that of rs274."""
    tools = Path(tempfile.mkdtemp()) / "tool.tbl"
    tools.write_text(TOOLS)
    try:
        table = read_tools(tools)
    finally:
        shutil.rmtree(tools.parent)
    source = program if isinstance(program, Path) else program.decode("utf-8", "surrogateescape")
    lines: list[str] = []
    try:
        items = interpret(
            source, tools=table, parameters=variables, options=Dialect(inch_machine=True, max_jumps=20000)
        )
        lines.extend(text(items))
    except ProgramError as error:
        return lines, str(error)
    return lines, ""


def calls(lines: list[str]) -> list[str]:
    """Without the numbers of the lines, the sign of a zero (that of a rounding), and what ends every run."""
    found = [re.sub(r"-(0\.0000)\b", r"\1", line[6:]) for line in lines]
    while found and found[-1].endswith(END):
        found.pop()
    return found


PROGRAMS = Path(__file__).parent / "programs"


def kept() -> list[Path]:
    """The programs whose canonical calls are kept beside them, as rs274 printed them."""
    return sorted(path for path in PROGRAMS.glob("*.ngc") if path.stem != "twice")


def keep() -> None:
    """Write the expected files anew: `python -c "from tests.nc.rs274 import keep; keep()"`."""
    for path in kept():
        printed, complaint = rs274(path.read_bytes(), PROGRAMS)
        assert not complaint, f"{path}: {complaint}"
        path.with_suffix(".canon").write_text("\n".join(printed) + "\n")
