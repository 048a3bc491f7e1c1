"""The fast lane and the usual way give the same items, the same faults and leave the same state, bit for bit."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rds.nc import Dialect
from rds.nc.language import canon
from rds.nc.language.fast_lane import NEVER, FastLane, kernel
from rds.nc.language.interpreter import Interpreter
from rds.nc.language.source import CHUNK, LONGEST

from .fuzz_targets import outcome, same
from .random_programs import plain_program

pytest.importorskip("numba", reason="without numba (extra fast) there is no fast lane")

HEAD = b"G21 G90 G17 F300\n"


@pytest.fixture(scope="module", autouse=True)
def compiled() -> None:
    """A program of this length would not wait for the compiler."""
    assert kernel() is not None


@pytest.fixture
def taken(monkeypatch: pytest.MonkeyPatch) -> Callable[[bytes], int]:
    """How many lines of a program the fast lane takes."""

    def count(program: bytes) -> int:
        lines = []
        read = FastLane._read
        with monkeypatch.context() as patch:
            patch.setattr(FastLane, "_read", lambda *words: lines.append(read(*words)) or lines[-1])
            outcome(program, 0)
        return sum(lines)

    return count


PLAIN = [
    "G1X1Y2Z3",
    "x-1.5 y+.25 z 3. ; to there",
    "N10 G0 X10 A90 B-45 C.125",
    "  g 0 0 1  x 1 0\t.5\r",
    "N0007 F250.5",
    "G90 G1 X1 F0.5",
    "G0 X0 Y0 F200",
    "G2 X10 Y0 I5",
    "G03 X0 Y0 I-5 J0 Z-1",
    "G3 X5 Y5 R20",
    "G2 X0 Y0 R-20.5",
    "X7 Y7 R9",
    "N3",
    "S1000 G1 X8 F100",
    "g1 s 0",
    "",
    "; nothing",
    "G1",
    "(to the left) G1 X1 (there) Y2",
    "N7 ( spaced)",
    "()",
    "G4 P.5 (wait)",
    "G91 M3 S100",
    "G99 G81 X1 Y1 Z-3 R1",
    "X5",
    "G83 X1 Z-3 R1 Q.5 L2",
    "G90 G98 M8",
    "G84 X1 Z-3 R1 F100",
    "G80 M9",
    "F-0.0",
]


def test_it_takes_plain_lines(taken: Callable[[bytes], int]) -> None:
    program = HEAD + "\n".join(PLAIN).encode() + b"\nM2\n"
    assert taken(program) == len(PLAIN)
    assert same(program)["fault"] is None


@pytest.mark.parametrize(
    "line",
    [
        *("G1 X1 X2", "G1 G0 X1", "X#1", "X[1+1]", "(msg, X) X1", "G4", "G4 P1 X1", "G17", "S-100", "T1", "M3 M4"),
        *("G90 G91", "(a", "(a(b)) X1", "(é)", "X(a)1", "(LOGCLOSE)", "(py, 1)", "M6", "M1.5", "G98 G99", "G80 X1"),
        *("G81 X1 Z-1", "G81 X1 R1", "G81 Z-1 R1 A5", "G82 Z-1 R1", "G83 Z-1 R1", "G81 Z-1 R1 L0", "G81 Z-1 R1 Q1"),
        *("G84 Z-1 R1", "G81 Z2 R1", "G83 Z-9 R9 Q.003", "G87 Z-1 R1 I1 J1 K1", "G81 Z-1 R1 I1", "M7 M8", "L1", "Q1"),
        *("/X1", "X1 P2", "G2 X1 Y1 I9 J9", "G2 X1", "G2 X1 R.01", "G2 R1", "G1 I1 X1", "N1.5 X1", "X1 N2"),
        *(
            "X",
            "X1.2.3",
            "X--1",
            "X1-",
            "G1.5",
            "G-1",
            "G 9 0 . 1",
            "X1e3",
            "X1\x00",
            "é",
            "R1",
            "F-1",
            "X1;" + "." * 300,
        ),
        *("N1234567890", "N", "N-1", "X12345678901234567", "X0.12345678901234567890123", "G2 X1 Y1 I1 J0 R1", "G33 Z1"),
        *("G2 X9 Y0 I4.5 K1", "%", "X" + " " * 260 + "1", "G1 X1 E1", "X\x0b1", "X1\x0c"),
    ],
)
def test_other_lines_go_the_usual_way(line: str, taken: Callable[[bytes], int]) -> None:
    program = HEAD + b"G1X1\n" + line.encode("latin-1") + b"\n"
    assert taken(program) == 1  # not the one in question
    same(program + b"X5\nX6\nM2\n")


def test_lines_that_need_what_is_not_set_go_the_usual_way() -> None:
    for program, fault in (
        (b"X1\nM2\n", "no motion is active"),
        (b"G1 X1\nM2\n", "no feed rate"),
        (b"F1 G3 X1 I.5\nG91.1 G90.1\nM2\n", "both"),
        (HEAD + b"G90.1\nG2 X10 I5 J0\nG2 X0 I5\nM2\n", "J is missing"),
    ):
        assert fault in str(same(program)["fault"])


@pytest.mark.parametrize("mode", ["G93", "G95 S100 F1", "G41.1 D2", "G18", "G19", "G91", "G90.1", "G20", "G92 X1"])
def test_modes(mode: str) -> None:
    same(HEAD + f"{mode}\nG1 F10\nX10 Y10 Z10 F5\nX20 Z5\nG40\nG2 X20 Z15 Y2 R30\nX1\nM2\n".encode())


@pytest.mark.parametrize("length", [LONGEST - 1, LONGEST, LONGEST + 1])
@pytest.mark.parametrize("end", [b"\n", b"\r\n"])
def test_the_longest_line(length: int, end: bytes) -> None:
    for line in (b"X1".ljust(length), b"X1;".ljust(length, b"-")):
        same(HEAD + b"G1\n" + line + end + b"X2\nM2\n")


def test_subroutines_loops_and_files_keep_their_lines(tmp_path: Path) -> None:
    (tmp_path / "other.ngc").write_text("o<other> sub\nG1 X1\nX2\nX3\nX4\nX5\no<other> endsub\n")
    main = tmp_path / "main.ngc"
    main.write_text(
        "F100 G1\no1 sub\n G1 X1\n X2\n X3\n X4\n X5\no1 endsub\no1 call\n"
        "o2 repeat [3]\n Y1\n Y2\n Y3\n Y4\n Y5\no2 endrepeat\n"
        "o<other> call\nZ1\nZ2\nZ3\nZ4\nZ5\n(line #<_line>)\nX#5\nM2\n"
    )
    found = []
    for wait in (0, NEVER):
        interpreter = Interpreter(main)
        interpreter.lane.wait = wait
        items = [item for item in interpreter.run() if isinstance(item, canon.MotionBlock)]
        interpreter.close()
        found.append([(item.file, row.tolist()) for item in items for row in item.rows["line"]])
    assert found[0] == found[1]
    assert {file for file, _ in found[0]} == {str(main), str(tmp_path / "other.ngc")}


def test_it_goes_over_buffers_and_blocks(taken: Callable[[bytes], int]) -> None:
    lines = [b"N%d G1 X%d.5 Y-%d F%d" % (k, k % 977, k, 100 + k % 7) for k in range(40_000)]
    program = HEAD + b"\n".join(lines) + b"\nM2"
    assert len(program) > 3 * CHUNK
    assert taken(program) > 39_900
    assert len([item for item in same(program)["items"] if isinstance(item, tuple)]) == 80_002


def test_without_numba_the_usual_way_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    program = HEAD + b"G1\n" + b"X1 Y2\nX3\n" * 50 + b"M2\n"
    usual = outcome(program, NEVER)
    monkeypatch.setattr("rds.nc.language.fast_lane.kernel", lambda: None)
    monkeypatch.setattr("rds.nc.language.fast_lane.stored", lambda: None)
    monkeypatch.setattr("rds.nc.language.fast_lane.is_loaded", lambda: False)
    assert outcome(program, 0) == usual


# -- random programs --------------------------------------------------------------------------------------------------

numbers = st.one_of(
    st.integers(-20, 20).map(str),
    st.decimals(-999, 999, places=4).map(str),
    st.floats(-1e4, 1e4).map(lambda value: f"{value:.12f}"),
    st.from_regex(r"[+-]?[0-9]{0,9}\.?[0-9]{0,12}", fullmatch=True),
    st.sampled_from(["0", "-0", "+0.", ".0", "00005", "9007199254740993", "0.3", "1.10000000000000008882", "."]),
)
plain_words = st.builds(
    lambda letter, gap, number: letter + gap + number,
    st.sampled_from("XYZABCIJKRFSxyzabcijkrfs"),
    st.sampled_from(["", "", " ", "\t"]),
    numbers,
)
g_words = st.sampled_from(["G0", "G1", "G2", "G3", "g01", "G 0 3", "G1.", "G90", "G91", "G2.0"])
rare_words = st.sampled_from(
    [
        *(
            "G17",
            "G18",
            "G19",
            "G20",
            "G21",
            "G90.1",
            "G91.1",
            "G93",
            "G94",
            "G40",
            "G80",
            "M3",
            "S1",
            "T1",
            "P2",
            "M0",
        ),
        *("(c)", ";c", "#1=2", "X#1", "X[2*3]", "%", "/", "N5", "E1", "G92X0", "G54", "G55", "G53", "G28", "G41.1D1"),
    ]
)
flow = st.sampled_from(["o1 sub", "o1 endsub", "o1 call", "o2 repeat [3]", "o2 endrepeat", "o3 if [1]", "o3 endif"])


@st.composite
def arcs(draw: st.DrawFn) -> str:
    """Arcs that end on their circles, most of them: from the origin of a G91 block."""
    i, j = draw(st.integers(-30, 30)), draw(st.integers(-30, 30))
    word = draw(st.sampled_from(["G2", "G3"]))
    end = draw(st.sampled_from([(2 * i, 2 * j), (0, 0), (i - j, i + j), (i + j, j - i), (2 * i, 2 * j + 0.02), (i, j)]))
    first, second = draw(st.sampled_from(["XY", "ZX", "YZ"]))
    centre = {"X": "I", "Y": "J", "Z": "K"}
    return f"{word} {first}{end[0]} {second}{end[1]} {centre[first]}{i} {centre[second]}{j}"


blocks = st.one_of(
    st.lists(plain_words, max_size=5, unique_by=lambda word: word[0].lower()).map(" ".join),
    st.tuples(g_words, st.lists(plain_words, max_size=4, unique_by=lambda word: word[0].lower())).map(
        lambda pair: " ".join([pair[0], *pair[1]])
    ),
    st.lists(st.one_of(plain_words, g_words, rare_words), max_size=5).map("".join),
    arcs(),
    flow,
)
numbered = st.tuples(st.sampled_from(["", "", "N1", "n0020 ", "N 3", "N4.5"]), blocks).map("".join)
programs = st.builds(
    lambda head, lines, ends: (head + "".join(f"{line}{end}" for line, end in zip(lines, ends, strict=False))).encode(),
    st.sampled_from(["", "F100\nG1\n", "G91 G1 F50.5\n", "G18 G91 F9\nG0 X0\n", "G20 G90.1 F2\n", "%\nF1 G1\n"]),
    st.lists(numbered, max_size=12),
    st.lists(st.sampled_from(["\n", "\n", "\n", "\r\n", " \n", "\n\n", ""]), min_size=12, max_size=12),
)


@settings(max_examples=80, deadline=None)
@given(
    programs, st.sampled_from([Dialect(max_jumps=50), Dialect(True, True, max_jumps=50), Dialect(program_numbers=True)])
)
@example(b"G91F1\nG2X0Y.02I0J9\n", Dialect())
def test_random_programs(program: bytes, options: Dialect) -> None:
    same(program + b"M2\n", options=options)


def test_cycles_and_comments() -> None:
    for seed in range(150):
        same(plain_program(Random(seed)))


@settings(max_examples=60, deadline=None)
@given(programs, st.data())
def test_mutated_bytes(program: bytes, data: st.DataObject) -> None:
    mutant = bytearray(program + b"M2\n")
    for _ in range(data.draw(st.integers(1, 6))):
        at = data.draw(st.integers(0, len(mutant) - 1))
        what = data.draw(st.sampled_from([*b"\n\r\t ;()[]#%/.-+0123456789GXIRFNMO", 0, 127, 200, 255]))
        if data.draw(st.booleans()):
            mutant[at] = what
        else:
            mutant.insert(at, what)
    same(bytes(mutant))


def _spelled(r: Random) -> str:
    """A number of up to 9 digits before its point and 12 behind it; with a sign, without a point, or of many digits."""
    before, behind = r.choice([0, 1, 2, 3, 9]), r.choice([0, 1, 4, 12])
    digits = [str(r.randrange(10)) for _ in range(max(before + behind, 1))]
    point = "." if behind else r.choice(["", "."])
    return r.choice(["", "", "-", "+"]) + "".join((*digits[: before or 1 - bool(behind)], point, *digits[before:]))


@pytest.mark.parametrize("seed", range(4))
def test_numbers_are_those_of_float(seed: int) -> None:
    r = Random(seed)
    spelled = ["0", "-0", "+0.", ".0", "00005", "9007199254740993", "0.3", "1.10000000000000008882"]
    spelled += [_spelled(r) for _ in range(4000)] + [f"{r.uniform(-1e4, 1e4):.12f}" for _ in range(1000)]
    r.shuffle(spelled)
    lines = "".join(f"X{number}\n" for number in spelled)
    found = [item for item in same(HEAD + b"G0\n" + lines.encode() + b"M2\n")["items"] if isinstance(item, tuple)]
    values = [np.frombuffer(row[-1])[0] for row in found[-len(spelled) - 1 : -1]]
    assert [repr(float(value)) for value in values] == [repr(float(number)) for number in spelled]


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(*(st.floats(-200, 200).map(lambda value: f"{value:.4f}") for _ in range(2)), st.floats(0.5, 3)),
        min_size=5,
        max_size=30,
    ),
    st.sampled_from(["G17", "G18", "G19"]),
)
def test_centres_from_radii_are_the_same_to_the_last_bit(points: list[tuple[str, str, float]], plane: str) -> None:
    first, second = {"G17": "XY", "G18": "ZX", "G19": "YZ"}[plane]
    x = y = 0.0
    lines = [f"F100 {plane}\nG0 X0 Y0 Z0"]
    for k, (end_x, end_y, factor) in enumerate(points):
        half = np.hypot(float(end_x) - x, float(end_y) - y) / 2
        radius = half * (1.0 if k % 3 == 0 else factor) * (1 if k % 2 else -1)
        lines.append(f"G{2 + k % 2} {first}{end_x} {second}{end_y} R{radius:.5f}")
        x, y = float(end_x), float(end_y)
    same("\n".join([*lines, "M2\n"]).encode())
