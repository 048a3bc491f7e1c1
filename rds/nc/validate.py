"""Validation of a part program against a machine (oacs-thesis, section 7.3 and appendices D and E).

Along the whole path, exactly: each axis within its travel; the feed no faster than the slowest axis of those that move;
the spindle within its range; both within what the tool bears; no move of an axis that the machine does not have.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from math import inf
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rds.core.shared_quantities import TIED_FEED
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.segments import AXES, JOINTS, MOVED
from rds.machines import Machine
from rds.nc.extent import extents
from rds.nc.fault_columns import located_at_words
from rds.nc.language.errors import ProgramError
from rds.nc.language.frame import only_rotary
from rds.nc.path_block import BY_PITCH, DefaultFeed
from rds.nc.tool_centre import slowed
from rds.nc.validation import UNITS_OF_AXES, Validation, plain

if TYPE_CHECKING:
    from rds.nc.language.tools import Tool
    from rds.nc.path_block import Event, PathBlock

TOLERANCE = 1e-6  # mm, degrees: beyond the travel by less than this is rounding
LONG_DWELL, LONGEST_DWELL = 60.0, 3600.0  # s; chosen: more may be, and is, a P in milliseconds
MOST_FAULTS = 1000  # are kept; others are counted
MOST_WARNINGS = 100  # are kept
RUNAWAY = 1000  # times that a line has left the travel, each time farther out: its loop is not followed further
_FEED_WORDS = "F G1 G2 G3 G33 G76 G84"
_FASTER = 1.0 + 1e-9  # a feed is too fast by more than rounding
LINEAR, ROTARY = slice(0, 3), slice(3, 6)  # of the axes
_MAX = re.compile(r"\bmax((?:\s+[SF]\s*\d+(?:\.\d*)?)+)", re.IGNORECASE)
_WORD = re.compile(r"([SF])\s*(\d+(?:\.\d*)?)", re.IGNORECASE)


class ToolLimits(NamedTuple):
    """The most that a tool bears; inf where nothing is said."""

    speed: float = inf  # rev/min
    feed: float = inf  # mm/min


def tool_limits(comment: str) -> ToolLimits:
    """The limits in the comment of a tool's line: after the word `max`, S in rev/min and F in mm/min."""
    found = _MAX.search(comment)
    words = {letter.upper(): float(value) for letter, value in _WORD.findall(found[1])} if found else {}
    return ToolLimits(words.get("S", inf), words.get("F", inf))


