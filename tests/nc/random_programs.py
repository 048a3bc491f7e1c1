"""Random part programs, most of them right and some wrong, over every word of the dialect."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count
from random import Random


def _words(text: str) -> list[str]:
    return text.split()


_AXES_OF = {"IJ": "XY", "IK": "XZ", "JK": "YZ"}
_PLANE_OF = {"IJ": "G17", "IK": "G18", "JK": "G19"}
_VALUES = _words(
    "#1 #2 -#1 #<a> #[1+1] #31 sin[30] -cos[60] tan[45] sqrt[2] abs[-3] atan[1]/[2] fix[2.7] fup[2.2] round[-2.5]"
    " exp[1] ln[2] acos[.3] asin[.4] exists[#<a>] exists[#<zz>] cos[90] sin[180]"
)
_OPERATIONS = _words("mod ** / eq ne gt ge lt le and or xor + - *")
_MODES = _words(
    "G17 G18 G19 G90 G91 G91 G90 G91.1 G90.1 G91.1 G94F50 G95F1 G94F20 G93 G61 G61.1 G64 G54 G55 G59.3 G59 G59.1"
    " G80G0 G40 G49 G92.1 G92.2 G92.3 G28.1 G30.1 M3 M4 M5 M7 M8 M9 M0 M1 M60"
)
_MORE_MODES = _words(
    "G98 G99 G98 G99 G7 G8 G96S50D200 G96S20 G97S300 M48 M49 M50P0 M51P1 M52P1 M53P0 M19R30 M62P1 M63P2 M64P0 M65P3"
    " M19Q1 M19R9P2Q.5 M67E1Q2 M68E0Q-3 M66P1L0 M66E1 M70 M71 M70 M72 G43.2H1 G5.3 G10L1P2Z3"
)
_WRONG = _words(
    "X Y1Y2 G0G1 G90G91 M3M4 X+-5 X1.2.3 X. X1e5 D5 H1 Q1 L2 P1 R5 I1 K2 G1.5 G2.05 M99999 M-1 G-1 T99 T2.5 S-1 F-1"
    " X[1 X1] X[1+] X[/2] X#0 X#6000 #5400=1 #1= #1 % X(1)2 (unclosed (a(b)c) X[1/0] Xsqrt[-1] Xacos[2] Xln[0]"
    " X[0**-1] X[-2**.5] N-5 X1/ G92 G53 G4 G4P-1 G10 G10L2 G10L2P10 G10L2P1I1 G10L20P1R1 G10L5P1 G28G0X1 G1G92X1"
    " G80X1 G2I1R1 G43H G43H99 G41D99 #<a> X#<undefined> #<_x>=1 exists X1=2 G59.15 o1endif o1endsub o1break o1else"
    " o1call o1while o1continue"
)
_ODD = _words("X--5 /X1 X##1 X#[#1+1] X-[3] X+[3] X-#1 G0.99999 G54.0001 M3.00001")
_COMMENTS = [
    *(
        "(a comment)",
        "( spaced  Text )",
        "(MSG, hello)",
        "(debug, #1 #<a> %d#5220)",
        "(print, #2 %.2f#<a>)",
        "(msg,Hi There)",
        "; rest (of) line",
        "X1 (a) Y2 (b)",
    ),
    *("G0 ; c", "()", "(é)"),
    "(print, #<_lathe_diameter_mode> #<_retract_old_z> #<_spindle_css_mode> #<_speed_override> #<_feed_override>)",
    "(print, #<_adaptive_feed> #<_feed_hold> #<_lathe_radius_mode> #<_retract_r_plane> #<_task> #<_vmajor> #<_u>)",
]


def number(r: Random) -> str:
    """A value as programs spell it: digits, a parameter, a function, an expression."""
    digits = f"{round(r.uniform(-20, 20), r.choice([0, 1, 2, 3, 4])):g}"
    if "e" in digits:
        digits = "0"
    way = r.randrange(20)
    if way < 13:
        return digits
    if way < 14:
        return digits if digits.startswith("-") else f"+{digits}"
    if way < 15:
        return digits if "." in digits else f"{digits}."
    if way < 17:
        return f"[{digits} {r.choice(_OPERATIONS)} {r.choice(['2', '3', '.25', '[1+2]', '#1'])}]"
    return r.choice(_VALUES)


def axes(r: Random, letters: str = "XYZABC", often: float = 0.4) -> list[str]:
    return [letter + number(r) for letter in letters if r.random() < often]


def line(r: Random, words: list[str]) -> str:
    return r.choice([" ", "", "  "]).join(word if r.random() < 0.8 else word.lower() for word in words)


def straight(r: Random) -> str:
    words = [r.choice(["G0", "G1", "G01", "", "G1"]), *axes(r, "XYZ", 0.6), *axes(r, "ABC", 0.15)]
    if r.random() < 0.3:
        words.append(f"F{r.choice(['100', '250.5', '10'])}")
    if r.random() < 0.05:
        r.shuffle(words)
    return line(r, words)


def arc(r: Random) -> str:
    centre = r.choice(["IJ", "IJ", "IJ", "IK", "JK"])
    words = [r.choice(["G2", "G3", "G02"])] + ([_PLANE_OF[centre]] if r.random() < 0.95 else [])
    way = r.randrange(20)
    if way < 7:  # a full circle, perhaps with more turns
        words += [centre[0] + number(r), centre[1] + number(r), *axes(r, "Z", 0.3)]
        if r.random() < 0.2:
            words.append(f"P{r.choice(['1', '2', '3', '1.0', '0', '1.5'])}")
    elif way < 12:  # half a circle
        radius = r.choice([1, 2.5, 5, 10, 0.01])
        first, second = _AXES_OF[centre]
        words += [f"{first}{2 * radius:g}", f"{second}0", f"{centre[0]}{radius:g}", f"{centre[1]}0", *axes(r, "A", 0.2)]
        if r.random() < 0.95:
            words.insert(0, "G91")
    elif way < 19:
        words += [*axes(r, "XYZ", 0.8), f"R{r.choice(['100', '-60.5', '[50+#1]', '200', '-90', '12'])}"]
        if r.random() < 0.2:
            words.append("P2")
    else:
        words += axes(r, "XYZIJKR", 0.5)
    if r.random() < 0.2:
        words.append("F200")
    return line(r, words)


_EACH = {"G73": "Q", "G74": "P", "G82": "P", "G83": "Q", "G84": "P", "G86": "P", "G87": "IJK", "G88": "P", "G89": "P"}
_GIVEN = {"Q": ["2", "5", ".7"], "P": ["0.5", "1", "0"], "I": ["1", "-2"], "J": ["0", "3"], "K": ["2", "-1"]}


def cycle(r: Random) -> str:
    """A line of a canned cycle, in each plane, whole or leaving words to the line before."""
    code = r.choice(["G73", "G74", "G81", "G81", "G82", "G83", "G83", "G84", "G85", "G86", "G87", "G88", "G89", ""])
    tapping = code in ("G74", "G84")  # in other planes rs274 goes elsewhere
    plane, deep = (
        ("G17", "Z") if tapping else r.choice([("", "Z"), ("", "Z"), ("G17", "Z"), ("G18", "Y"), ("G19", "X")])
    )
    words = [plane, code, f"{deep}{r.choice(['-5', '-2.5', '-10', number(r)])}", f"R{r.choice(['2', '1', '30', '-1'])}"]
    words += [letter + r.choice(_GIVEN[letter]) for letter in _EACH.get(code, "") if r.random() < 0.9]
    words += axes(r, "".join(letter for letter in "XYZ" if letter != deep), 0.6)
    if r.random() < 0.2:
        words.append(f"L{r.choice(['1', '2', '3', '0'])}")
    if code and r.random() < 0.1:
        words.insert(0, r.choice(["M3", "M4", "G91", "G90", "G98", "G99"]))
    words = [word for word in words if word and r.random() < 0.96]
    first = "M3 F100\n" if code in ("G84", "G86", "G87", "G88") and r.random() < 0.8 else ""
    return first + line(r, words)


def rare(r: Random) -> str:
    """Polar ends, shifts, threads, splines, probing, and modes besides the usual."""
    way = r.randrange(8)
    if way == 0:
        return line(r, [r.choice(["G0", "G1", "G17 G0"]), f"@{number(r)}", f"^{number(r)}", *axes(r, "Z", 0.2)])
    if way == 1:
        return line(r, [r.choice(["G0", "G1", "G17 G1"]), r.choice(["@", "^"]) + number(r)])
    if way == 2:
        return line(r, ["G52", *axes(r)])
    if way == 3:
        return "M3\n" + line(r, [r.choice(["G33", "G33", "G33.1"]), "K1.5", *axes(r, "XYZ", 0.5)])
    if way == 4:
        taper = r.choice(["", "E2 L3", "E1 L1", "E.5 L2"])
        more = r.choice(["", "Q29.5", "R2", "H2 Q30", "R1.5"])
        return f"M4 G8\nG76 P1.5 Z{number(r)} I{r.choice(['-1', '2'])} J.3 K1.1 {taper} {more}"
    if way == 5:
        first = "G17 G94 F100\n"
        return first + r.choice(
            ["G5 X1 Y2 I1 J1 P-1 Q1", "G5.1 X3 Y1 I2 J0", "G5.2 X1 Y1 P1\nX2 Y0 P2\nX3 Y3 P1\nG5.3"]
        )
    if way == 6:
        place = "G49 G94 F100\nG0 X1 Y2 Z3\n"  # rs274 backs off towards where its last move without an offset ended
        return place + line(r, [r.choice(["G38.2", "G38.3", "G38.4", "G38.5"]), *axes(r, "XYZ", 0.5)])
    return line(r, [r.choice(_MORE_MODES) for _ in range(r.choice([1, 1, 2]))])


def modes(r: Random, units: bool) -> str:
    known = _MODES + (["G20", "G21"] if units else ["G43", "G43H1", "G43H2", "G43H0", "G43H7"])
    words = [r.choice(known) for _ in range(r.choice([1, 1, 1, 2, 3]))]
    if r.random() < 0.1:
        words += axes(r)
    if r.random() < 0.2:
        words.append(f"F{r.choice(['100', '50', '12.5', '75', '0'])}")
    if r.random() < 0.2:
        words.append(f"S{r.choice(['100', '0'])}")
    return line(r, words)


def special(r: Random, units: bool) -> str:
    way = r.randrange(14)
    words = {
        0: lambda: ["G92", *axes(r)],
        1: lambda: ["G10", "L2", f"P{r.randrange(10)}", *axes(r), *axes(r, "R", 0.2)],
        2: lambda: ["G10", "L20", f"P{r.choice([0, 1, 2])}", *axes(r)],
        3: lambda: ["G28", *axes(r, often=0.2)],
        4: lambda: ["G30", *axes(r, often=0.2)],
        5: lambda: ["G53", r.choice(["G0", "G1", "G0", ""]), *axes(r)],
        6: lambda: ["G4", f"P{r.choice(['0.5', '1', '0', '.25'])}", *r.choice([[], ["G1", "X1"], ["M3"]])],
        7: lambda: ["G64", f"P{r.choice(['0.1', '0', '.01'])}", *r.choice([[], ["Q0.1"]])],
        8: lambda: ["S200"] if units else ["G43.1", *axes(r, "XYZ", 0.5)],
    }
    if way in words:
        return line(r, words[way]())
    if way == 9:
        return r.choice(_COMMENTS)
    if way == 10:
        return f"#{r.choice(['1', '2', '31', '[30+1]', '5'])}={number(r)}" + (
            f" #2={number(r)}" if r.random() < 0.3 else ""
        )
    if way == 11:
        return f"#<{r.choice(['a', 'b', '_g', 'A b'])}>={number(r)}"
    if way == 12:
        more = ["", "A#<_plane>", "B#<_coord_system>", "C#<_motion_mode>", "C#<_abs_x>"]
        return f"X#<_x> Y#5420 Z[#<_absolute>+#<_feed>] {r.choice(more)}"
    return f"N{r.choice(['10 ', '5', '012', '7.5'])} {straight(r)}"


def flow(r: Random, units: bool, depth: int, labels: Iterator[int], breaks: bool) -> list[str]:
    """A branch, a loop or, outside of others, a subroutine and its call."""
    label = f"o{next(labels)}"
    counter = f"#{40 + int(label[1:])}"

    def inside() -> list[str]:
        return blocks(r, units, depth - 1, labels, breaks, r.randrange(4))

    way = r.choice(["if", "while", "repeat", "sub", "if"] if breaks else ["if", "while", "repeat", "sub", "do"])
    if way == "if":
        lines = [f"{label} if [{number(r)} gt 0]", *inside()]
        if r.random() < 0.4:
            lines += [f"{label} elseif [{number(r)} lt 3]", *inside()]
        if r.random() < 0.5:
            lines += [f"{label} else", *inside()]
        return [*lines, f"{label} endif"]
    if way == "while":
        leave = [f"{label} {r.choice(['continue', 'break'])}"] if breaks and r.random() < 0.4 else []
        rounds = f"[{counter} lt {r.randrange(4)}]"
        lines = [f"{counter}=0", f"{label} while {rounds}", f"{counter}=[{counter}+1]", *inside(), *leave, *inside()]
        return [*lines, f"{label} endwhile"]
    if way == "repeat":
        return [f"{label} repeat [{r.choice(['0', '1', '2', '3', '-1', '1.5'])}]", *inside(), f"{label} endrepeat"]
    if way == "do":
        rounds = f"[{counter} lt {r.randrange(4)}]"
        return [f"{counter}=0", f"{label} do", f"{counter}=[{counter}+1]", *inside(), f"{label} while {rounds}"]
    if depth < 3:
        return [straight(r)]
    name = r.choice([label, f"o<s{label[1:]}>", f"o<S {label[1:]}>"])
    saves = r.choice([[], [], [], ["M73"], ["M70"], ["M73", "G91", "M70"]])
    lines = [f"{name} sub", *saves, "g0 x#1 y#2", *inside()]
    if r.random() < 0.2:
        lines += [f"{name} return [#1]", *inside()]
    lines += [f"{name} endsub{r.choice(['', ' [3]'])}", *inside()]
    arguments = " ".join(f"[{number(r)}]" for _ in range(r.randrange(4)))
    return [*lines, f"{name} call {arguments}", "g0 x#<_value> y#<_value_returned>"]


def blocks(r: Random, units: bool, depth: int, labels: Iterator[int], breaks: bool, size: int) -> list[str]:
    lines: list[str] = []
    for _ in range(size):
        way = r.randrange(100)
        if way < 32:
            lines.append(straight(r))
        elif way < 40:
            lines.append(arc(r))
        elif way < 47:
            lines.append(cycle(r))
        elif way < 52:
            lines.append(rare(r))
        elif way < 66:
            lines.append(modes(r, units))
        elif way < 84:
            lines.append(special(r, units))
        elif way < 96 and depth:
            lines += flow(r, units, depth, labels, breaks)
        elif way < 97:
            lines.append(r.choice(_WRONG))
        else:
            lines.append(r.choice(_ODD))
    return lines


def program(r: Random) -> bytes:
    """A program of up to some dozens of lines.

    Left out is where this interpreter goes other ways than rs274 on purpose (docs/part-programs.md): a change of units
    with a tool offset, M6 after one, and a DO loop in a program that leaves a loop by BREAK.
    """
    units, breaks = r.random() < 0.5, r.random() < 0.5
    lines: list[str] = []
    if r.random() < 0.95:
        lines += ["G1 F100 S50 G17", "#1=1", "#2=2", "#<a>=3"]
    if not units:
        lines.append(r.choice(["T2 M6", "T1", "T7 M6", "T2", "M5 T1 M6", ""]))
    lines += blocks(r, units, 3, count(1), breaks, r.randrange(1, 14))
    ending = r.choice(["M2", "M30", "m2 (end)"])
    if r.random() < 0.1:
        lines = ["%", *lines, r.choice(["M2\n%", "%", "M2"])]
    else:
        lines.append(ending)
    return ("\n".join(lines) + r.choice(["\n", ""])).encode()


_PLAIN_COMMENTS = [
    "(a hole)",
    "( Spaced  out )",
    "()",
    "( )",
    "(x1;y2)",
    "; to the end (of) it",
    "(msg, Hi)",
    "(log)",
    "(a,b)",
]


def _plain(r: Random) -> str:
    return r.choice(["0", "1.5", "-2", "4", f"{r.uniform(-20, 20):.3f}", f"{r.randrange(-9, 30)}."])


_DEEP = {"G17": "Z", "G18": "Y", "G19": "X"}


def _plain_cycle(r: Random, plane: str, turning: str, taps: bool) -> list[str]:
    """A canned cycle, most often whole; one line in five leaves a word out, or has one that it must not have."""
    known = ["G73", "G81", "G81", "G82", "G83", "G85", "G89", "", "", ""]
    known += {"M3": ["G84", "G86", "G87", "G88"], "M4": ["G74", "G86"], "M5": []}[turning]
    if not taps:  # in other planes rs274 goes elsewhere
        known = [code for code in known if code not in ("G74", "G84")]
    code, deep = r.choice(known), _DEEP[plane]
    words = [code, *(letter + _plain(r) for letter in "XYZ" if letter != deep and r.random() < 0.7)]
    if code or r.random() < 0.2:
        words += [f"R{r.choice(['2', '1', '5.5', '0'])}", f"{deep}{r.choice(['-5', '-2.5', '-.5'])}"]
        words += [letter + r.choice(_GIVEN[letter]) for letter in _EACH.get(code, "")]
    if r.random() < 0.1 and code != "G74":
        words.append(f"L{r.choice(['1', '2', '3', '3.0'])}")
    if r.random() < 0.03:
        words[r.randrange(len(words))] = r.choice(["", "A1", "P1", "Q1", "I1", "R9", "L0"])
    return words


def _plain_line(r: Random, plane: str, turning: str, taps: bool) -> list[str]:
    """The words of one of those that the fast lane reads, or nearly."""
    way = r.randrange(20)
    if way < 10:
        return _plain_cycle(r, plane, turning, taps)
    if way < 14:
        return [r.choice(["G0", "G1"]), *(letter + _plain(r) for letter in "XYZ" if r.random() < 0.5)]
    if way < 15:
        return ["G17", r.choice(["G2", "G3"]), r.choice(["X4 Y0 R5", "X0 Y4 R15", "I3", "I2 J1 Z4"])]
    if way < 16:
        return [r.choice(["G4 P.5", "G80", "G4 P1 M8"])]
    words = ["G98", "G99", "G90", "G91", "M3", "M4", "M5", "M7", "M8", "M9", *(["G17"] if taps else _DEEP)]
    return [r.choice(words) for _ in range(r.choice([1, 1, 2]))]


def plain_program(r: Random) -> bytes:
    """A program of lines with plain numbers only, with canned cycles, and comments in every place."""
    taps, turning = r.random() < 0.5, r.choice(["M3", "M4"])
    plane = "G17" if taps else r.choice(list(_DEEP))
    path = r.choice(["", "G61", "G61.1", "G64 P0.0123 Q.004", "G64 P.5"])
    lines = [f"{r.choice(['G20', 'G21'])} {plane} F100 S50 {turning}", path, f"G0 Z{r.choice(['5', '0', '9'])} Y3 X1"]
    for _ in range(r.randrange(3, 20)):
        words = _plain_line(r, plane, turning, taps)
        plane = next((word for word in reversed(words) if word in _DEEP), plane)
        turning = next((word for word in words if word in ("M3", "M4", "M5")), turning)
        if r.random() < 0.2:
            words.append(f"F{r.choice(['100', '50', '12.5'])}")
        if r.random() < 0.1:
            words.append(f"S{r.choice(['100', '0', '12.25'])}")
        if r.random() < 0.1:
            r.shuffle(words)
        for _ in range(r.choice([0, 0, 0, 1, 1, 2])):
            words.insert(r.randrange(len(words) + 1), r.choice(_PLAIN_COMMENTS))
        if r.random() < 0.1:
            words.insert(0, r.choice(["N10", "N0020", "n5"]))
        lines.append(line(r, [word for word in words if word]))
    return "\n".join([*lines, "M2", ""]).encode()
