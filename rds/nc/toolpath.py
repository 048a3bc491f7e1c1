"""From canonical calls to machine motion: offsets, units, planes and feed modes become segments and events.

A position of the program becomes one of the machine as in LinuxCNC (emccanon.cc): program units to mm, plus the G92
offset, turned about Z by the rotation of the coordinate system, plus the system's origin (G54 to G59.3), plus the tool
length offset. The motion begins with all axes at machine zero, in G64 without P, as LinuxCNC starts up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from math import inf
from typing import Any, NoReturn

import numpy as np

from rds.core.errors import InputError
from rds.core.shared_quantities import FREE_FEED, LOCKED_FEED, TIED_FEED
from rds.interpolators.motion.segments import BLEND, EXACT_PATH, EXACT_STOP, SEGMENT
from rds.nc.feed_rates import FeedRates
from rds.nc.language.canon import ARC, FEED, MOTION, SPEED, Call, MotionBlock
from rds.nc.language.errors import ProgramError
from rds.nc.language.frame import Frame, only_rotary, segments_of
from rds.nc.passed_over import BEYOND, PassedOver, Report
from rds.nc.path_block import DefaultFeed, Event, PathBlock
from rds.nc.spline import CURVE_ERROR, curve
from rds.nc.tool_centre import ToolCentre

BLOCK_SEGMENTS = 65536  # a PathBlock is handed on when it has at least so many
MODES = {"EXACT_PATH": EXACT_PATH, "EXACT_STOP": EXACT_STOP, "CONTINUOUS": BLEND}


def raise_it(fault: ProgramError) -> NoReturn:
    """The default report: the first fault ends it."""
    raise fault


def toolpath(
    items: Iterable[MotionBlock | Call],
    *,
    report: Report = raise_it,
    warn: Report = lambda _: None,
    default_feed: DefaultFeed | None = None,
    assume: Report = lambda _: None,
    tool_centre: ToolCentre | InputError | None = None,
) -> Iterator[PathBlock]:
    """The machine's motion for a stream of canonical calls, block by block; memory does not grow with its length.

    What no machine can do (an arc in a plane that the rotation tilts, a feed per revolution of a standing spindle, a
    call that nothing here carries out) goes to `report` as a ProgramError; if that returns, the path goes on. What is
    allowed and hardly meant (a spindle started at S0) goes to `warn`. `default_feed` is that of moves without a feed
    rate, and the first of them goes to `assume`. `tool_centre` makes joints' moves of those for the tool's tip; an
    InputError says why the machine has none.
    """
    converter = _Converter(report, warn, default_feed, assume, tool_centre)
    try:
        for item in items:
            if isinstance(item, MotionBlock):
                converter.take(item)
            else:
                converter.call(item)
            yield from converter.ready()
    except ProgramError:
        converter.flush()
        yield from converter.ready()  # what was right before the fault
        raise
    converter.end()
    yield from converter.ready()


class _Converter:
    """Gathers rows while nothing changes that matters to them, then makes segments of them at once."""

    def __init__(
        self,
        report: Report,
        warn: Report,
        default_feed: DefaultFeed | None,
        assume: Report,
        tool_centre: ToolCentre | InputError | None,
    ):
        self._report, self._warn = report, warn
        self._feeds, self._passed_over = FeedRates(report, assume, default_feed), PassedOver(warn)
        self._frame = Frame()
        self._mode, self._tolerance, self._collinear = BLEND, inf, 0.0
        self._speed = 0.0  # rev/min, as last said
        self._turning = 0  # +1 clockwise, −1 counter-clockwise
        self._stood = False  # has been told to turn at no speed
        self._unused: ProgramError | None = None  # the first speed, as long as nothing has switched the spindle on
        self._started = False  # M3 or M4 has
        self._tool = self._selected = 0
        self._position = self._joints = np.zeros(6)  # as programmed, and of the joints
        self._tool_centre, self._for_tip = tool_centre, False
        if isinstance(tool_centre, ToolCentre):
            self._position = tool_centre.joints_meant(self._joints)
        self._file = ""
        self._rows: list[np.ndarray] = []
        self._segments: list[np.ndarray] = []
        self._feed_lines: list[np.ndarray] = []
        self._count = self._waiting = 0
        self._events: list[Event] = []
        self._done: list[PathBlock] = []
        self._last_line = 0
        self._ended = False
        self._feed_before = self._feed = FREE_FEED  # who had a say in it before its last change, and has now
        self._threads = 0
        self._locked, self._locked_line = False, 0  # by DISABLE_FEED_OVERRIDE, in which line

    def ready(self) -> Iterator[PathBlock]:
        if self._waiting >= BLOCK_SEGMENTS:
            self._convert()
        if self._count >= BLOCK_SEGMENTS:
            self._hand_on()
        yield from self._done
        self._done.clear()

    def flush(self) -> None:
        self._convert()
        self._hand_on()

    def end(self) -> None:
        """A program without M2 or M30 ends with its last line."""
        self._convert()
        if self._unused is not None and not self._started:
            self._warn(self._unused)
        if not self._ended:
            self._event("end", 0.0, self._last_line)
        self.flush()

    def take(self, block: MotionBlock) -> None:
        self._in_file(block.file)
        if self._feeds.by_speed:
            for rows in np.split(block.rows, np.flatnonzero(block.rows["kind"] == SPEED)):
                self._convert()
                self._rows += [rows] if len(rows) else []
        else:
            self._rows.append(block.rows)
        self._waiting += len(block.rows)
        if len(block.rows):
            self._last_line = int(block.rows["line"][-1])

    def call(self, call: Call) -> None:
        if call.file:
            self._in_file(call.file)
        self._last_line = call.line or self._last_line
        if self._passed_over.take(call, call.file or self._file):
            return
        self._convert(call)
        action = _ACTIONS.get(call.name)
        if action is None:
            said = f"{call.name} is nothing that a machine here can do; leave its word out"
            self._fault(call, BEYOND.get(call.name, said))
        else:
            action(self, call)

    def _in_file(self, name: str) -> None:
        if name != self._file:
            self._convert()
            self._hand_on()
            self._file = name
            self._feeds.forget_line()

    def _fault(self, call: Call, message: str) -> None:
        self._report(ProgramError(message, file=call.file or self._file, line=call.line))

    def _event(self, kind: str, value: float | str, line: int, segments: int = 0) -> None:
        """Something that happens behind so many segments from now."""
        self._events.append(Event(self._count + segments - 1, kind, value, line))

    def _hand_on(self) -> None:
        if self._segments or self._events:
            segments = np.concatenate(self._segments) if self._segments else np.zeros(0, SEGMENT)
            feed_lines = np.concatenate(self._feed_lines) if self._feed_lines else np.zeros(0, np.int32)
            self._done.append(PathBlock(segments, self._events, self._file, self._tool, feed_lines))
        self._segments, self._feed_lines, self._events, self._count = [], [], [], 0

    def _convert(self, behind: Call | None = None) -> None:
        """The rows that wait become segments; `behind` them comes this call."""
        if not self._rows:
            return
        rows = np.concatenate(self._rows) if len(self._rows) > 1 else self._rows[0]
        self._rows, self._waiting = [], 0
        if self._locked and not self._feeds.pitch:
            # in the line of its lock a tap goes on with the spindle, and the way out of a thread ends the lock
            ends = behind is not None and behind.line == self._locked_line and behind.name in _ENDS_OF_TAPS
            taps = ends and bool(np.all(rows["line"] == self._locked_line))
            self._leave_feed_to(TIED_FEED if taps else LOCKED_FEED, self._locked_line)
        speeds = np.flatnonzero(rows["kind"] == SPEED)
        given = rows[speeds]
        if len(speeds):
            self._speed = float(given["values"][-1, 0])
            if self._speed and self._unused is None:
                message = (
                    "no M3 or M4 of the program starts the spindle, which stands still; write one, or leave S away"
                )
                self._unused = ProgramError(message, file=self._file, line=int(given["line"][-1]))
        rates, angular, rate_lines = self._feeds.of(rows, self._frame.unit, self._speed * abs(self._turning))
        moves = np.flatnonzero(rows["kind"] <= ARC)
        rows, rates, angular, rate_lines = rows[moves], rates[moves], angular[moves], rate_lines[moves]
        if not len(rows):
            self._turn(given, moves, speeds)
            return
        segments, tilted = segments_of(rows, self._position, self._frame)
        self._position = segments["end"][-1].copy()
        segments["rate"] = np.where(only_rotary(segments), angular, rates)
        segments["mode"], segments["tolerance"], segments["collinear"] = self._mode, self._tolerance, self._collinear
        for line in segments["line"][tilted]:
            self._report(
                ProgramError(
                    f"an arc of {self._frame.plane_word} lies in no plane of the machine's axes while the coordinate "
                    f"system is turned by {self._frame.rotation:g} degrees about Z; turn it back (G10 L2 R0), or make "
                    "the arc of short lines",
                    file=self._file,
                    line=int(line),
                )
            )
        moving = segments["length"] > 0.0
        rate_lines = self._feeds.complete(segments, rate_lines, self._file, self._turning, self._speed)
        segments, rate_lines, moves = segments[moving], rate_lines[moving], moves[moving]
        centre = self._tool_centre
        if len(segments) and isinstance(centre, ToolCentre) and (self._for_tip or centre.correct):
            segments, owner = centre.chords(segments, self._joints, self._complain, not self._for_tip)
            rate_lines, moves = rate_lines[owner], moves[owner]
        if len(segments):
            self._joints = segments["end"][-1].copy()
        self._segments.append(segments)
        self._feed_lines.append(rate_lines)
        self._turn(given, moves, speeds)
        self._count += len(segments)

    def _complain(self, line: int, message: str) -> None:
        self._report(ProgramError(message, file=self._file, line=line))

    # what single calls do

    def _units(self, call: Call) -> None:
        self._frame.set_units(call.args[0])

    def _plane(self, call: Call) -> None:
        self._frame.plane = call.args[0]

    def _g5x(self, call: Call) -> None:
        self._frame.set_origin(call.args[0], call.args[1:7])

    def _g92(self, call: Call) -> None:
        self._frame.set_g92(call.args)

    def _rotate(self, call: Call) -> None:
        self._frame.rotation = float(call.args[0])

    def _tool_length(self, call: Call) -> None:
        centre = self._tool_centre
        self._frame.set_tool_length(call.args)
        if isinstance(centre, ToolCentre):
            centre.length = float(call.args[2]) * self._frame.unit
        if self._for_tip and isinstance(centre, ToolCentre):
            self._frame.set_tool_length((0.0,) * 6)
            self._position = centre.begin(self._joints)

    def _tool_centre_point(self, call: Call) -> None:
        if not isinstance(self._tool_centre, ToolCentre):
            self._fault(call, str(self._tool_centre or "this machine has no links, which G43.4 needs; use G43"))
            return
        self._for_tip = bool(call.args[0])
        if not self._for_tip:
            self._position = self._tool_centre.joints_meant(self._joints)

    def _motion_mode(self, call: Call) -> None:
        self._mode = MODES[call.args[0]]
        given = float(call.args[1]) * self._frame.unit if len(call.args) > 1 else 0.0
        self._tolerance = given if self._mode == BLEND and given > 0.0 else inf
        if self._mode != BLEND:
            self._collinear = 0.0

    def _naive_cam(self, call: Call) -> None:
        self._collinear = float(call.args[0]) * self._frame.unit

    def _feed_mode(self, call: Call) -> None:
        self._feeds.per_revolution = bool(call.args[-1])

    def _synchronize(self, call: Call) -> None:
        self._feeds.pitch = float(call.args[0])
        begins = self._leave_feed_to(TIED_FEED, call.line)
        self._threads += begins
        if begins and self._threads == 2:
            message = (
                "a second cut does not meet the thread of the first: the spindle here tells its speed, and not its "
                "angle; cut each thread at once"
            )
            self._warn(ProgramError(message, file=call.file or self._file, line=call.line))

    def _end_synchronizing(self, call: Call) -> None:
        self._feeds.pitch = 0.0
        self._leave_feed_to(LOCKED_FEED if self._locked else FREE_FEED, call.line)

    def _lock_feed(self, call: Call) -> None:
        self._locked, self._locked_line = True, call.line
        self._leave_feed_to(LOCKED_FEED, call.line)

    def _free_feed(self, call: Call) -> None:
        self._locked = False
        self._leave_feed_to(FREE_FEED, call.line)

    def _leave_feed_to(self, whose: float, line: int) -> bool:
        """Whether this is a change. The motion rests there; back and forth where nothing moves is none."""
        if self._events and self._events[-1][:2] == (self._count - 1, "override"):
            self._events.pop()
            self._feed = self._feed_before
        if whose == self._feed:
            return False
        self._feed_before, self._feed = self._feed, whose
        self._event("override", whose, line)
        return True

    def _rows_of(self, call: Call, ends: np.ndarray) -> None:
        """Moves by feed to places in program coordinates (one row each, X Y Z A B C)."""
        rows = np.zeros(len(ends), MOTION)
        rows["kind"], rows["line"] = FEED, call.line
        rows["values"][:, :6] = ends
        self.take(MotionBlock(rows, call.file or self._file))

    def _spline(self, call: Call) -> None:
        _, order, points, held = call.args
        places = curve(np.array(points), order, CURVE_ERROR / self._frame.unit)[1:]
        self._rows_of(call, np.hstack([places, np.tile(held, (len(places), 1))]))

    def _probe(self, call: Call) -> None:
        self._rows_of(call, np.array([call.args[6:12]]))

    def _dwell(self, call: Call) -> None:
        self._event("dwell", float(call.args[0]), call.line)

    def _turn(self, given: np.ndarray, moves: np.ndarray, speeds: np.ndarray) -> None:
        """A turning spindle follows the speeds `given`: each before the segments whose `moves` are behind it."""
        if self._turning:
            behind = np.searchsorted(moves, speeds)
            columns = (given["values"][:, 0].tolist(), given["line"].tolist(), behind.tolist())
            for speed, line, segments in zip(*columns, strict=True):
                self._spin(speed, line, segments)

    def _clockwise(self, call: Call) -> None:
        self._turning, self._started = 1, True
        self._spin(self._speed, call.line)

    def _counterclockwise(self, call: Call) -> None:
        self._turning, self._started = -1, True
        self._spin(self._speed, call.line)

    def _spin(self, speed: float, line: int, segments: int = 0) -> None:
        if not speed and not self._stood:
            self._stood = True
            message = "the spindle is on at a speed of 0, and stands still; give one (S) on the line or before"
            self._warn(ProgramError(message, file=self._file, line=line))
        self._event("spindle", self._turning * speed, line, segments)

    def _stop_spindle(self, call: Call) -> None:
        if self._turning:
            self._turning = 0
            self._event("spindle", 0.0, call.line)

    def _spindle_mode(self, call: Call) -> None:
        if call.args[-1]:
            self._fault(call, "a constant surface speed (G96) is nothing that the spindle here can keep; use G97 and S")

    def _select(self, call: Call) -> None:
        self._selected = int(call.args[0])

    def _change(self, call: Call) -> None:
        self._hand_on()
        self._tool = self._selected  # its argument is the row of the tool table
        self._event("tool", float(self._tool), call.line)

    def _rename_tool(self, call: Call) -> None:
        self._hand_on()
        self._tool = int(call.args[1])

    def _stop(self, call: Call) -> None:
        self._event("stop", 1.0 if call.name.startswith("OPTIONAL") else 0.0, call.line)

    def _coolant(self, call: Call) -> None:
        self._event("coolant", call.name.replace("_", " ").lower(), call.line)

    def _output(self, call: Call) -> None:
        number, kind = int(call.args[0]), "digital" if call.name.endswith("BIT") else "analog"
        value = float(call.args[1]) if kind == "analog" else float(call.name.startswith("SET"))
        self._event("output", f"{kind} {number} {value:g}", call.line)

    def _end(self, call: Call) -> None:
        self._event("end", 0.0, call.line)
        self._ended = True


_ENDS_OF_TAPS = frozenset({"STOP_SPINDLE_TURNING", "ENABLE_FEED_OVERRIDE"})
_ACTIONS: dict[str, Callable[[_Converter, Call], Any]] = {
    "USE_LENGTH_UNITS": _Converter._units,
    "SELECT_PLANE": _Converter._plane,
    "SET_G5X_OFFSET": _Converter._g5x,
    "SET_G92_OFFSET": _Converter._g92,
    "SET_XY_ROTATION": _Converter._rotate,
    "USE_TOOL_LENGTH_OFFSET": _Converter._tool_length,
    "TOOL_CENTRE_POINT": _Converter._tool_centre_point,
    "SET_MOTION_CONTROL_MODE": _Converter._motion_mode,
    "SET_NAIVECAM_TOLERANCE": _Converter._naive_cam,
    "SET_FEED_MODE": _Converter._feed_mode,
    "START_SPEED_FEED_SYNC": _Converter._synchronize,
    "STOP_SPEED_FEED_SYNCH": _Converter._end_synchronizing,
    "DISABLE_FEED_OVERRIDE": _Converter._lock_feed,
    "ENABLE_FEED_OVERRIDE": _Converter._free_feed,
    "NURBS_FEED": _Converter._spline,
    "STRAIGHT_PROBE": _Converter._probe,
    "CHANGE_TOOL_NUMBER": _Converter._rename_tool,
    "DWELL": _Converter._dwell,
    "START_SPINDLE_CLOCKWISE": _Converter._clockwise,
    "START_SPINDLE_COUNTERCLOCKWISE": _Converter._counterclockwise,
    "STOP_SPINDLE_TURNING": _Converter._stop_spindle,
    "SET_SPINDLE_MODE": _Converter._spindle_mode,
    "SELECT_TOOL": _Converter._select,
    "CHANGE_TOOL": _Converter._change,
    "PROGRAM_STOP": _Converter._stop,
    "OPTIONAL_PROGRAM_STOP": _Converter._stop,
    "FLOOD_ON": _Converter._coolant,
    "FLOOD_OFF": _Converter._coolant,
    "MIST_ON": _Converter._coolant,
    "MIST_OFF": _Converter._coolant,
    "PROGRAM_END": _Converter._end,
    **dict.fromkeys(
        (
            *("SET_MOTION_OUTPUT_BIT", "CLEAR_MOTION_OUTPUT_BIT", "SET_AUX_OUTPUT_BIT", "CLEAR_AUX_OUTPUT_BIT"),
            *("SET_MOTION_OUTPUT_VALUE", "SET_AUX_OUTPUT_VALUE"),
        ),
        _Converter._output,
    ),
}