class Validator:
    """Looks at a program's motion as it goes by, and keeps the faults: of each kind on each line the worst.

    Raises InputError for a machine whose axes have no limits.
    """

    def __init__(self, machine: Machine, tools: Iterable[Tool] = (), name: str = ""):
        self._machine, self._name = machine, name
        self._follows_spindle = False  # after the blocks so far
        self._follow = np.zeros(0, bool)  # of the block being looked at
        self._slowed = False  # a move for the tip is slowed down by a joint
        self._tools = {tool.number: tool_limits(tool.comment) for tool in tools}
        limits = Limits.of(machine)
        self._present = limits.present
        self._velocity = limits.velocity
        axes = [machine.axes[axis] if here else None for axis, here in zip(AXES, self._present, strict=True)]
        self._least = np.array([axis.travel[0] if axis else -inf for axis in axes]) - TOLERANCE
        self._most = np.array([axis.travel[1] if axis else inf for axis in axes]) + TOLERANCE
        self._spindle = next((axis for axis in machine.axes.values() if axis.unit == "rev/min"), None)
        self._worst: dict[tuple[str, int, str], tuple[float, ProgramError, str]] = {}
        self._files: dict[str, int] = {}
        self._leaving: dict[tuple[str, int, int], tuple[int, float]] = {}  # by line and axis: times, and how far
        self._more = self._segments = 0
        self._cutting = self._rapid = self._fastest = 0.0
        self._low, self._high = np.full(6, inf), np.full(6, -inf)
        self._used: dict[int, None] = {}
        self.stopped: ProgramError | None = None  # the fault that ended the program
        self.read_on = False  # there are lines after it
        self._warnings: dict[tuple[str, int, str], tuple[ProgramError, str]] = {}

    def warn(self, found: ProgramError, letters: str = "") -> None:
        """Keep what is no fault and worth a look, once for each line; `letters` of the word it is about."""
        if len(self._warnings) < MOST_WARNINGS:
            self._warnings.setdefault((found.file, found.line, found.reason), (found, letters))

    def warn_of_spindle(self, found: ProgramError) -> None:
        """The same, of what M3, M4 and S say."""
        self.warn(found, "M3 M4 S")

    def warn_of_feed(self, found: ProgramError) -> None:
        """The same, of a move whose feed is assumed."""
        self.warn(found, "G1 G2 G3 X Y Z A B C")

    @property
    def default_feed(self) -> DefaultFeed:
        """What the machine moves at by feed where a program gives none: its own, or what its slowest axis can do."""
        slowest = [60.0 * self._velocity[some][self._present[some]].min(initial=inf) for some in (LINEAR, ROTARY)]
        linear, rotary = (float(speed) if speed < inf else 0.0 for speed in slowest)
        return DefaultFeed(self._machine.name, self._machine.default_feed or linear, rotary)

    @property
    def machine(self) -> Machine:
        """The machine that the program is for."""
        return self._machine

    @property
    def ok(self) -> bool:
        """Whether no fault has been found so far."""
        return not self._worst

    def watch(self, blocks: Iterable[PathBlock]) -> Iterator[PathBlock]:
        """The same blocks, looked at. What ends the program (its ProgramError) ends it here as one fault more."""
        try:
            for block in blocks:
                self.look(block)
                yield block
        except ProgramError as fault:
            self.stopped = fault
            self.report(fault)

    def report(self, fault: ProgramError, kind: str = "", excess: float = 0.0, letters: str = "G2 G3 G1 F") -> None:
        """Keep a fault, if it is the worst of its kind on its line; `letters` of the word it is about."""
        key = (fault.file, fault.line, kind or fault.reason)
        self._files.setdefault(fault.file, len(self._files))
        known = self._worst.get(key)
        if known is None and len(self._worst) >= MOST_FAULTS:
            self._more += 1
        elif known is None or excess > known[0]:
            self._worst[key] = (excess, fault, letters)

    def look(self, block: PathBlock) -> None:
        """Check one block. Raises ProgramError for a loop that runs out of the travel without an end in sight."""
        self._files.setdefault(block.file, len(self._files))
        limits = self._tools.get(block.tool, ToolLimits())
        self._follow = self._follow_spindle(block)
        for event in block.events:
            if event.kind == "spindle":
                self._look_at_spindle(event, block, limits)
            elif event.kind == "dwell" and float(event.value) > LONGEST_DWELL:
                message = f"a dwell of {event.value:g} s is longer than {LONGEST_DWELL:g}; P is in seconds here"
                self._fault(block, event.line, message, "dwell", float(event.value), "P G4")
            elif event.kind == "dwell" and float(event.value) > LONG_DWELL:
                message = f"a dwell of {event.value:g} s, {float(event.value) / 60.0:.1f} minutes: P is in seconds here"
                self.warn(ProgramError(message, file=block.file or self._name, line=event.line), "P G4")
            elif event.kind == "output":
                self._look_at_output(event, block)
            elif event.kind == "tool" and event.value:
                self._used.setdefault(int(event.value))
        segments = block.segments
        if not len(segments):
            return
        self._segments += len(segments)
        linear = np.where(segments["tip"] == JOINTS, ~only_rotary(segments), segments["tip"] == MOVED)
        self._cutting += float(segments["length"][linear & ~segments["rapid"]].sum())
        self._rapid += float(segments["length"][linear & segments["rapid"]].sum())
        low, high = extents(segments)
        self._low, self._high = np.minimum(self._low, low.min(axis=0)), np.maximum(self._high, high.max(axis=0))
        self._look_at_travel(block, low, high)
        self._look_at_feed(block, linear, high - low > TOLERANCE, limits)
        self._look_at_tip(block)

    def _fault(self, block: PathBlock, line: int, message: str, kind: str, excess: float, letters: str) -> None:
        self.report(ProgramError(message, file=block.file or self._name, line=int(line)), kind, excess, letters)

    def _look_at_travel(self, block: PathBlock, low: np.ndarray, high: np.ndarray) -> None:
        lines = block.segments["line"]
        for axis, name in enumerate(AXES):
            letters = f"{name} G2 G3 R G0 G1 G28 G30"
            if not self._present[axis]:
                for at in np.flatnonzero(high[:, axis] - low[:, axis] > TOLERANCE):
                    has = ", ".join(other for other, here in zip(AXES, self._present, strict=True) if here)
                    message = (
                        f"{self._machine.name} has no axis {name} to move (it has {has}); leave {name} where it is"
                    )
                    self._fault(block, lines[at], message, name, 0.0, letters)
                continue
            below, above = self._least[axis] - low[:, axis], high[:, axis] - self._most[axis]
            # a move that begins outside is another one's fault, unless it goes farther out
            begin = block.segments["start"][:, axis]
            worse_below = below > np.maximum(self._least[axis] - begin, 0.0) + TOLERANCE
            worse_above = above > np.maximum(begin - self._most[axis], 0.0) + TOLERANCE
            for at in np.flatnonzero(worse_below | worse_above):
                down = bool(worse_below[at] and (below[at] > above[at] or not worse_above[at]))
                value = low[at, axis] if down else high[at, axis]
                message = self._travel_message(axis, float(value), bool(block.segments["plane"][at] >= 0))
                excess = float(max(below[at], above[at]))
                self._fault(block, lines[at], message, name, excess, letters)
                self._stop_a_runaway(block, int(lines[at]), axis, excess)

    def _stop_a_runaway(self, block: PathBlock, line: int, axis: int, excess: float) -> None:
        """Raises ProgramError for a line of a loop that has left the travel again and again, ever farther out."""
        key = (block.file, line, axis)
        times, before = self._leaving.get(key, (0, 0.0))
        times = times + 1 if excess > before else 1
        self._leaving[key] = times, excess
        if times >= RUNAWAY:
            name = AXES[axis]
            message = (
                f"this line has left the travel of {name} {times} times, each time farther out, and is not followed "
                "any more; end its loop before"
            )
            raise ProgramError(message, file=block.file or self._name, line=line)

    def _travel_message(self, axis: int, value: float, arc: bool) -> str:
        name, unit = AXES[axis], UNITS_OF_AXES[axis]
        least, most = self._machine.axes[name].travel
        virtual = any(link.axis == name and link.limits == (least, most) for link in self._machine.links)
        beyond = max(least - value, value - most)
        return (
            f"{'on this arc ' if arc else ''}{name} would reach {plain(value)} {unit} (machine coordinates), "
            f"{plain(beyond)} {unit} beyond its {'limits' if virtual else 'travel'} of {least:g} to {most:g}; "
            "shorten the path, or move its origin"
        )

    def _look_at_feed(self, block: PathBlock, linear: np.ndarray, moves: np.ndarray, limits: ToolLimits) -> None:
        """`moves` says which axes each segment moves (n × 6)."""
        segments = block.segments
        allowed = f"the tool table allows tool {block.tool}"
        self._too_fast(block, ~segments["rapid"] & linear, limits.feed / 60.0, allowed, "tool")
        feeds = ~segments["rapid"] & (segments["tip"] == JOINTS)
        speeds = np.where(moves & self._present, self._velocity, inf)
        for only, axes in ((False, LINEAR), (True, ROTARY)):
            some = feeds & (linear != only)
            slowest = np.argmin(speeds[:, axes], axis=1) + axes.start
            for axis in np.unique(slowest[some]):
                who = f"{AXES[axis]}, the slowest {'rotary ' * only}axis that moves, can do"
                self._too_fast(block, some & (slowest == axis), self._velocity[axis] or inf, who, "axes")
        way = np.abs(segments["end"] - segments["start"])[:, 3:]
        turning = np.flatnonzero(feeds & linear & np.any(way > TOLERANCE, axis=1))
        if len(turning):
            speed = way[turning] * (segments["rate"][turning] / segments["length"][turning])[:, None]
            for axis in range(3):
                limit = self._velocity[3 + axis] if self._present[3 + axis] else inf
                for at in np.flatnonzero(speed[:, axis] > limit * _FASTER):
                    message = (
                        f"{AXES[3 + axis]} would turn at {plain(speed[at, axis] * 60)} degrees/min to keep up, and can "
                        f"do {plain(limit * 60)}; lower F"
                    )
                    line = segments["line"][turning[at]]
                    name = AXES[3 + axis]
                    self._fault(block, line, message, f"turn {name}", float(speed[at, axis]), f"F {name}")

    def _look_at_tip(self, block: PathBlock) -> None:
        """The planner slows a move for the tip down to what each joint can do; a reader is told of the first one."""
        if self._slowed or (found := slowed(block.segments, self._velocity)) is None:
            return
        self._slowed = True
        line, axis, share = found
        message = (
            f"the tip is slower than its feed where a joint can do no more: here {AXES[axis]} would have to do "
            f"{share:.3g} times its velocity"
        )
        self.warn(ProgramError(message, file=block.file or self._name, line=line), "F G1 G2 G3")

    def _follow_spindle(self, block: PathBlock) -> np.ndarray:
        """Which segments are threads and taps: slower than they say, they would have another pitch."""
        follow = np.full(len(block), self._follows_spindle)
        for event in block.events:
            if event.kind == "override":
                self._follows_spindle = event.value == TIED_FEED
                follow[event.after + 1 :] = self._follows_spindle
        return follow

    def _too_fast(self, block: PathBlock, some: np.ndarray, limit: float, who: str, kind: str) -> None:
        """`limit` in mm/s or degrees/s. The fault is on the line of the word F, for all moves that obey it.

        Of the faults of a `kind` on a line the one farthest beyond its limit is kept.
        """
        rate = block.segments["rate"]
        too_fast = np.flatnonzero(some & (rate > limit * _FASTER))
        if not len(too_fast):
            return
        rotary = bool(only_rotary(block.segments[too_fast[:1]])[0])
        unit = "degrees/min" if rotary else "mm/min"
        given = block.feed_lines[too_fast]
        at_line = np.where(given > 0, given, block.segments["line"][too_fast])
        for line in np.unique(at_line):
            here = at_line == line
            fastest = float(rate[too_fast[here]].max())
            feed, remedy = f"a feed of {plain(fastest * 60)} {unit} is", "lower it"
            follows = bool(np.any(self._follow[too_fast[here]]))
            if np.any(given[here] == BY_PITCH):
                feed = f"the pitch and the speed of the spindle make a feed of {plain(fastest * 60)} {unit},"
                remedy = "lower S"
            elif follows:
                remedy = "lower F and S by the same factor, which keeps the pitch"
            said = f"{feed} more than {who} ({plain(limit * 60)})"
            if self._machine.limit_feed and kind != "tool" and not follows:
                found = ProgramError(f"{said}, and is limited to it", file=block.file or self._name, line=int(line))
                self.warn(found, _FEED_WORDS)
            else:
                self._fault(block, line, f"{said}; {remedy}", f"feed {kind} {unit}", fastest / limit, _FEED_WORDS)

    def _look_at_output(self, event: Event, block: PathBlock) -> None:
        kind, number, _ = str(event.value).split()
        names = self._machine.digital if kind == "digital" else self._machine.analog
        if int(number) >= len(names):
            has = ", ".join(f"{k} {name}" for k, name in enumerate(names)) or "none"
            message = (
                f"{self._machine.name} names no {kind} output {number} (it has {has}); name it in the machine's file "
                f"([outputs] {kind}), or leave the word out"
            )
            self._fault(block, event.line, message, f"output {kind} {number}", 0.0, "M62 M63 M64 M65 M67 M68 P E")

    def _look_at_spindle(self, event: Event, block: PathBlock, limits: ToolLimits) -> None:
        speed = float(event.value)
        if not speed:
            return
        self._fastest = max(self._fastest, abs(speed))
        says: Callable[[str, str], None] = lambda kind, message: self._fault(  # noqa: E731
            block, event.line, message, kind, abs(speed), "S M3 M4"
        )
        way = "" if speed > 0 else " counter-clockwise"
        if self._spindle is None:
            says("no spindle", f"{self._machine.name} has no spindle to turn; leave M3 and M4 away")
            return
        least, most = self._spindle.travel
        if not least <= speed <= most:
            says(
                "spindle",
                f"{abs(speed):g} rev/min{way} is outside of what the spindle does ({least:g} to {most:g} rev/min); "
                "change S",
            )
        if abs(speed) > limits.speed:
            allowed = f"the tool table allows tool {block.tool} ({limits.speed:g})"
            says("tool", f"{abs(speed):g} rev/min is more than {allowed}; lower S")

    def result(self) -> Validation:
        """The faults found, at their words, and what was seen."""
        kept = [(fault, letters) for _, fault, letters in self._worst.values()]
        faults = located_at_words(kept)
        order = {file: at for file, at in self._files.items() if file != self._name} | {self._name: -1}
        faults.sort(key=lambda fault: (order.get(fault.file, 0), fault.line, fault.column))
        moved = np.flatnonzero(self._high - self._low > TOLERANCE)
        return Validation(
            program=self._name,
            machine=self._machine.name,
            faults=tuple(faults),
            more=self._more,
            segments=self._segments,
            cutting=self._cutting,
            rapid=self._rapid,
            low={AXES[axis]: float(self._low[axis]) for axis in moved},
            high={AXES[axis]: float(self._high[axis]) for axis in moved},
            tools=tuple(self._used),
            spindle=self._fastest,
            stopped=self.stopped,
            read_on=self.read_on,
            warnings=tuple(located_at_words(self._warnings.values())),
        )
