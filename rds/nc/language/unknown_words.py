"""Words of RS274NGC and other dialects that this one does not have: what to write instead."""

from __future__ import annotations

import re

_G = {
    110: "G11 ends programmable data input of other controls; leave it out, G10 needs no end here",
    120: "G12 mills a circular pocket clockwise on other controls; write the circle as G2 with I and J",
    121: "G12.1 begins polar interpolation of other controls; write X and Y",
    130: "G13 mills a circular pocket on other controls; write the circle as G3 with I and J",
    150: "G15 ends polar coordinates of other controls; @ and ^ give radius and angle here, leave G15 away",
    160: "G16 begins polar coordinates of other controls; write radius and angle as @ and ^, or X and Y",
    **dict.fromkeys((171, 181, 191), "there are no axes U, V, W; use G17, G18 or G19"),
    270: "G27 checks the reference point of other controls; leave it out",
    282: "G28.2 homes the axes of TinyG and g2; home the machine before the program, and leave it out",
    283: "G28.3 sets the position of TinyG and g2; write G92, or G10 L20 P0",
    284: "G28.4 homes the axes of TinyG and g2; home the machine before the program, and leave it out",
    290: "G29 goes back from the reference point on other controls; write the position with G0",
    310: "G31 is the skip (probing) of other controls; write G38.2",
    320: "G32 cuts a thread on other controls; write G33 with K, the way for each turn",
    500: "G50 ends scaling, or limits the spindle on lathes of other controls; leave it out (D of G96 limits it)",
    510: "G51 scales the coordinates on other controls; let the CAM program scale them, or use parameters",
    541: "G54.1 P takes further coordinate systems of Fanuc's controls; write G54 to G59.3",
    600: "G60 goes to a place from one side on other controls; write G61.1 and the moves",
    650: "G65 calls a macro of other controls; write O<name> CALL [...]",
    660: "G66 calls a macro after each move on other controls; write O<name> CALL after them",
    670: "G67 ends G66 of other controls; leave it out",
    680: "G68 turns the coordinates on other controls; write G10 L2 P0 R and the angle",
    690: "G69 ends G68 of other controls; write G10 L2 P0 R0",
    750: "G75 cuts grooves on other controls; write its cuts as G0 and G1",
    770: "G77 is a turning cycle of other controls; write its cuts as G0 and G1",
    780: "G78 is a threading cycle of other controls; write G76 or G33",
    1030: "G103 limits the look-ahead of Haas' controls; leave it out, motion is always planned ahead here",
    1870: "G187 sets the smoothness of Haas' controls; write G64 P and how far corners may be off the path",
}
_M = {
    10: "M10 clamps an axis on other controls; leave it out",
    11: "M11 releases an axis on other controls; leave it out",
    17: "M17 ends a subroutine of Siemens' controls; write M99, or O<name> ENDSUB",
    29: "M29 announces rigid tapping on Fanuc's controls; leave it out, and write S and M3 before G84",
    97: "M97 calls part of a program on other controls; write O<name> CALL",
    82: "M82 counts the filament of 3-D printers absolutely; let a CAM program write the part for a mill",
    83: "M83 counts the filament of 3-D printers from move to move; let a CAM program write the part for a mill",
    98: "M98 stands first on its line; write M98 P and the program's number on a line of its own",
}
_LETTERS = {
    **dict.fromkeys("uvw", "there are no axes U, V, W; the axes are X Y Z A B C"),
    "$": (
        "words that begin with $ are settings and commands of a sender or of Grbl ($H homes, $X unlocks, $J= jogs), not"
        " of a part program; home the machine before the program, and remove the line"
    ),
    "?": "? asks a Grbl board for its status; it is no part of a program, remove it",
    "!": "! is the feed hold of a Grbl board; it is no part of a program, remove it",
    "~": "~ is the cycle start of a Grbl board; it is no part of a program, remove it",
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

FANUC_MACRO = (
    "IF, WHILE, DO, END and GOTO alone are Fanuc's macro language; write O1 IF [...] and O1 ENDIF, O1 WHILE [...] and"
    " O1 ENDWHILE on lines of their own"
)
_SIEMENS = (
    "this is the language of Siemens' controls, which is not read here; have the part's program written for LinuxCNC:"
    " R1 = 5 is #1 = 5 here, CR=5 is R5, TRANS is G52, MSG(...) is (MSG, ...), CYCLE81(...) is G81"
)
_HEIDENHAIN = (
    "this is Heidenhain's conversational language, which is not read here; have the part's program written for"
    " LinuxCNC: L X+10 R0 F200 is G1 X10 F200 here"
)
_KLIPPER = "this is a command of Klipper, which runs 3-D printers; let a CAM program write the part for a mill"
_NO_LABEL = (
    "the O word that this word of a branch, a loop or a subroutine belongs to is missing; write it before, as O1 ENDIF"
    " for O1 IF"
)
_PRINTED = "DPRNT, BPRNT, POPEN and PCLOS print on Fanuc's controls; write (PRINT, ...)"
# Of lines that cannot be read, without blanks and in lower case: what they are the language of, in order.
_LANGUAGES = tuple(
    (re.compile(pattern), said)
    for pattern, said in (
        (
            r"[0-9]*(?:(?:begin|end)pgm|tool(?:call|def)|cycl(?:call|def)|call(?:lbl|pgm)|blkform|[lc]{1,2}[xyz][-+])",
            _HEIDENHAIN,
        ),
        (
            r"(?:exclude_object|set_[a-z_]+|bed_mesh|timelapse|[a-z]+_(?:print|start|end)\b|print_(?:start|end)"
            r"|[a-z]+_[a-z_]+[a-z](?:[a-z_]+=|$))",
            _KLIPPER,
        ),
        (
            r"(?:n[0-9]+)?(?:a?(?:trans|rot|scale|mirror)(?:$|[;xyzr])|cycle[0-9]+\(|mcall|msg\(|r[0-9]+="
            r"|def(?:real|int|bool|string)|goto[bfc]|(?:pocket|slot|holes)[0-9]\(|if[r$])"
            r"|[^(;<#$]*(?:[a-z]{2}=|[a-z][0-9]*=[a-z\"])",
            _SIEMENS,
        ),
        (r"(?:n[0-9]+)?(?:[bd]prnt\[|popen$|pclos$)", _PRINTED),
        (
            r"(?:n[0-9]+)?(?:else(?:$|[(;]|if\[)|end(?:if|while|repeat|sub)|(?:sub|return|break|continue|call)(?:$|[(;\[])"
            r"|repeat\[)",
            _NO_LABEL,
        ),
        (r"(?:n[0-9]+)?(?:if\[|while\[|goto|do[0-9]|end[0-9])", FANUC_MACRO),
    )
)
OLD_LINE_ENDS = "its lines end with CR alone, so that they are one; save the file with line ends LF, or CR LF"

LOOK_AHEAD = "switches look-ahead on Fanuc's controls; leave it out, motion is always planned ahead here"
REPEATS = "K says on Fanuc's controls how often a cycle is repeated; write L"
EXTRUDER = (
    "E on a move is the filament of a 3-D printer, which no machine here has; let a CAM program write the part for a"
    " mill"
)
GR_IS_OFF = (
    "GR, the subroutine call of dcs-thesis, is an option of the dialect; switch it on (`--with gr`)"
    " or write O<name> CALL"
)


def no_such_g(code: int) -> str:
    """Why a G word (ten times its number) cannot be used, and what to do."""
    if code < 0:
        return f"G{code / 10:g} is negative; G words are not"
    return _G.get(code, f"there is no G{code / 10:g}; correct the word or leave it out")


def no_such_m(code: int) -> str:
    if code < 0:
        return f"M{code} is negative; M words are not"
    if 100 <= code <= 199:
        return "user-defined M words, and those of 3-D printers, are outside this dialect; leave it out"
    return _M.get(code, f"there is no M{code}; correct the word or leave it out")


FANUC_CONTOUR = (
    "goes with the form of G70 to G73 that Fanuc's lathes have, of which G71 U R (G72 W R) and then G71 P Q U W are"
    " known; else the contour is a subroutine (O100 SUB, its moves, O100 ENDSUB) and the cycle one line: G71 Q100 I1.5"
    " D0.2 R0.5 (I deep each cut, D left on the contour, R back out), then G70 Q100"
)
_FANUC_CYCLE = re.compile(r"g7[0-3](?![0-9])")


def other_language(line: str) -> str | None:
    """What to say of a line, without blanks and in lower case, that is of another control's language; None: of none."""
    return next((said for pattern, said in _LANGUAGES if pattern.match(line)), None)


_CORNER = re.compile(r",[rca][-+0-9.#\[]")


def no_such_letter(letter: str, line: str = "") -> str:
    """Why no word can begin with this character, on this line in lower case."""
    if letter in "uw" and _FANUC_CYCLE.search(line):
        return f"{letter.upper()} {FANUC_CONTOUR}"
    if letter == "," and _CORNER.search(line):
        return ",R and ,C round and break corners on other controls; write the arc, or the line, of the corner itself"
    if letter in "+-*/" and line.startswith("#"):
        return "an expression stands in brackets; write for example #1 = [#1 + 1]"
    if letter == ":" and line[1:2].isdigit():
        return f"a program's number begins with O here; write O{line[1:]}"
    if letter >= "\x80":
        return "only letters, digits and signs of ASCII make words; remove it or put it into a comment ( )"
    return _LETTERS.get(letter, f"no word begins with {letter!r}; words are a letter and a number, comments ( ) or ;")


def active_comment(name: str) -> str:
    shown = f"({name.upper().replace(',', ', ...')})"
    if name.lower().startswith("abort"):
        return f"{shown} is outside this dialect; write (MSG, ...), and M2 on the next line, which ends the program"
    return f"{shown} is outside this dialect; write a plain comment, (MSG, ...), (DEBUG, ...) or (PRINT, ...)"
