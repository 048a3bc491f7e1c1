"""A block: its words, sorted into modal groups, and whether they go together."""

from __future__ import annotations

from rds.nc.language.expressions import Fault, whole
from rds.nc.language.outside import no_such_g, no_such_m
from rds.nc.language.state import NO_MOTION, State

AXES = "xyzabc"
AXIS_SET = frozenset(AXES)
# Modal groups of RS274NGC, numbered as LinuxCNC does.
NON_MODAL, MOTION, PLANE, DISTANCE, ARC_DISTANCE, FEED_MODE, UNITS, COMPENSATION, TOOL_OFFSET = range(9)
COORDINATES, CONTROL, G92_SERIES = 12, 13, 16
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
    COORDINATES: "coordinate systems",
    CONTROL: "path control",
    G92_SERIES: "G92 modes",
}
# G words by ten times their number.
G_GROUPS: dict[int, int] = {
    **dict.fromkeys((40, 100, 280, 281, 300, 301, 530, 920), NON_MODAL),
    **dict.fromkeys((0, 10, 20, 30, 800), MOTION),
    **dict.fromkeys((170, 180, 190), PLANE),
    **dict.fromkeys((900, 910), DISTANCE),
    **dict.fromkeys((901, 911), ARC_DISTANCE),
    **dict.fromkeys((930, 940, 950), FEED_MODE),
    **dict.fromkeys((200, 210), UNITS),
    **dict.fromkeys((400, 410, 411, 420, 421), COMPENSATION),
    **dict.fromkeys((430, 431, 490), TOOL_OFFSET),
    **dict.fromkeys((540, 550, 560, 570, 580, 590, 591, 592, 593), COORDINATES),
    **dict.fromkeys((610, 611, 640), CONTROL),
    **dict.fromkeys((921, 922, 923), G92_SERIES),
}
STOP, TOOL_CHANGE, SPINDLE, COOLANT = 4, 6, 7, 8
M_GROUPS = {0: STOP, 1: STOP, 2: STOP, 30: STOP, 60: STOP, 6: TOOL_CHANGE, 3: SPINDLE, 4: SPINDLE, 5: SPINDLE} | {
    **dict.fromkeys((7, 8, 9), COOLANT)
}
M_NAMES = {STOP: "stops", TOOL_CHANGE: "tool changes", SPINDLE: "spindle words", COOLANT: "coolant words"}
COVET_AXES = frozenset((100, 280, 300, 920))  # non-modal words that take the block's axis words for themselves
COMPENSATING = frozenset((410, 411, 420, 421))


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
            if non_modal == 920 and not axes:
                raise Fault("G92 without an axis word; write the position that the axes are to have", "g920")
        elif covets:
            raise Fault(
                f"G{non_modal / 10:g} and G{motion / 10:g} on one line both use the axis words; write two lines",
                f"g{motion}",
            )
        block.motion = motion
    elif covets:
        if non_modal == 920 and not axes:
            raise Fault("G92 without an axis word; write the position that the axes are to have", "g920")
    elif axes:
        if g.get(TOOL_OFFSET) != 431:
            if state.motion == NO_MOTION:
                raise Fault(
                    "an axis word and no motion is active; write G0, G1, G2 or G3 before it", _first(words, AXES)
                )
            block.motion = state.motion
    elif state.motion in (20, 30) and not words.keys().isdisjoint("ijk"):
        block.motion = state.motion


def _first(words: dict[str, float], letters: str) -> str:
    return next(letter for letter in words if letter in letters)


# Words that are used only together with others: the letters whose presence is worth a look.
CHECKED = frozenset("dhijklpqr")


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
    if CHECKED.isdisjoint(words):
        return
    users = {
        "d": (compensating in COMPENSATING, "G41, G42, G41.1 or G42.1"),
        "h": (g.get(TOOL_OFFSET) == 430, "G43"),
        "i": (arc or setting, "G2 or G3"),
        "j": (arc or setting, "G2 or G3"),
        "k": (arc, "G2 or G3"),
        "l": (setting or compensating in (411, 421), "G10, G41.1 or G42.1"),
        "p": (non_modal in (40, 100) or g.get(CONTROL) == 640 or arc, "G2, G3, G4, G10 or G64"),
        "q": (g.get(CONTROL) == 640, "G64"),
        "r": (arc or setting, "G2, G3 or G10 L2"),
    }
    for letter in words:
        used, by = users.get(letter, (True, ""))
        if not used and letter == "p" and not g and not block.m and len(words) == 1:
            raise Fault(
                "P alone, a program number of oacs-thesis, is an option of the dialect; switch it on"
                " (`--with program-numbers`) or leave it away",
                letter,
            )
        if not used:
            raise Fault(f"nothing on the line uses {letter.upper()}; it goes with {by}", letter)
    if arc and "p" in words:
        turns = round(words["p"])
        if abs(turns - words["p"]) > 0.001 or turns < 1:
            raise Fault(f"P{words['p']:g} turns; an arc has a whole number of turns from 1", "p")
    if g.get(CONTROL) == 640:
        for letter in "pq":
            if words.get(letter, 0.0) < 0.0:
                raise Fault(f"a tolerance of {words[letter]:g} is negative; write one from 0", letter)


def _check_setting(words: dict[str, float]) -> None:
    kind = words.get("l", -1)
    if kind not in (2, 20):
        if kind in (0, 1, 10, 11):
            raise Fault(
                f"G10 L{kind:g} changes the tool table, which a program cannot do here; edit the tool table's file", "l"
            )
        raise Fault(
            "G10 without L2 or L20; write G10 L2 or G10 L20 with P and axis words", "l" if kind >= 0 else "g100"
        )
    if "p" not in words:
        raise Fault(
            "G10 without P; write which coordinate system to set, P1 (G54) to P9 (G59.3), P0 the active", "g100"
        )
    system = int(words["p"] + (0.5 if words["p"] >= 0 else -0.5))
    if abs(words["p"] - system) > 0.0001 or not 0 <= system <= 9:
        raise Fault(f"P{words['p']:g} is no coordinate system; write P1 (G54) to P9 (G59.3), P0 the active", "p")
    for letter in "ij":
        if letter in words:
            raise Fault(f"G10 L{kind:g} does not use {letter.upper()}; leave it away", letter)
    if kind == 20 and "r" in words:
        raise Fault("G10 L20 does not use R; set the rotation with G10 L2", "r")
