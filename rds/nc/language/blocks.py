"""A block: its words, sorted into modal groups, and whether they go together."""

from __future__ import annotations

from rds.nc.language.expressions import Fault, whole
from rds.nc.language.state import NO_MOTION, XY, State
from rds.nc.language.unknown_words import EXTRUDER, FANUC_CONTOUR, LOOK_AHEAD, REPEATS, no_such_g, no_such_m

AXES = "xyzabc"
AXIS_SET = frozenset((*AXES, "@", "^"))  # @ and ^: radius and angle of a polar end
# Modal groups of RS274NGC, numbered as LinuxCNC does.
NON_MODAL, MOTION, PLANE, DISTANCE, ARC_DISTANCE, FEED_MODE, UNITS, COMPENSATION, TOOL_OFFSET = range(9)
RETRACT, COORDINATES, CONTROL, SPINDLE_MODE, DIAMETER, G92_SERIES = 10, 12, 13, 14, 15, 16
GROUP_NAMES = {
    NON_MODAL: "non-modal words",
    MOTION: "motion",
    PLANE: "planes",
    DISTANCE: "distance modes",
    ARC_DISTANCE: "arc distance modes",
    FEED_MODE: "feed modes",
    UNITS: "length units",
    COMPENSATION: "cutter compensation",
    TOOL_OFFSET: "tool length offsets",
    RETRACT: "retract modes",
    COORDINATES: "coordinate systems",
    CONTROL: "path control",
    SPINDLE_MODE: "spindle modes",
    DIAMETER: "radius and diameter modes",
    G92_SERIES: "G92 modes",
}
CYCLES = frozenset((730, 740, *range(810, 900, 10)))  # canned
PROBES = frozenset((382, 383, 384, 385))
TURNING = frozenset((700, 710, 711, 712, 720, 721, 722))  # lathe cycles along a contour
# G words by ten times their number.
G_GROUPS: dict[int, int] = {
    **dict.fromkeys((40, 53, 100, 280, 281, 300, 301, 520, 530, 920), NON_MODAL),
    **dict.fromkeys((0, 10, 20, 30, 50, 51, 52, 330, 331, 760, 800, *PROBES, *CYCLES, *TURNING), MOTION),
    **dict.fromkeys((170, 180, 190), PLANE),
    **dict.fromkeys((900, 910), DISTANCE),
    **dict.fromkeys((901, 911), ARC_DISTANCE),
    **dict.fromkeys((930, 940, 950), FEED_MODE),
    **dict.fromkeys((200, 210), UNITS),
    **dict.fromkeys((400, 410, 411, 420, 421), COMPENSATION),
    **dict.fromkeys((430, 431, 432, 434, 490), TOOL_OFFSET),
    **dict.fromkeys((980, 990), RETRACT),
    **dict.fromkeys((960, 970), SPINDLE_MODE),
    **dict.fromkeys((70, 80), DIAMETER),
    **dict.fromkeys((540, 550, 560, 570, 580, 590, 591, 592, 593), COORDINATES),
    **dict.fromkeys((610, 611, 640), CONTROL),
    **dict.fromkeys((921, 922, 923), G92_SERIES),
}
STOP, SIGNALS, TOOL_CHANGE, SPINDLE, COOLANT, OVERRIDES = 4, 5, 6, 7, 8, 9
M_GROUPS = {
    **dict.fromkeys((0, 1, 2, 30, 60, 99), STOP),
    **dict.fromkeys((62, 63, 64, 65, 66, 67, 68), SIGNALS),
    **dict.fromkeys((6, 61), TOOL_CHANGE),
    **dict.fromkeys((3, 4, 5, 19, 70, 71, 72, 73), SPINDLE),
    **dict.fromkeys((7, 8, 9), COOLANT),
    **dict.fromkeys((48, 49, 50, 51, 52, 53), OVERRIDES),
}
M_NAMES = {
    STOP: "stops",
    SIGNALS: "inputs and outputs",
    TOOL_CHANGE: "tool changes",
    SPINDLE: "spindle words or saved modes",
    COOLANT: "coolant words",
    OVERRIDES: "overrides",
}
COVET_AXES = frozenset((100, 280, 300, 520, 920))  # non-modal words that take the block's axis words for themselves
COMPENSATING = frozenset((410, 411, 420, 421))
_WITHOUT_AXES = frozenset((0, 10, 20, 30, 52, *TURNING))  # words of motion that may stand without axis words


