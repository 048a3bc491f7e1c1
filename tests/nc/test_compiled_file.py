"""The compiled form of a program: whole, of just this program, or not used."""

from __future__ import annotations

import io
import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.machines import load_machine
from rds.nc.check import check_program, compiled_if_current, describe, motion, sources
from rds.nc.compiled_file import _SEAL, MAGIC, open_compiled, write_compiled
from rds.nc.language.dialect import Dialect
from rds.nc.path_block import PathBlock
from rds.nc.run.prepare import compiled_form
from rds.nc.setup import Setup
from rds.nc.toolpath import toolpath

PROGRAM = """G21 G90
T1 M6
S500 M3 M8
F120
G0 X10
G1 Y20
G3 X10 Y20 Z-1 I-5 J0
G4 P0.5
O<drill> CALL [3]
M2
"""
DRILL = "O<drill> SUB\nG1 Z#1\nO<drill> ENDSUB\n"
MACHINE = load_machine("mini-cnc")


@pytest.fixture
def part(tmp_path: Path) -> Path:
    (tmp_path / "part.ngc").write_text(PROGRAM, encoding="utf-8")
    (tmp_path / "drill.ngc").write_text(DRILL, encoding="utf-8")
    (tmp_path / "tools.tbl").write_text("T1 P1 Z10\n", encoding="utf-8")
    return tmp_path / "part.ngc"


def setup(part: Path) -> Setup:
    return Setup(tools=part.with_name("tools.tbl"))


def compile_it(part: Path) -> Path:
    result, compiled = check_program(part, MACHINE, setup(part))
    assert compiled is not None, str(result)
    return compiled


def test_what_is_read_back_is_the_motion(part: Path) -> None:
    compiled = compile_it(part)
    assert compiled == part.with_suffix(".dat")
    found = list(open_compiled(compiled).blocks())
    made = list(toolpath(setup(part).interpret(part)))
    assert len(found) == len(made) > 2
    for one, other in zip(found, made, strict=True):
        assert np.array_equal(one.segments, other.segments)
        assert np.array_equal(one.feed_lines, other.feed_lines)
        assert (one.events, one.file, one.tool) == (other.events, other.file, other.tool)
    trailer = open_compiled(compiled).trailer
    assert trailer["segments"] == sum(map(len, made)) and trailer["blocks"] == len(made)


def test_the_same_program_makes_the_same_bytes(part: Path) -> None:
    first = compile_it(part).read_bytes()
    assert compile_it(part).read_bytes() == first
    assert first.startswith(MAGIC)


def test_an_invalid_program_leaves_none_and_takes_the_old_one_away(part: Path) -> None:
    compiled = compile_it(part)
    part.write_text(PROGRAM.replace("X10", "X100"), encoding="utf-8")
    result, path = check_program(part, MACHINE, setup(part))
    assert not result.ok and path is None
    assert not compiled.exists()
    assert sorted(path.name for path in part.parent.iterdir()) == ["drill.ngc", "part.ngc", "tools.tbl"]


