"""What the editor of part programs says of a word, and offers while one types: each word that the interpreter knows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from types import MappingProxyType
from typing import TypedDict


class Word(TypedDict):
    """One of them. `kind` is where it stands: "code", "letter", "o" or "function"."""

    label: str
    kind: str
    info: str


_CODES: Mapping[str, str] = MappingProxyType(
    {
        "G0": "rapid move: each axis as fast as it may",
        "G1": "straight move at the feed rate F",
        "G2": "arc clockwise at the feed rate: end in X Y Z, centre in I J K from the start, or radius R",
        "G3": "arc counter-clockwise at the feed rate: end in X Y Z, centre in I J K from the start, or radius R",
        "G4": "dwell: P seconds",
        "G5": "cubic spline: I J from the start, P Q from the end, to X Y",
        "G5.1": "quadratic spline: control point I J from the start, to X Y",
        "G5.2": "begins a NURBS of control points X Y with weights P, of order L; G5.3 ends it",
        "G5.3": "ends the NURBS of G5.2",
        "G7": "lathe: X words are diameters",
        "G8": "lathe: X words are radii",
        "G10": "writes offsets: L2 and L20 a coordinate system P, L1, L10 and L11 the tool table",
        "G17": "plane XY, for arcs, cycles and compensation",
        "G18": "plane XZ, for arcs, cycles and compensation",
        "G19": "plane YZ, for arcs, cycles and compensation",
        "G20": "lengths in inches",
        "G21": "lengths in millimetres",
        "G28": "rapid to the home position, by way of the axis words",
        "G28.1": "keeps this position as that of G28",
        "G30": "rapid to the second home position, by way of the axis words",
        "G30.1": "keeps this position as that of G30",
        "G33": "thread: a move with the spindle, K per revolution",
        "G33.1": "rigid tapping: down and up again with the spindle, K per revolution",
        "G38.2": "probes until contact; an error without it",
        "G38.3": "probes until contact",
        "G38.4": "probes away until contact is lost; an error if it is not",
        "G38.5": "probes away until contact is lost",
        "G40": "cutter compensation off",
        "G41": "cutter left of the path, by the radius of tool D",
        "G41.1": "cutter left of the path, of diameter D",
        "G42": "cutter right of the path, by the radius of tool D",
        "G42.1": "cutter right of the path, of diameter D",
        "G43": "tool length of tool H, or of the loaded one",
        "G43.1": "tool length by the axis words",
        "G43.2": "adds the length of tool H, or the axis words",
        "G43.4": "the words are of the tool's tip, while rotary axes tilt it; length of tool H",
        "G49": "tool length off",
        "G52": "shifts all coordinate systems by the axis words, as G92",
        "G53": "this move in machine coordinates, with G0 or G1",
        **{f"G{54 + n}": f"coordinate system {n + 1}" for n in range(6)},
        **{f"G59.{n}": f"coordinate system {n + 6}" for n in range(1, 4)},
        "G61": "exact path: corners are reached",
        "G61.1": "exact stop: comes to rest at the end of each move",
        "G64": "blends corners: at most P from the path; Q joins short lines",
        "G70": "lathe: finishes along the contour of subroutine Q",
        "G71": "lathe: roughs along Z, I deep at a time, to the contour of subroutine Q",
        "G71.1": "as G71, without pockets",
        "G71.2": "as G71, pockets alone",
        "G72": "lathe: roughs along X, I deep at a time, to the contour of subroutine Q",
        "G72.1": "as G72, without pockets",
        "G72.2": "as G72, pockets alone",
        "G73": "drills to Z and breaks chips: Q deep at a time; begins at R",
        "G74": "taps left-hand to Z; begins at R",
        "G76": "cuts a thread in passes to the depth K: P per revolution, I from the drive line, J the first depth",
        "G80": "ends a canned cycle",
        "G81": "drills to Z; begins at R",
        "G82": "drills to Z and dwells P seconds; begins at R",
        "G83": "drills to Z, and comes out after each Q; begins at R",
        "G84": "taps to Z; begins at R",
        "G85": "bores to Z, and out at the feed rate; begins at R",
        "G86": "bores to Z, and out with the spindle at rest; begins at R",
        "G87": "back-boring",
        "G88": "bores to Z, and leaves the tool for the hand",
        "G89": "bores to Z, dwells P seconds, and out at the feed rate; begins at R",
        "G90": "axis words are positions",
        "G90.1": "I J K are the position of the centre",
        "G91": "axis words are distances",
        "G91.1": "I J K are distances from the start",
        "G92": "calls this position the axis words, in all coordinate systems",
        "G92.1": "takes G92 back and forgets it",
        "G92.2": "takes G92 back and keeps it",
        "G92.3": "G92 again as it was kept",
        "G93": "inverse time feed: a move takes 1/F minutes",
        "G94": "F in length units per minute",
        "G95": "F in length units per revolution of the spindle",
        "G96": "constant surface speed S; D is the highest speed",
        "G97": "S in revolutions per minute",
        "G98": "cycles go out to where their series began",
        "G99": "cycles go out to R",
        "M0": "stops until *Resume*",
        "M1": "stops until *Resume*, where the optional stop is on",
        "M2": "ends the program",
        "M3": "spindle clockwise at S",
        "M4": "spindle counter-clockwise at S",
        "M5": "spindle stops",
        "M6": "changes to the tool T",
        "M7": "mist on",
        "M8": "flood on",
        "M9": "coolant off",
        "M19": "turns the spindle to the angle R",
        "M30": "ends the program",
        "M48": "allows the feed override",
        "M49": "forbids the feed override",
        "M50": "feed override: P0 off, P1 on",
        "M51": "spindle override: P0 off, P1 on",
        "M52": "adaptive feed: P0 off, P1 on",
        "M53": "feed stop: P0 off, P1 on",
        "M60": "stops for a change of the pallet, until *Resume*",
        "M61": "calls the loaded tool Q",
        "M62": "output P on, with the next move",
        "M63": "output P off, with the next move",
        "M64": "output P on, at once",
        "M65": "output P off, at once",
        "M66": "waits for the input P or E: L how, at most Q seconds",
        "M67": "analog output E to Q, with the next move",
        "M68": "analog output E to Q, at once",
        "M70": "keeps the modes",
        "M71": "forgets the kept modes",
        "M72": "brings the kept modes back",
        "M73": "keeps the modes, and brings them back when the subroutine returns",
        "M98": "calls the program P, L times",
        "M99": "returns from a program, or ends the main one",
    }
)
_LETTERS: Mapping[str, str] = MappingProxyType(
    {
        "A": "angle of the rotary axis about X (degrees)",
        "B": "angle of the rotary axis about Y (degrees)",
        "C": "angle of the rotary axis about Z (degrees)",
        "D": "tool, or diameter, of cutter compensation; a length in turning cycles",
        "E": "input or output; the second allowance of a cycle",
        "F": "feed rate: length units per minute, unless G93 or G95 is in force",
        "G": "how to move, and the modes that last",
        "H": "tool whose length counts",
        "I": "centre of an arc along X, from its start; depth in cycles",
        "J": "centre of an arc along Y, from its start; depth in cycles",
        "K": "centre of an arc along Z, from its start; lead of a thread",
        "L": "how often; which table G10 writes",
        "M": "spindle, tool, coolant, stops, outputs",
        "N": "number of the line; says nothing",
        "O": "subroutines, conditions and loops",
        "P": "seconds of a dwell; turns of an arc; number of a system or program",
        "Q": "depth of each cut of a cycle; tolerance; number of a subroutine",
        "R": "radius of an arc; height at which a cycle begins",
        "S": "speed of the spindle (rev/min)",
        "T": "tool that M6 changes to",
        "X": "end of the move along X",
        "Y": "end of the move along Y",
        "Z": "end of the move along Z",
    }
)
_O_WORDS: Mapping[str, str] = MappingProxyType(
    {
        "sub": "begins a subroutine",
        "endsub": "ends a subroutine",
        "call": "calls a subroutine: o100 call [1] [2] gives #1 and #2",
        "return": "returns from a subroutine",
        "if": "begins lines for when a condition holds: o1 if [#1 GT 0]",
        "elseif": "begins lines for when another condition holds",
        "else": "begins lines for when no condition holds",
        "endif": "ends them",
        "while": "repeats the lines as long as a condition holds",
        "endwhile": "ends the lines of while",
        "do": "begins lines that are repeated until the condition of while, behind them, no longer holds",
        "repeat": "repeats the lines a number of times: o1 repeat [3]",
        "endrepeat": "ends the lines of repeat",
        "break": "leaves a loop",
        "continue": "goes on with the next turn of a loop",
    }
)
_FUNCTIONS: Mapping[str, str] = MappingProxyType(
    {
        "ABS": "without its sign",
        "ACOS": "angle of a cosine (degrees)",
        "ASIN": "angle of a sine (degrees)",
        "ATAN": "angle of ATAN[y]/[x] (degrees)",
        "COS": "cosine of degrees",
        "EXISTS": "1 if a parameter is there, else 0: EXISTS[#<name>]",
        "EXP": "e to a power",
        "FIX": "the whole number below",
        "FUP": "the whole number above",
        "LN": "natural logarithm",
        "ROUND": "the nearest whole number",
        "SIN": "sine of degrees",
        "SQRT": "square root",
        "TAN": "tangent of degrees",
    }
)


@cache
def words() -> tuple[Word, ...]:
    """All of them."""
    return (
        *_of("code", _CODES.items()),
        *_of("letter", _LETTERS.items()),
        *_of("o", _O_WORDS.items()),
        *_of("function", _FUNCTIONS.items()),
    )


def _of(kind: str, found: Iterable[tuple[str, str]]) -> Iterable[Word]:
    return ({"label": label, "kind": kind, "info": info} for label, info in found)
