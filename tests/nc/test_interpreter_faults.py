"""What is wrong in a program is told with file, line, column, word, and what to do."""

from __future__ import annotations

import io
import pickle

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rds.nc import Dialect, ProgramError, interpret
from rds.nc.language.canon import MotionBlock
from rds.nc.language.canon_text import text as canon_text
from rds.nc.language.tools import Tool
from tests.nc.random_programs import program


def fault(text: str, **options: bool | int) -> ProgramError:
    with pytest.raises(ProgramError) as caught:
        list(interpret(text, name="part.ngc", options=Dialect(**options)))  # type: ignore[arg-type]
    return caught.value


# program, line, column, word, part of the message
FAULTS = [
    ("G21 G18 F1\nG71 Q1 X1\nM2", 2, 1, "O1 CALL", "the subroutine 1 is not defined"),
    ("G0 X1 U2\nM2", 1, 7, "U2", "the axes are X Y Z A B C"),
    ("G0 X1\n  g1 y2\nM2", 2, 3, "G1", "no feed rate is set; write F"),
    ("X1\nM2", 1, 1, "X1", "write G0, G1, G2 or G3 before it"),
    ("G0 X1 Y 2 X3\nM2", 1, 11, "X3", "two X words"),
    ("G0 X1 G1 Y2 F3\nM2", 1, 7, "G1", "G0 and G1 on one line are both motion"),
    ("M3 M5\nM2", 1, 4, "M5", "both spindle words"),
    ("G0 X1.2.3\nM2", 1, 5, "1.2", "'1.2.3' is no number"),
    ("G0 X\nM2", 1, 4, "X", "X has no number"),
    ("G28 X ; home\nM2", 1, 5, "X", "X has no number; write one, as X2"),
    ("G0 Y X5\nM2", 1, 4, "Y", "Y has no number"),
    ("G0 X[2 +\nM2", 1, 9, "", "a number is missing"),
    ("#faces = 24\nM2", 1, 2, "F", "the name of a parameter stands in < >; write #<faces>"),
    ("G0 X#depth\nM2", 1, 6, "D", "write #<depth>"),
    ("G41 D1.5\nM2", 1, 5, "D1.5", "a whole number, not 1.5; write G41.1 D1.5 for a diameter"),
    ("$RST=gcode\nM2", 1, 1, "$", "settings and commands of a sender"),
    ("EXCLUDE_OBJECT_DEFINE NAME=cube\nM2", 1, 0, "", "a command of Klipper"),
    ("END_PRINT\nM2", 1, 0, "", "a command of Klipper"),
    ("SET_PRESSURE_ADVANCE ADVANCE=0.04\nM2", 1, 0, "", "a command of Klipper"),
    ("N80 X=IC(10) Y=AC(20)\nM2", 1, 0, "", "the language of Siemens' controls"),
    ('T="MILL_10" D1\nM2', 1, 0, "", "the language of Siemens' controls"),
    ("O5 IF [1]\nO5 ENDIF\nO5 IF [1]\nO5 ENDIF\nM2", 3, 1, "O5", "O5 belongs to IF in line 1 already"),
    ("G0 X[2 + ]\nM2", 1, 10, "]", "a number cannot begin with ']'"),
    ("G0 X\u22125\nM2", 1, 5, "\u2212", "'\u2212', a minus sign of a word processor; the one of programs is -"),
    ("G0 X1\rG0 X2\rM2\r", 1, 0, "", "lines end with CR alone"),
    ("#1=2\nIF [#1 GT 1] GOTO 10\nM2", 2, 0, "", "Fanuc's macro language; write O1 IF"),
    ("N5 WHILE [#1 LT 3] DO1\nM2", 1, 0, "", "Fanuc's macro language"),
    (
        "F9 G0 X9 Y9\nG2 X19 I14 J9\nM2",
        2,
        8,
        "I14",
        "or write G90.1 before, if these are",
    ),
    ("G90.1 F9 G0 X9 Y9\nG2 X19 I5 J0\nM2", 2, 8, "I5", "or write G91.1 before"),
    ("G0 X[1/0]\nM2", 1, 5, "[", "division by zero"),
    ("G0 Y#<depth>\nM2", 1, 5, "#<DEPTH>", "has no value"),
    ("#5400 = 3\nM2", 1, 1, "#5400", "can only be read"),
    ("#<_x> = 3\nM2", 1, 1, "#<_X>", "can only be read"),
    ("#0 = 3\nM2", 1, 1, "#0", "numbers go from 1 to 5601"),
    ("#1 X5\nM2", 1, 4, "X5", "a parameter alone does nothing"),
    ("G2 X10 I4 F10\nM2", 1, 8, "I4", "off its circle by 2.0000 (33.33 %), more than 0.0283 and 0.1 %"),
    ("G2 X10 Y0 F10 R4\nM2", 1, 15, "R4", "at least half of the way to the end, 5.0000"),
    ("F10 G2 X1 R1 I1\nM2", 1, 14, "I1", "either R or I J K"),
    ("F10 G3 X1 Y1\nM2", 1, 5, "G3", "needs its centre (I and J in G17) or its radius R"),
    ("G18 F1 G2 X1 J1\nM2", 1, 14, "J1", "no centre of an arc in the plane of G18; use K and I, or"),
    ("F1 G2 X4 I2 K0\nM2", 1, 13, "K0", "no centre of an arc in the plane of G17; leave it out, or another plane"),
    ("F10 G3 I1 P1.5\nM2", 1, 11, "P1.5", "a whole number of turns"),
    ("G90.1 F1 G2 I5 X10\nM2", 1, 10, "G2", "J is missing; an absolute centre (G90.1) needs I and J"),
    ("G93 G1 X1\nM2", 1, 5, "G1", "in inverse time (G93) every move by feed needs F"),
    ("F9 G1 X1\nG93\n (on) Y2 X3\nM2", 3, 7, "Y2", "G1 is still in force: in inverse time (G93) every move"),
    ("F9 G38.2 Z-5\nG41.1 D3\nZ-6\nM2", 3, 1, "Z-6", "G38.2 is still in force: probing does not go with cutter"),
    ("F9 G2 I1\nN5 X[1 + 2] Y3\nM2", 2, 4, "X", "G2 is still in force: an arc needs its centre (I and J in G17)"),
    ("G95 F.1 G1 X1\nM2", 1, 9, "G1", "the spindle's speed is 0; write S"),
    ("G4\nM2", 1, 1, "G4", "write the dwell in seconds"),
    ("G92\nM2", 1, 1, "G92", "without an axis word"),
    ("G10 L2 P10 X1\nM2", 1, 8, "P10", "is no coordinate system"),
    ("G10 L3 P1 Z1\nM2", 1, 5, "L3", "G10 needs L to say what it sets; write G10 L0, L1, L10, L11 (tool table), L2"),
    ("G10 L1 P1 Z1\nM2", 1, 8, "P1", "the tool table has no tool 1; it is empty"),
    ("F9 G81 X1 Z-3\nM2", 1, 4, "G81", "G81 without R; write where the rapid down ends"),
    ("F9 G81 X1 R1\nM2", 1, 4, "G81", "G81 without Z; write how deep"),
    ("F9 G18 G81 X1 Y1 R-1\nM2", 1, 18, "R-1", "R is below the depth: it lies at -1.0000, the hole's bottom at 1.0000"),
    ("F9 G83 Z-3 R1\nM2", 1, 4, "G83", "G83 without Q; write how deep each peck goes"),
    ("F9 G83 Z-3 R1 Q0\nM2", 1, 15, "Q0", "a peck of 0 goes nowhere"),
    ("F9 G82 Z-3 R1\nM2", 1, 4, "G82", "G82 without P; write the dwell"),
    ("F9 G84 Z-3 R1\nM2", 1, 4, "G84", "the spindle stands still; G84 wants it turning"),
    ("F9 S9 M4 G84 Z-3 R1\nM2", 1, 10, "G84", "right-hand threads: write M3 before"),
    ("F9 G81 Z-3 R1 L0\nM2", 1, 15, "L0", "L0 would repeat G81 no time"),
    ("F9 G81 Z-3 R1\nX1 A3\nM2", 2, 4, "A3", "A does not go with a canned cycle"),
    ("G93 F9 G81 Z-3 R1\nM2", 1, 8, "G81", "do not go with inverse time (G93)"),
    ("F9 G81\nM2", 1, 4, "G81", "G81 without an axis word; write where it goes"),
    ("G1 F9 @5\nM2", 1, 7, "@5", "counts from the tool's place, which is the origin"),
    ("G18 G1 F9 X1 Z1\n@5 ^5\nM2", 2, 1, "@5", "goes with the plane of G17 only"),
    ("G0 X1 @5\nM2", 1, 4, "X1", "the end has either X or @ and ^"),
    ("G33 Z-1 K1\nM2", 1, 1, "G33", "the spindle stands still; G33 follows it"),
    ("S9 M3\nG33 Z-1\nM2", 2, 1, "G33", "G33 without K"),
    ("F9 G91 G81 Z-1 R0 L99999999\nM2", 1, 19, "L99999999", "more than 100,000 holes by one line; write a smaller L"),
    ("F9 G83 Z-1 R0 Q.000001\nM2", 1, 15, "Q.000001", "more than 100,000 pecks by one line"),
    ("S9 M3\nG76 P1 Z-1 I-1 J.01 K5 R99\nM2", 2, 16, "J.01", "more than 10,000 cuts; write a larger first cut J"),
    ("S9 M3\nG76 P1 Z-1 I-1 J1 K5 H99999\nM2", 2, 22, "H99999", "more than 10,000 spring passes"),
    ("S9 M3\nG76 P1 Z-1 I-1 J1 K.5\nM2", 2, 19, "K.5", "the whole depth K must be more than the first cut J"),
    ("G96 D100\nM2", 1, 1, "G96", "G96 without S; write the surface speed"),
    ("M72\nM2", 1, 1, "M72", "no modes are saved here; write M70"),
    ("M64\nM2", 1, 1, "M64", "M64 needs P, the number of the output"),
    ("M66 P1 L3\nM2", 1, 8, "L3", "with Q above 0, the seconds at most"),
    ("M61\nM2", 1, 1, "M61", "needs the tool that is in the spindle"),
    ("G52\nM2", 1, 1, "G52", "by how much the axes are shifted"),
    ("F9 G5 X1 Y1 I1\nM2", 1, 4, "G5", "G5 needs both I and J"),
    ("F9 G5 X1 Y1 Z1 I1 J1 P1 Q1\nM2", 1, 13, "Z1", "a spline moves X and Y alone"),
    ("G5.3\nM2", 1, 1, "G5.3", "G5.3 ends what G5.2 began"),
    ("F9 G38.2 X0\nM2", 1, 4, "G38.2", "the probe is where it is to go already"),
    ("M98 L2\nM2", 1, 1, "M98", "M98 without P"),
    ("M98 P5 X1\nM2", 1, 8, "X1", "only P, L and a comment can follow M98"),
    ("M98 P5\nM2\nO5\nO5 ENDSUB\nM2", 4, 1, "O5", "O5 ENDSUB does not end this; write M99"),
    ("O5 CALL\nG4 P1\nO5 SUB\nO5 ENDSUB\nM2", 3, 1, "O5", "the program runs into the subroutine O5"),
    ("O5 SUB\nO5 ENDSUB\nO5 SUB\nO5 ENDSUB\nM2", 3, 1, "O5", "the subroutine O5 is defined already, in line 1"),
    ("M98 P5\nM2\nO5 SUB\nO5 ENDSUB\nM2", 3, 1, "O5", "O5 SUB is called by M98"),
    ("O5 CALL\nM2\nO5\nM99\n", 3, 1, "O5", "the program O5 is called by O5 CALL; write M98 P5"),
    ("$H\nG0 X1\nM2", 1, 1, "$", "settings and commands of a sender or of Grbl ($H homes"),
    ("0 BEGIN PGM 1 MM\nM2", 1, 0, "", "Heidenhain's conversational language"),
    ("1 L X+0 Y-5 R0 FMAX\nM2", 1, 0, "", "Heidenhain's conversational language"),
    ("F9\nN50 G2 X10 Y0 CR=5\nM2", 2, 0, "", "the language of Siemens' controls"),
    ("N5 TRANS X10\nM2", 1, 0, "", "the language of Siemens' controls"),
    ("CYCLE81(10,0,2,-5)\nM2", 1, 0, "", "the language of Siemens' controls"),
    ("R1=5\nM2", 1, 0, "", "R1 = 5 is #1 = 5 here"),
    ("#<cr=5\nM2", 1, 2, "<", ">"),
    ("O1 IF [1]\n  ENDIF ; of it\nM2", 2, 0, "", "write it before, as O1 ENDIF"),
    ("DPRNT[X#1[42]]\nM2", 1, 0, "", "write (PRINT, ...)"),
    ("G0 X1\nG1 Y1 ,R2 F9\nM2", 2, 7, ",", "round and break corners on other controls"),
    ("#1 = #2 + 1\nM2", 1, 9, "+1", "an expression stands in brackets"),
    (":1234\nM2", 1, 1, ":", "write O1234"),
    ("M98 P31002\nM2", 1, 1, "M98", "(3 times O1002), write M98 P1002 L3"),
    ("M98 P1002\nM2", 1, 1, "M98", "in a file 1002.ngc beside the program"),
    ("G54.1 P3\nM2", 1, 1, "G54.1", "write G54 to G59.3"),
    ("G5.1 Q1\nM2", 1, 1, "G5.1", "switches look-ahead on Fanuc's controls; leave it out"),
    ("G187 P3\nM2", 1, 1, "G187", "write G64 P"),
    ("F1 G81 X1 Z-1 R1 K4\nM2", 1, 18, "K4", "how often a cycle is repeated; write L"),
    ("G68 X0 Y0 R30\nM2", 1, 1, "G68", "turns the coordinates on other controls; write G10 L2 P0 R"),
    ("F1 G2 G53 X1 R2\nM2", 1, 7, "G53", "G53 needs G0 or G1"),
    ("G28 G1 X1\nM2", 1, 5, "G1", "both use the axis words"),
    ("G0 X1 P2\nM2", 1, 7, "P2", "nothing on the line uses P; it goes with G2, G3, G4, G5, G10, G64, G70, G76, G82"),
    ("G41 D3\nM2", 1, 5, "D3", "has no tool 3"),
    ("G19 G41.1 D3\nM2", 1, 5, "G41.1", "planes of G17 and G18 only"),
    ("T2\nM2", 1, 1, "T2", "it is empty; give one"),
    ("T0203\nM2", 1, 1, "T0203", "as of a lathe's turret (tool 2, offset 3), write T2 M6 and then G43"),
    ("N1 G21\nN2 G71 G91.1\nM2", 2, 4, "G71", "where it says that lengths are in mm (Mach3, Siemens), write G21"),
    ("M6\nM2", 1, 1, "M6", "write T and its number"),
    ("G0 X1 (not closed\nM2", 1, 7, "(", "write ( ... )"),
    ("G0 (π) X1 π\nM2", 1, 11, "π", "put it into a comment"),
    ("(π) G0 Xβ\nM2", 1, 9, "β", "a number cannot begin with"),
    ("G0 X1 N5\nM2", 1, 7, "N5", "a line number stands first"),
    ("N G0\nM2", 1, 1, "N", "a line number is digits"),
    (
        "(abort, no tool)\nM2",
        1,
        1,
        "(",
        "(ABORT, ...) is outside this dialect; write (MSG, ...), and M2 on the next line",
    ),
    ("(py,1)\nM2", 1, 1, "(", "(PY, ...) is outside this dialect; write a plain comment, (MSG, ...), (DEBUG, ...) or"),
    ("(PyReload)\nM2", 1, 1, "(", "(PYRELOAD) is outside"),
    ("(abort, now)\nM2", 1, 1, "(", "(ABORT, ...) is outside"),
    ("(print, #<a)\nM2", 1, 1, "(", "has no end; write #<name>"),
    ("(debug, #<a)\nM2", 1, 1, "(", "has no end; write #<name>"),
    ("G0 X1\nG1.55\nM2", 2, 1, "G1.55", "at most one decimal"),
    ("M98 P1\nM2", 1, 1, "M98", "the subroutine 1 is not defined in part.ngc after the call; define it by O1 on a"),
    ("M106\nM2", 1, 1, "M106", "user-defined M words, and those of 3-D printers"),
    ("M83\nM2", 1, 1, "M83", "filament of 3-D printers"),
    ("G1 X1 E0.5 F100\nM2", 1, 7, "E0.5", "E on a move is the filament of a 3-D printer"),
    ("G4 P1 E1\nM2", 1, 7, "E1", "nothing on the line uses E"),
    ("G28.2 X0\nM2", 1, 1, "G28.2", "home the machine before the program"),
    ("G0 X#<_ini[traj]a>\nM2", 1, 5, "#<_INI[TRAJ]A>", "INI file, which is not read here); set it before"),
    ("T2.5\nM2", 1, 1, "T2.5", "is not whole"),
    ("o1 if [1\nM2", 1, 9, "", "not closed; add ]"),
    ("o1 endif\nM2", 1, 1, "O1", "has no O1 IF before it"),
    ("o1 foo\nM2", 1, 1, "O1", "no control word"),
    ("o1 call [1] X2\nM2", 1, 13, "X2", "only a comment can follow O1 CALL"),
    ("G0\n  o<part> call\nM2", 2, 3, "O<part> CALL", "in a file part.ngc beside the program"),
    ("n5 o1 if [0]\nM2", 1, 4, "O1 IF", "is not closed before the file's end; write O1 ENDIF"),
    ("G0 X1\n o<a> sub\nM2", 2, 2, "O<a> SUB", "write O<a> ENDSUB where it ends"),
    ("o1 while [0]\nM2", 1, 1, "O1 WHILE", "write O1 ENDWHILE"),
    ("o1 repeat [0]\nM2", 1, 1, "O1 REPEAT", "write O1 ENDREPEAT"),
    ("o1 do\no1 break\nM2", 1, 1, "O1 DO", "write O1 WHILE [...]"),
    ("G0 \x1b[31mX1\nM2", 1, 4, "\\x1b", "words are a letter and a number"),
    ("o<\x07" + 90 * "π" + "> call\nM2", 1, 1, "O<\\x07" + 90 * "π" + "> CALL", "is not defined in part.ngc"),
    ("G0 X[SQRT[-1]]\nM2", 1, 6, "SQRT", "a number from 0 is asked for, and got -1"),
    ("G0 X[1 + LN[0]]\nM2", 1, 10, "LN", "a positive number is asked for, and got 0"),
    ("G0 XACOS[2]\nM2", 1, 5, "ACOS", "a number from -1 to 1 is asked for, and got 2"),
    ("\ufeffG0 X1 U2\nM2", 1, 7, "U2", "the axes are X Y Z A B C"),
    ("o1 sub\no2 sub\nM2", 2, 1, "O2", "a subroutine inside the subroutine '1'"),
    ("G0 X1", 1, 0, "", "the program does not end; write M2, M30 or %"),
    ("%\nG0 X1\n", 2, 0, "", "the program does not end; write % on its last line"),
    ("", 1, 0, "", "the program is empty"),
    ("G0 X" + 250 * "1", 1, 0, "", "longer than 252 characters"),
    ("G0 X" + 60 * "[" + "1" + 60 * "]" + "\nM2", 1, 55, "[", "more than 50 deep"),
]