@pytest.mark.parametrize("what", ["program", "subroutine", "tools", "machine", "options"])
def test_it_is_used_only_for_what_it_was_made_of(part: Path, tmp_path: Path, what: str) -> None:
    compile_it(part)
    machine, how = MACHINE, setup(part)
    assert compiled_if_current(part, machine, how) is not None
    if what == "machine":
        other = tmp_path / "other.toml"
        other.write_text(Path(MACHINE.path).read_text(encoding="utf-8") + "\n", encoding="utf-8")
        machine = load_machine(str(other))
    elif what == "options":
        how = replace(how, options=Dialect(block_delete=True))
    else:
        name = {"program": "part.ngc", "subroutine": "drill.ngc", "tools": "tools.tbl"}[what]
        path = part.with_name(name)
        path.write_text(path.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    assert compiled_if_current(part, machine, how) is None


def forged(part: Path) -> bytes:
    """A compiled form that says it is this program's, and is another's: made as anybody can who knows the format."""
    wanted = describe(part, MACHINE, setup(part))
    honest = part.read_text(encoding="utf-8")
    part.write_text(honest.replace("X10 Y20 Z-1", "X10 Y20 Z-9"), encoding="utf-8")
    blocks = list(open_compiled(compile_it(part)).blocks())
    part.write_text(honest, encoding="utf-8")
    stream = io.BytesIO()
    write_compiled(wanted, blocks, dict)(stream)
    return stream.getvalue()


def lowest(blocks: Iterable[PathBlock]) -> float:
    return float(min(block.segments["end"][:, 2].min(initial=0.0) for block in blocks))


def test_a_forged_one_beside_an_honest_program_is_not_used(part: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as elsewhere:
        elsewhere.setenv("XDG_STATE_HOME", str(part.parent / "of_another_user"))
        data = forged(part)
    place = part.with_suffix(".dat")
    place.write_bytes(data)
    assert lowest(open_compiled(place).blocks()) == -9.0 and not open_compiled(place).is_own
    assert compiled_if_current(part, MACHINE, setup(part)) is None
    assert lowest(motion(part, MACHINE, setup(part))) == -1.0  # that is what `rds grade` plans
    assert (
        lowest(compiled_form(part, MACHINE, setup(part)).blocks()) == -1.0 and open_compiled(place).is_own
    )  # made anew


def test_a_program_in_a_folder_for_reading_alone_is_compiled_for_as_long_as_it_is_in_use(
    part: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)
    form = compiled_form(part, MACHINE, setup(part))
    assert form.path.parent != part.parent and list(form.blocks()) and not part.with_suffix(".dat").exists()
    place = form.path.parent
    del form
    assert not place.exists()


def test_what_changes_while_it_is_read_is_not_compiled(part: Path) -> None:
    drill = part.with_name("drill.ngc")
    with pytest.raises(InputError, match=r"part\.ngc: changed while it was read"):
        check_program(part, MACHINE, setup(part), lambda *_: drill.write_text(f"{DRILL}(deeper)\n") and None)
    assert not part.with_suffix(".dat").exists()


def test_a_file_of_someone_else_is_neither_overwritten_nor_removed(part: Path) -> None:
    data = part.with_suffix(".dat")
    data.write_text("1 2 3\n", encoding="utf-8")
    for text in (PROGRAM, PROGRAM + "G999"):
        part.write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=r"part\.dat.*rename or move it"):
            check_program(part, MACHINE, setup(part))
    assert data.read_text(encoding="utf-8") == "1 2 3\n"
    assert compiled_if_current(part, MACHINE, setup(part)) is None


def test_a_folder_where_the_compiled_form_would_be_is_none(part: Path) -> None:
    part.with_suffix(".dat").mkdir()
    with pytest.raises(InputError, match=r"part\.dat.*rename or move it"):
        check_program(part, MACHINE, setup(part))


def test_a_program_may_not_bear_the_name_of_the_compiled_form(part: Path) -> None:
    program = part.rename(part.with_suffix(".DAT"))
    with pytest.raises(InputError, match=r"rename the program"):
        check_program(program, MACHINE, setup(part))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(at=st.floats(0, 1), change=st.integers(1, 255), cut=st.booleans())
def test_damage_is_noticed(part: Path, at: float, change: int, cut: bool) -> None:
    compiled = part.with_suffix(".dat")
    if not compiled.exists():
        compile_it(part)
        compiled.with_suffix(".good").write_bytes(compiled.read_bytes())
    good = compiled.with_suffix(".good").read_bytes()
    place = min(int(at * len(good)), len(good) - 1)
    bad = good[:place] if cut else good[:place] + bytes([good[place] ^ change]) + good[place + 1 :]
    compiled.write_bytes(bad)
    if cut or not -_SEAL - 1 <= place - len(good) < -1:  # else nobody knows who has made it, and it is whole
        with pytest.raises(InputError, match=r"compile it again"):
            open_compiled(compiled)
    assert compiled_if_current(part, MACHINE, setup(part)) is None
    compiled.write_bytes(good)
    assert compiled_if_current(part, MACHINE, setup(part)) is not None


def test_sources_are_the_files_that_may_be_called(tmp_path: Path) -> None:
    program = tmp_path / "part.ngc"
    program.write_text("o <A> call\nN5O200CALL [1]\nO3 IF [1]\nM2\n", encoding="utf-8")
    (tmp_path / "a.ngc").write_text("O<b> CALL", encoding="utf-8")
    for name in ("b", "200", "3", "c"):
        (tmp_path / f"{name}.ngc").write_text("", encoding="utf-8")
    assert {path.name for path in sources(program)} == {"part.ngc", "a.ngc", "b.ngc", "200.ngc", "3.ngc"}


@pytest.mark.parametrize(
    "text, called",
    [
        ("M98 P1000", {"1000"}),
        ("N10 m 098 L2 P 1 000 (twice)", {"1000"}),
        ("O0200 CALL", {"200"}),
        ("O< my  part > CALL", {"mypart"}),
        ("O#1 CALL", {"200", "1000"}),  # whichever of the numbered ones
        ("M98 P[#1 + 1]", {"200", "1000"}),
        ("M3 (speed 1000) X8 Y9", set()),
    ],
)
def test_sources_are_found_as_the_control_finds_them(tmp_path: Path, text: str, called: set[str]) -> None:
    program = tmp_path / "part.ngc"
    program.write_text(f"{text}\nM2\n", encoding="utf-8")
    for name in ("200", "1000", "mypart", "8"):
        (tmp_path / f"{name}.ngc").write_text("", encoding="utf-8")
    found = {path.stem for path in sources(program)} - {"part"}
    assert found == (called | {"8"} if len(called) > 1 else called)


def test_the_last_line_may_name_all_tools_of_a_table(tmp_path: Path) -> None:
    part, table = tmp_path / "part.ngc", tmp_path / "tools.tbl"
    table.write_text("".join(f"T{99000 + k} P{k}\n" for k in range(1, 1001)), encoding="utf-8")
    part.write_text("".join(f"T{99000 + k} M6\n" for k in range(1, 1001)) + "G0 X1\nM2\n", encoding="utf-8")
    how = Setup(tools=table)
    assert check_program(part, MACHINE, how)[0].ok
    found = compiled_if_current(part, MACHINE, how)
    assert found is not None and len(found.trailer["tools"]) == 1000