class Block:
    """A block that has been read: values by letter, G words (times ten) and M words by modal group.

    `motion` is the G word of the move to make, -1 for none; `comment` the text of the last comment in parentheses.
    """

    __slots__ = ("comment", "g", "m", "motion", "words")

    def __init__(self) -> None:
        self.words: dict[str, float] = {}
        self.g: dict[int, int] = {}
        self.m: dict[int, int] = {}
        self.motion = -1
        self.comment = ""

    def add_g(self, value: float) -> None:
        """Raises Fault for a G word outside the dialect or one of a group that the block has already."""
        tenfold = 10.0 * value
        code = int(tenfold // 1)
        if tenfold - code > 0.999:
            code += 1
        elif tenfold - code > 0.001:
            raise Fault(f"there is no G{value:g}; G words have at most one decimal")
        group = G_GROUPS.get(code)
        if group is None:
            raise Fault(no_such_g(code), f"g{code}")
        before = self.g.get(group)
        if before is None or before == NO_MOTION:
            self.g[group] = code
        elif code != NO_MOTION:
            raise Fault(
                f"G{before / 10:g} and G{code / 10:g} on one line are both {GROUP_NAMES[group]}; leave one of them",
                f"g{code}",
            )

    def add_m(self, value: float) -> None:
        """Raises Fault like add_g."""
        code = whole(value)
        group = M_GROUPS.get(code)
        if group is None:
            raise Fault(no_such_m(code), f"m{code}")
        if group in self.m:
            raise Fault(
                f"M{self.m[group]} and M{code} on one line are both {M_NAMES[group]}; leave one of them", f"m{code}"
            )
        self.m[group] = code

    def add(self, letter: str, value: float) -> None:
        """Any other word. Raises Fault for a second one of its letter or a value that it cannot have."""
        if letter in self.words:
            raise Fault(f"two {letter.upper()} words on one line; leave one", letter)
        if letter in "hlt":
            value = whole(value)
            if value < 0:
                raise Fault(f"{letter.upper()}{value:g} is negative; write a number from 0", letter)
        elif letter in "fs" and value < 0.0:
            raise Fault(f"{letter.upper()}{value:g} is negative; {_INSTEAD[letter]}", letter)
        self.words[letter] = value


_INSTEAD = {"f": "a feed rate is positive", "s": "turn the spindle the other way by M4"}


def settle_motion(block: Block, state: State) -> None:
    """Which move the block makes. Raises Fault when its G words and axis words do not go together."""
    words, g = block.words, block.g
    axes = not AXIS_SET.isdisjoint(words)
    if not g:
        if axes:
            if state.motion == NO_MOTION:
                raise Fault(
                    "an axis word and no motion is active; write G0, G1, G2 or G3 before it", _first(words, AXES)
                )
            block.motion = state.motion
        elif state.motion in (20, 30) and not words.keys().isdisjoint("ijk"):
            block.motion = state.motion
        return
    non_modal, motion = g.get(NON_MODAL, -1), g.get(MOTION, -1)
    covets = non_modal in COVET_AXES
    if motion != -1:
        if motion == NO_MOTION:
            if axes and not covets:
                raise Fault("an axis word with G80, which ends motion; write G0, G1, G2 or G3", _first(words, AXES))
            _check_shift(non_modal, words)
        elif covets:
            raise Fault(
                f"G{non_modal / 10:g} and G{motion / 10:g} on one line both use the axis words; write two lines",
                f"g{motion}",
            )
        elif not axes and motion not in _WITHOUT_AXES:
            spline = f"; without one it {LOOK_AHEAD}" if motion in (50, 51) else ""
            raise Fault(f"G{motion / 10:g} without an axis word; write where it goes{spline}", f"g{motion}")
        block.motion = motion
    elif covets:
        _check_shift(non_modal, words)
    elif axes:
        if g.get(TOOL_OFFSET) not in (431, 432):
            if state.motion == NO_MOTION:
                raise Fault(
                    "an axis word and no motion is active; write G0, G1, G2 or G3 before it", _first(words, AXES)
                )
            block.motion = state.motion
    elif state.motion in (20, 30) and not words.keys().isdisjoint("ijk"):
        block.motion = state.motion


def _check_shift(code: int, words: dict[str, float]) -> None:
    """Raises Fault for G92 or G52 without axis words, or with polar ones."""
    if code not in (520, 920):
        return
    for letter in "@^":
        if letter in words:
            raise Fault(f"{letter} is an end of a move, and G{code // 10} makes none; write X and Y", letter)
    if AXIS_SET.isdisjoint(words):
        what = "the position that the axes are to have" if code == 920 else "by how much the axes are shifted"
        raise Fault(f"G{code // 10} without an axis word; write {what}", f"g{code}")


def _first(words: dict[str, float], letters: str) -> str:
    return next(letter for letter in words if letter in letters or letter in "@^")


# Words that are used only together with others: the letters whose presence is worth a look.
CHECKED = frozenset("dehijklpqr@^")


def check(block: Block, state: State) -> None:
    """Raises Fault for a word that nothing in the block uses, or one that is missing."""
    words, g, motion = block.words, block.g, block.motion
    non_modal = g.get(NON_MODAL, -1)
    arc = motion in (20, 30)
    setting = non_modal == 100
    compensating = g.get(COMPENSATION, -1)
    if non_modal == 40:
        if "p" not in words:
            raise Fault("G4 without P; write the dwell in seconds, G4 P0.5", "g40")
        if arc:
            raise Fault("G4 and an arc on one line would both use P; write two lines", "g40")
        if words["p"] < 0.0:
            raise Fault(f"a dwell of {words['p']:g} s is negative; write seconds from 0", "p")
    elif setting:
        _check_setting(words)
    elif non_modal == 530:
        if motion not in (0, 10):
            raise Fault("G53 needs G0 or G1; write one of them on the line", "g530")
        distance = g.get(DISTANCE, 900 if state.absolute else 910)
        if distance == 910:
            raise Fault("G53 in incremental distance mode; write G90 on a line before", "g530")
    if g.get(SPINDLE_MODE) == 960 and "s" not in words:
        raise Fault("G96 without S; write the surface speed, in m/min (G21) or feet/min (G20)", "g960")
    if motion in (330, 331, 760):
        _check_thread(motion, words)
    if motion in CYCLES:
        for letter in "abc":
            if letter in words:
                raise Fault(f"{letter.upper()} does not go with a canned cycle; turn the axis on a line before", letter)
    if CHECKED.isdisjoint(words):
        return
    signal, sets_modes = block.m.get(SIGNALS, -1), block.m.get(SPINDLE, -1)
    cycle, turning = motion in CYCLES, motion in TURNING
    users = {
        "d": (
            compensating in COMPENSATING or g.get(SPINDLE_MODE) == 960 or turning,
            "G41, G42, G41.1, G42.1, G70 to G72 or G96",
        ),
        "e": (motion in (700, 760) or signal in (66, 67, 68), "G70, G76, M66, M67 or M68"),
        "h": (g.get(TOOL_OFFSET) in (430, 432, 434) or motion == 760, "G43 or G76"),
        "i": (
            arc or setting or motion in (50, 51, 331, 760, 870) or (turning and motion != 700),
            "G2, G3, G5, G33.1, G71, G72, G76 or G87",
        ),
        "j": (arc or setting or motion in (50, 51, 760, 870), "G2, G3, G5, G76 or G87"),
        "k": (arc or motion in (330, 331, 760, 870), "G2, G3, G33, G76 or G87"),
        "l": (
            setting or compensating in (411, 421) or (cycle and motion != 740) or motion in (52, 760) or signal == 66,
            "G10, G41.1, G42.1, G76, M66 or a canned cycle",
        ),
        "p": (
            non_modal in (40, 100)
            or g.get(CONTROL) == 640
            or arc
            or motion in (50, 52, 700, 740, 760, 820, 840, 860, 880, 890)
            or signal in (62, 63, 64, 65, 66)
            or sets_modes == 19
            or block.m.get(OVERRIDES, 0) >= 50,
            "G2, G3, G4, G5, G10, G64, G70, G76, G82, G84, G86, G88, G89, M19 or M50 to M66",
        ),
        "q": (
            g.get(CONTROL) == 640
            or setting
            or motion in (50, 730, 760, 830)
            or turning
            or signal in (66, 67, 68)
            or sets_modes == 19
            or block.m.get(TOOL_CHANGE) == 61,
            "G5, G10, G64, G70 to G73, G76, G83, M19, M61 or M66 to M68",
        ),
        "r": (
            arc or setting or cycle or motion == 760 or sets_modes == 19 or (turning and motion != 700),
            "G2, G3, G10, G71, G72, G76, M19 or a canned cycle",
        ),
        "@": (motion not in (-1, 800), "a move"),
        "^": (motion not in (-1, 800), "a move"),
    }
    for letter in words:
        used, by = users.get(letter, (True, ""))
        if not used and letter == "p" and not g and not block.m and len(words) == 1:
            raise Fault(
                "P alone, a program number of oacs-thesis, is an option of the dialect; switch it on"
                " (`--with program-numbers`) or leave it out",
                letter,
            )
        if not used and letter == "p" and turning:
            raise Fault(f"P {FANUC_CONTOUR}", letter)
        if not used and letter == "e" and motion in (0, 10, 20, 30):
            raise Fault(EXTRUDER, letter)
        if not used and letter == "k" and cycle and motion != 740:
            raise Fault(REPEATS, letter)
        if not used:
            raise Fault(f"nothing on the line uses {letter.upper()}; it goes with {by}", letter)
    if "@" in words or "^" in words:
        _check_polar(words, state)
    if arc and "p" in words:
        turns = round(words["p"])
        if abs(turns - words["p"]) > 0.001 or turns < 1:
            raise Fault(f"P{words['p']:g} turns; an arc has a whole number of turns from 1", "p")
    if g.get(CONTROL) == 640:
        for letter in "pq":
            if words.get(letter, 0.0) < 0.0:
                raise Fault(f"a tolerance of {words[letter]:g} is negative; write one from 0", letter)


def _check_polar(words: dict[str, float], state: State) -> None:
    """Raises Fault for a radius or angle where the plane or the other words do not allow them."""
    key = "@" if "@" in words else "^"
    if state.plane != XY:
        raise Fault(f"{key} goes with the plane of G17 only; write axis words, or G17 on a line before", key)
    for letter in "xy":
        if letter in words:
            raise Fault(f"the end has either {letter.upper()} or @ and ^; leave one away", letter)


def _check_thread(motion: int, words: dict[str, float]) -> None:
    """Raises Fault for a thread (G33, G33.1, G76) that is not told whole."""
    if motion == 760:
        for letter, what in (("p", "the pitch"), ("i", "from where"), ("j", "the first cut"), ("k", "the depth")):
            if letter not in words:
                raise Fault(f"G76 without {letter.upper()}; write {what}: G76 P I J K, and Z", "g760")
    elif "k" not in words:
        raise Fault(f"G{motion / 10:g} without K; write the way for each turn of the spindle", f"g{motion}")
    elif "f" in words:
        raise Fault(f"F does not go with G{motion / 10:g}, whose speed is K times the spindle's; leave it out", "f")


_G10 = "G10 L0, L1, L10, L11 (tool table), L2 or L20 (coordinate system)"


def _check_setting(words: dict[str, float]) -> None:
    kind = words.get("l", -1)
    if kind not in (0, 1, 2, 10, 11, 20):
        raise Fault(f"G10 needs L to say what it sets; write {_G10}", "l" if kind >= 0 else "g100")
    if kind == 0:
        return
    of_system = kind in (2, 20)
    which = (
        "which coordinate system to set, P1 (G54) to P9 (G59.3), P0 the active" if of_system else "the tool's number"
    )
    if "p" not in words:
        raise Fault(f"G10 without P; write {which}", "g100")
    number = int(words["p"] + (0.5 if words["p"] >= 0 else -0.5))
    if abs(words["p"] - number) > 0.0001 or number < 0 or (number > 9 if of_system else number < 1):
        raise Fault(f"P{words['p']:g} is no {'coordinate system' if of_system else 'tool'}; write {which}", "p")
    if not of_system:
        if words.keys().isdisjoint("xyzabcrqij"):
            raise Fault(
                f"G10 L{kind:g} sets nothing; write axis words (offset), R (radius), I, J or Q of the tool", "g100"
            )
        return
    for letter in "ijq":
        if letter in words:
            raise Fault(f"G10 L{kind:g} does not use {letter.upper()}; leave it out", letter)
    if kind == 20 and "r" in words:
        raise Fault("G10 L20 does not use R; set the rotation with G10 L2", "r")
