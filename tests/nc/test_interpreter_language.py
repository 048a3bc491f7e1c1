"""The language by itself: expressions, parameters, options, sources, blocks of results."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.nc import Dialect, ProgramError, interpret
from rds.nc.language.blocks import G_GROUPS, M_GROUPS
from rds.nc.language.canon import ARC, BLOCK_ROWS, FEED, RATE, TRAVERSE, Call, MotionBlock
from rds.nc.language.canon_text import text
from rds.nc.language.interpreter import Interpreter
from rds.nc.language.tools import Tool

numbers = st.floats(-1e6, 1e6).map(lambda value: round(value, 4))


def items(program: str, **options: bool | int) -> list[MotionBlock | Call]:
    return list(interpret(program, options=Dialect(**options)))  # type: ignore[arg-type]


def rows(program: str, **options: bool | int) -> np.ndarray:
    return np.concatenate([item.rows for item in items(program, **options) if isinstance(item, MotionBlock)])


def x_of(program: str) -> float:
    """Where X stands at the end."""
    found = rows(f"{program}\nM2")
    return float(found[found["kind"] == TRAVERSE]["values"][-1, 0])


def spelled(value: float) -> str:
    return f"{value:.4f}"


@given(numbers)
def test_a_number_is_read_to_its_last_bit(value: float) -> None:
    assert x_of(f"G0 X{spelled(value)}") == float(spelled(value))


@given(numbers, numbers, numbers)
def test_expressions_follow_precedence_and_go_from_left_to_right(a: float, b: float, c: float) -> None:
    x, y, z = (f"[{spelled(value)}]" for value in (a, b, c))
    assert x_of(f"G0 X[{x}-{y}*{z}-{x}]") == a - b * c - a
    assert x_of(f"G0 X[[{x}-{y}]*{z} GT {x} AND {y} LE {z}]") == float((a - b) * c > a and b <= c)


@given(st.floats(-720, 720))
def test_angles_are_in_degrees(angle: float) -> None:
    assert x_of(f"G0 XSIN[{angle:.6f}]") == pytest.approx(math.sin(math.radians(float(f"{angle:.6f}"))), abs=1e-14)
    assert (
        x_of(f"G0 XATAN[SIN[{angle:.6f}]]/[COS[{angle:.6f}]]")
        == pytest.approx(
            math.degrees(math.atan2(math.sin(math.radians(angle)), math.cos(math.radians(angle)))), abs=1e-5
        )
        or abs(abs(angle) % 360 - 180) < 1e-4
    )


@given(st.lists(st.tuples(st.sampled_from("XYZABC"), numbers), min_size=1, max_size=40), st.booleans())
def test_incremental_moves_add_up(moves: list[tuple[str, float]], feed: bool) -> None:
    words = [f"{axis}{spelled(way)}" for axis, way in moves]
    found = rows("\n".join(["G91 F100", f"{'G1' if feed else 'G0'} {words[0]}", *words[1:], "M2"]))
    position = dict.fromkeys("XYZABC", 0.0)
    straight = found[found["kind"] == (FEED if feed else TRAVERSE)]
    for (axis, way), row in zip(moves, straight, strict=True):
        position[axis] += float(spelled(way))
        assert row["values"][:6].tolist() == list(position.values())


@given(
    st.floats(0.1, 500),
    st.floats(0, 2 * math.pi),
    st.floats(0.01, 2 * math.pi - 0.01),
    st.integers(1, 4),
    st.booleans(),
)
def test_an_arc_by_its_radius_has_the_centre_of_the_same_arc_by_its_centre(
    radius: float, begin: float, sweep: float, turns: int, clockwise: bool
) -> None:
    end = begin - sweep if clockwise else begin + sweep
    x1, y1 = radius * math.cos(begin), radius * math.sin(begin)
    x2, y2 = radius * math.cos(end), radius * math.sin(end)
    word = "G2" if clockwise else "G3"
    sign = "-" if sweep > math.pi else ""
    program = f"F1 G0 X{x1:.12f} Y{y1:.12f}\n{word} X{x2:.12f} Y{y2:.12f} P{turns} "
    by_centre = rows(f"{program} I{-x1:.12f} J{-y1:.12f}\nM2")
    by_radius = rows(f"{program} R{sign}{radius:.12f}\nM2")
    one, other = (found[found["kind"] == ARC]["values"][0] for found in (by_centre, by_radius))
    assert one[4] == other[4] == (-turns if clockwise else turns)
    # the centre is ill determined where the chord is short or nearly a diameter
    slack = 1e-9 * radius / abs(math.sin(sweep / 2)) + 1e-5 * radius * (abs(math.cos(sweep / 2)) < 1e-3)
    assert np.hypot(*(one[2:4] - other[2:4])) < max(slack, 1e-9) * 10
    assert np.hypot(*one[2:4]) < 1e-9


def test_a_parameter_is_set_after_the_block_that_sets_it() -> None:
    found = rows("#1=3\n#1=4 G0 X#1\nX#1\nM2")
    assert found["values"][found["kind"] == TRAVERSE, 0].tolist() == [3.0, 4.0]


def test_names_belong_to_the_subroutine_unless_they_begin_with_an_underscore() -> None:
    program = "#<a>=1 #<_d>=2\no1 sub\n#<a>=7\n#<_d>=8\no1 endsub\no1 call\nG0 X#<a> Y#<_d>\nM2"
    assert rows(program)["values"][0, :2].tolist() == [1.0, 8.0]


def test_arguments_are_a_subroutine_s_own() -> None:
    program = "#1=5 #2=6\no1 sub\n#2=9\nG0 X#1 Y#2\no1 endsub\no1 call [7]\nG0 X#1 Y#2\nM2"
    assert rows(program)["values"][:2, :2].tolist() == [[7.0, 9.0], [5.0, 6.0]]


def test_a_subroutine_may_call_itself() -> None:
    program = (
        "o<factorial> sub\no1 if [#1 le 1]\no<factorial> return [1]\no1 endif\no<factorial> call [#1-1]\n"
        "o<factorial> endsub [#1*#<_value>]\no<factorial> call [6]\nG0 X#<_value>\nM2"
    )
    assert rows(program)["values"][0, 0] == 720.0


def test_block_delete_leaves_out_what_begins_with_a_slash() -> None:
    program = "G0 X1\n/X2\n / N5 X3\nM2"
    assert len(rows(program)) == len(rows(program, block_delete=True)) + 2


def test_gr_calls_a_subroutine() -> None:
    program = "o100 sub\nG0 X#1 Y#2\no100 endsub\nGR100 [5] [6] (call)\nN7 gr<100>[8]\nM2"
    found = rows(program, gr=True)
    assert found["values"][:2, :2].tolist() == [[5.0, 6.0], [8.0, 0.0]]
    with pytest.raises(ProgramError, match="option of the dialect"):
        items(program)


def test_the_program_of_the_thesis_runs_with_its_number_and_ends_of_blocks() -> None:
    program = "P001;\nN10 G01 X0 Y0 F100;\nN20 G01 X100 A25 F100 S1000; N30 M00;\nN40 M02;\n"
    found = list(text(interpret(program, options=Dialect(program_numbers=True))))
    assert [line[6:] for line in found[6:13]] == [
        'N..... COMMENT("program P001")',
        "N10    SET_FEED_RATE(100.0000)",
        "N10    STRAIGHT_FEED(0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)",
        "N20    SET_FEED_RATE(100.0000)",
        "N20    SET_SPINDLE_SPEED(0, 1000.0000)",
        "N20    STRAIGHT_FEED(100.0000, 0.0000, 0.0000, 25.0000, 0.0000, 0.0000)",
        "N30    PROGRAM_STOP()",
    ]
    with pytest.raises(ProgramError, match="stands on the first block") as caught:
        items("G0 X1; Y2; P001;\nM2;", program_numbers=True)
    assert (caught.value.line, caught.value.column) == (1, 12)
    with pytest.raises(ProgramError, match="option of the dialect"):
        items(program)


def test_loops_go_back_over_blocks_that_share_a_line() -> None:
    program = "o1 repeat [3]; G91 G0 X1; o1 endrepeat; G90; G0 Y#5420; M2;"
    assert rows(program, program_numbers=True)["values"][3, :2].tolist() == [3.0, 3.0]


class _Once:
    """A text that can be read only once and only on, as from a pipe."""

    def __init__(self, lines: list[str]):
        self._lines = iter(lines)

    def __iter__(self) -> Iterator[str]:
        return self._lines


def test_a_program_is_the_same_from_a_file_a_text_and_a_pipe(tmp_path: Path) -> None:
    lines = [
        "o1 repeat [4]\n",
        "  G91 G0 X1 (é)\n",
        "o1 endrepeat\r\n",
        *(f"N{n} X{n}\n" for n in range(9000)),
        "M2\n",
    ]
    program = "".join(lines)
    path = tmp_path / "part.ngc"
    path.write_bytes(program.encode())
    expected = list(text(interpret(program)))
    assert list(text(interpret(path))) == expected
    assert list(text(interpret(io.BytesIO(program.encode())))) == expected
    assert list(text(interpret(io.StringIO(program)))) == expected
    assert list(text(interpret(_Once(lines)))) == expected  # type: ignore[arg-type]
    with path.open("rb") as file:
        assert list(text(interpret(file))) == expected
        assert not file.closed


def test_results_come_in_blocks_while_the_program_is_read() -> None:
    read = 0

    def lines() -> Iterator[str]:
        nonlocal read
        for n in range(300_000):
            read += 1
            yield f"G0 X{n}\n"
        yield "M2\n"

    run = interpret(lines())  # type: ignore[arg-type]
    block = next(item for item in run if isinstance(item, MotionBlock))
    assert 0 < len(block) <= BLOCK_ROWS
    assert read < 150_000
    assert max(len(item) for item in run if isinstance(item, MotionBlock)) <= BLOCK_ROWS


def test_rows_carry_line_number_word_and_file(tmp_path: Path) -> None:
    (tmp_path / "sub.ngc").write_text("o<sub> sub\n\nN7 G0 X1\no<sub> endsub\n")
    main = tmp_path / "main.ngc"
    main.write_text("\n\nN010 G0 X5\nF100\no<sub> call\nX6\nM2\n")
    blocks = [item for item in interpret(main) if isinstance(item, MotionBlock)]
    found = [
        (Path(block.file).name, int(row["line"]), int(row["n"]), int(row["digits"]), int(row["kind"]))
        for block in blocks
        for row in block.rows
    ]
    assert found[:4] == [
        ("main.ngc", 3, 10, 3, TRAVERSE),
        ("main.ngc", 4, 0, 0, RATE),
        ("sub.ngc", 3, 7, 1, TRAVERSE),
        ("main.ngc", 6, 0, 0, TRAVERSE),
    ]


def test_a_fault_in_a_subroutine_s_file_is_told_there(tmp_path: Path) -> None:
    (tmp_path / "sub.ngc").write_text("o<sub> sub\nG0 Q1\no<sub> endsub\n")
    main = tmp_path / "main.ngc"
    main.write_text("o<sub> call\nM2\n")
    with pytest.raises(ProgramError) as caught:
        list(interpret(main))
    assert (caught.value.file, caught.value.line, caught.value.column) == (str(tmp_path / "sub.ngc"), 2, 4)


def test_percent_signs_of_a_subroutine_s_file_and_of_what_is_passed_over_say_nothing(tmp_path: Path) -> None:
    (tmp_path / "sub.ngc").write_text("%\no<sub> sub\nG0 X1\no<sub> endsub\n%\n")
    main = tmp_path / "main.ngc"
    for frame in ("{}\nM2\n", "%\n{}\n%\n"):
        main.write_text(frame.format("o<sub> call\nG0 X2"))
        blocks = [item for item in interpret(main) if isinstance(item, MotionBlock)]
        assert [row["values"][0] for block in blocks for row in block.rows][:2] == [1.0, 2.0]
    assert x_of("o1 if [0]\n%\no1 endif\nG0 X3") == 3.0


def test_files_elsewhere_are_no_subroutines(tmp_path: Path) -> None:
    (tmp_path / "secret.ngc").write_text("o<secret> sub\no<secret> endsub\n")
    (tmp_path / "here").mkdir()
    main = tmp_path / "here" / "main.ngc"
    main.write_text("o<../secret> call\nM2\n")
    with pytest.raises(ProgramError, match="not defined"):
        list(interpret(main))


def test_the_state_after_m2_is_that_of_a_new_program() -> None:
    run = Interpreter("G91 G18 G95 F1 S5 M3 M8 G1 X1\nG55 G0 X3\nM2")
    list(run.run())
    state = run.context.state
    assert (state.absolute, state.plane, state.feed_mode, state.feed_rate) == (1, 0, 0, 0.0)
    assert (state.spindle, state.flood, state.origin_index, state.motion) == (0, 0, 1, 10)


@given(st.lists(st.floats(-100, 100).map(lambda v: round(v, 3)), min_size=6, max_size=6), st.floats(-180, 180))
def test_positions_in_the_machine_do_not_depend_on_offsets(offset: list[float], angle: float) -> None:
    words = " ".join(f"{axis}{value:.3f}" for axis, value in zip("XYZABC", offset, strict=True))
    program = f"G10 L2 P2 {words} R{angle:.3f}\nG55 G92 {words}\nG53 G0 X1 Y2 Z3 A4 B5 C6\n#1=#<_abs_x> #2=#<_abs_y>\n"
    found = rows(f"{program}#3=#<_abs_z>\n#4=#<_abs_c>\nG92.1 G54 G0 X#1 Y#2 Z#3 C#4\nM2")
    assert found["values"][-2, [0, 1, 2, 5]] == pytest.approx([1, 2, 3, 6], abs=1e-9)


def test_lengths_of_tools_and_parameters_are_in_the_machine_s_units() -> None:
    tools = [Tool(1, offset=(0.0, 0.0, 1.0, 0.0, 0.0, 0.0))]
    program = "T1 M6 G43 G0 Z0 X0\nG20 G0 X0\nM2"
    for inch, z in ((False, -1.0), (True, -25.4)):
        found = list(interpret(f"G43 H1\n#<z>=#5422\n{program}", tools=tools, options=Dialect(inch_machine=inch)))
        offsets = [item.args[2] for item in found if isinstance(item, Call) and item.name == "USE_TOOL_LENGTH_OFFSET"]
        assert offsets[0] == pytest.approx(-z)
    kept = {5221: 2.0, 5220: 1.0}
    origin = next(item for item in interpret("M2", parameters=kept) if isinstance(item, Call) and "G5X" in item.name)
    assert origin.args[:2] == (1, 2.0)


def test_the_document_names_every_word() -> None:
    document = (Path(__file__).parents[2] / "docs" / "part-program-language.md").read_text(encoding="utf-8")
    table = document[document.index("## Words") : document.index("## Options")]
    for code in G_GROUPS:
        number = f"G{code / 10:g}"
        assert number in table or (540 <= code <= 593 and "G54 to G59.3" in table), number
    for code in M_GROUPS:
        assert f"M{code}" in table, code
    for option in Dialect._fields:
        assert f"`{option}`" in document, option


def test_the_document_s_example_runs(capsys: pytest.CaptureFixture[str]) -> None:
    document = (Path(__file__).parents[2] / "docs" / "part-program-language.md").read_text(encoding="utf-8")
    example = document[document.index("```python") + 9 :]
    exec(example[: example.index("```")], {})
    assert "ARC_FEED(11.0000, 2.0000, 6.0000, 2.0000, -1, 0.0000" in capsys.readouterr().out