def test_m99_in_a_subroutine_is_named_once() -> None:
    assert fault("O5 CALL\nM2\nO5 SUB\nM99\nM2").reason == "M99 does not end this; write O5 ENDSUB"


@pytest.mark.parametrize(("text", "line", "column", "word", "message"), FAULTS, ids=lambda value: repr(value)[:40])
def test_a_fault_is_told_with_its_place_and_word(text: str, line: int, column: int, word: str, message: str) -> None:
    error = fault(text)
    assert (error.file, error.line, error.column, error.word) == ("part.ngc", line, column, word)
    assert message in error.reason
    assert str(error).startswith(
        f"part.ngc:{line}" + (f":{column}" if column else "") + ": " + (f"{word}: " if word else "")
    )


def test_a_program_that_does_not_end_is_stopped() -> None:
    error = fault("o1 while [1]\n#1=[#1+1]\no1 endwhile\nM2", max_jumps=50)
    assert "more than 50 calls and jumps back" in error.reason
    assert error.line == 3


ENDLESS = [
    "o1 while [1]\no1 endwhile\nM2",
    "o1 do\no1 while [#1 eq 0]\nM2",
    "#1=1\no1 while [#1 gt 0]\nG0 X1\nG0 X0\n#1=1\no1 endwhile\nM2",
    "o1 while [1]\no2 repeat [3]\nG91 G0 X1\nX-1\no2 endrepeat\no1 continue\no1 endwhile\nM2",
    "o5 sub\n#31=5\no5 endsub\n#31=5\no1 while [#31]\no5 call [1]\no1 endwhile\nM2",
]


