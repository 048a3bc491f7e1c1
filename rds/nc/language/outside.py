"""Words of RS274NGC and other dialects that this one does not have: what to write instead."""

from __future__ import annotations

_CYCLES = "canned cycles are outside this dialect; write their moves as G0 and G1"
_LATHE = "lathe cycles and threading are outside this dialect; write their moves as G0 and G1"
_PROBE = "probing is outside this dialect; leave it away"
_SPLINE = "splines are outside this dialect; write lines (G1) or arcs (G2, G3), for example from `rds nc make points`"
_G = {
    **dict.fromkeys((50, 51, 52, 53, 61, 62, 63), _SPLINE),
    70: "diameter mode is outside this dialect; program radii and leave G7 away",
    80: "radius mode is how X is read here always; leave G8 away",
    110: "G11 is outside this dialect; leave it away",
    **dict.fromkeys((171, 181, 191), "there are no axes U, V, W; use G17, G18 or G19"),
    **dict.fromkeys((330, 331), _LATHE),
    **dict.fromkeys((382, 383, 384, 385), _PROBE),
    432: "adding up tool offsets is outside this dialect; give the sum with G43.1 and axis words",
    520: "G52 is outside this dialect; shift the origin with G92 or G10 L2",
    **dict.fromkeys((700, 710, 711, 712, 720, 721, 722, 760), _LATHE),
    **dict.fromkeys((730, 740, 810, 820, 830, 840, 850, 860, 870, 880, 890), _CYCLES),
    **dict.fromkeys((980, 990), "it sets where canned cycles retract to, and there are none here; leave it away"),
    960: "constant surface speed is outside this dialect; program revolutions per minute with S",
    970: "S is in revolutions per minute here always; leave G97 away",
}
_M = {
    19: "spindle orientation is outside this dialect; leave it away",
    **dict.fromkeys((48, 49, 50, 51, 52, 53), "overrides are the operator's here; leave it away"),
    61: "the number of the tool in the spindle is not set by hand here; write T and M6",
    **dict.fromkeys((62, 63, 64, 65, 66, 67, 68), "inputs and outputs are outside this dialect; leave it away"),
    **dict.fromkeys(
        (70, 71, 72, 73), "saving modal state is outside this dialect; write the modes again where they are needed"
    ),
    98: "subroutines are called by O words here; write O<name> CALL",
    99: "subroutines end with O<name> ENDSUB; programs end with M2 or M30",
}
_LETTERS = {
    **dict.fromkeys("uvw", "there are no axes U, V, W; the axes are X Y Z A B C"),
    "e": "E is outside this dialect; numbers have no exponent, write 0.001 for 1E-3",
    "@": "polar coordinates are outside this dialect; write X and Y, for example X[10*COS[30]]",
    "^": "polar coordinates are outside this dialect; write X and Y, for example X[10*COS[30]]",
    "$": "there is one spindle; leave $ away",
    "n": "a line number stands first on its line; move it there",
    "o": "an O word stands first on its line, after N; write a line of its own, or the digit 0 if that is meant",
    ",": "no word begins with ','; write a decimal point, 10.5, and blanks between words",
    "%": "% stands alone on the first and the last line; remove it here",
    "/": "/ stands first on its line; remove it here",
    ")": "a comment is closed that was not opened; add ( or remove )",
    "]": "a bracket is closed that was not opened; remove ]",
    "[": "a value needs a letter before it; write for example X[...]",
    "=": "only parameters are set with =; write #1 = ...",
    "\x00": "a character 0 does not belong in a program; save the file as plain text",
}

GR_IS_OFF = (
    "GR, the subroutine call of dcs-thesis, is an option of the dialect; switch it on (`--with gr`)"
    " or write O<name> CALL"
)


def no_such_g(code: int) -> str:
    """Why a G word (ten times its number) cannot be used, and what to do."""
    if code < 0:
        return f"G{code / 10:g} is negative; G words are not"
    return _G.get(code, f"there is no G{code / 10:g}; correct the word or leave it away")


def no_such_m(code: int) -> str:
    if code < 0:
        return f"M{code} is negative; M words are not"
    if 100 <= code <= 199:
        return "user-defined M words are outside this dialect; leave it away"
    return _M.get(code, f"there is no M{code}; correct the word or leave it away")


def no_such_letter(letter: str) -> str:
    """Why no word can begin with this character."""
    if letter >= "\x80":
        return "only letters, digits and signs of ASCII make words; remove it or put it into a comment ( )"
    return _LETTERS.get(letter, f"no word begins with {letter!r}; words are a letter and a number, comments ( ) or ;")


def active_comment(name: str) -> str:
    shown = f"({name.upper().replace(',', ', ...')})"
    return f"{shown} is outside this dialect; write a plain comment, (MSG, ...), (DEBUG, ...) or (PRINT, ...)"