@pytest.mark.parametrize("text", ENDLESS)
def test_a_loop_that_leaves_everything_as_it_was_is_found_at_once(text: str) -> None:
    assert "never ends: a round leaves everything as it was" in fault(text, max_jumps=40).reason


def test_recursion_that_calls_itself_again_and_again_ends() -> None:
    """Each call has a frame of its own, and a later one is no earlier one."""
    calls = "o1 call [#2]\n" * 3
    text = f"G21 F600\no1 sub\n#2=[#1-1]\nG1 X[#1] Y#2\no2 if [#1 gt 1]\n{calls}o2 endif\no1 endsub\no1 call [8]\nM2"
    assert sum(len(item) for item in interpret(text) if isinstance(item, MotionBlock)) == 2 + (3**8 - 1) // 2


ENDING = [
    "o1 while [#<_x> lt 30]\nG91 G0 X1\no1 endwhile\nM2",
    "o1 while [#5221 lt 30]\nG10 L2 P1 X[#5221 + 1]\no1 endwhile\nM2",
    "#<a>=0\no1 while [#<a> lt 30]\n#<a>=[#<a>+1]\no1 endwhile\nM2",
    "o1 repeat [30]\no1 endrepeat\nM2",
    "o1 while [#<_selected_tool> lt 7]\no2 if [#<_selected_tool> eq 1]\nT2\no2 elseif [#<_selected_tool> eq 2]\nT7\n"
    "o2 else\nT1\no2 endif\no1 endwhile\nM2",
    "o1 while [#<_value> lt 3]\no2 if [#<_value> eq 1]\no5 call [2]\no2 elseif [#<_value> eq 2]\no5 call [3]\no2 else\n"
    "o5 call [1]\no2 endif\no1 endwhile\nM2\no5 sub\no5 endsub [#1]",
]


@pytest.mark.parametrize("text", ENDING)
def test_a_loop_that_ends_is_not_taken_for_endless(text: str) -> None:
    tools = [Tool(number, number, 1.0) for number in (1, 2, 7)]
    assert list(interpret(text, tools=tools, options=Dialect(max_jumps=60)))


def test_a_mark_of_the_coding_before_the_text_is_no_part_of_it() -> None:
    plain, marked = "G0 X1\no1 repeat [2]\nX2\no1 endrepeat\nM2\n", "\ufeffG0 X1\no1 repeat [2]\nX2\no1 endrepeat\nM2\n"
    assert list(canon_text(interpret(marked))) == list(canon_text(interpret(plain)))
    with pytest.raises(ProgramError, match="UTF-16; save it as UTF-8"):
        list(interpret(io.BytesIO("G0 X1\nM2".encode("utf-16"))))


def test_a_subroutine_that_calls_itself_without_end_is_stopped() -> None:
    error = fault("o1 sub\no1 call\no1 endsub\no1 call\nM2")
    assert "more than 9 subroutine calls inside one another" in error.reason
    assert (error.line, error.word) == (2, "O1")


def test_what_was_right_before_a_fault_is_handed_out() -> None:
    found = []
    with pytest.raises(ProgramError):
        found.extend(interpret("G0 X1\nX2\nX3 Q1\nM2"))
    calls = interpret("G0 X1\nX2\nX3 Q1\nM2")
    rows = 0
    with pytest.raises(ProgramError):
        for item in calls:
            rows += len(getattr(item, "rows", ()))
    assert rows == 2


def test_a_fault_crosses_processes() -> None:
    error = fault("G0 X1 U2\nM2")
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.line, again.column, again.word) == (str(error), 1, 7, "U2")


FEW = settings(max_examples=120, suppress_health_check=list(HealthCheck))
LIMITS = Dialect(max_jumps=200, gr=True, program_numbers=True)


def ends_or_is_refused(text: str, options: Dialect = LIMITS) -> None:
    try:
        for _ in interpret(text, options=options):
            pass
    except ProgramError as error:
        assert error.line >= 1
        assert "; " in error.reason, error.reason  # what; what to do


@FEW
@given(st.text(max_size=300))
def test_any_text_is_a_program_or_a_fault(text: str) -> None:
    ends_or_is_refused(text)


@FEW
@given(st.text("GMXYZIJRFPNOo#<>[]()/%;.-+*=0123456789 \nabsincodwhileqrt", max_size=300))
def test_any_signs_of_the_language_are_a_program_or_a_fault(text: str) -> None:
    ends_or_is_refused(text, Dialect(max_jumps=200))


@FEW
@given(st.randoms(use_true_random=False))
def test_damaged_programs_are_programs_or_faults(r) -> None:
    text = bytearray(program(r))
    for _ in range(r.randrange(1, 6)):
        at = r.randrange(len(text))
        way = r.randrange(3)
        if way == 0:
            text[at] = r.randrange(256)
        elif way == 1:
            del text[at : at + r.randrange(5)]
        else:
            text[at:at] = text[r.randrange(len(text)) :][: r.randrange(9)]
    ends_or_is_refused(text.decode("utf-8", "surrogateescape"))
