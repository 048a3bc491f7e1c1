"""What a block does besides moving: modes, spindle, tools, coolant, stops, in the order in which it happens."""

from __future__ import annotations

from contextlib import suppress

from rds.nc.language.blocks import (
    ARC_DISTANCE,
    COMPENSATION,
    CONTROL,
    COOLANT,
    COORDINATES,
    DIAMETER,
    DISTANCE,
    FEED_MODE,
    G92_SERIES,
    NON_MODAL,
    OVERRIDES,
    PLANE,
    RETRACT,
    SIGNALS,
    SPINDLE,
    SPINDLE_MODE,
    STOP,
    TOOL_CHANGE,
    TOOL_OFFSET,
    UNITS,
    Block,
)
from rds.nc.language.comment_values import expanded
from rds.nc.language.compensation_words import compensate, hold_beside_contour
from rds.nc.language.context import INCH, Context
from rds.nc.language.expressions import Fault, whole
from rds.nc.language.moves import home, move
from rds.nc.language.offsets import (
    g92_mode,
    keep_home,
    select_system,
    set_g92,
    set_system,
    set_tool,
    set_tool_offset,
    set_units,
    tell_tool,
)
from rds.nc.language.parameters import DEBUG_SHOWN
from rds.nc.language.program_end import stop
from rds.nc.language.signals import signal
from rds.nc.language.splines import draw_points
from rds.nc.language.state import INVERSE_TIME, PER_MINUTE, PER_REVOLUTION, PLANES
from rds.nc.language.tool_centre import check_words
from rds.nc.language.unknown_words import active_comment

_ACTIVE_COMMENTS = ("pyrun,", "py,", "abort,")
_ACTIVE_ALONE = ("pyreload",)


def execute(m: Context, block: Block) -> bool:
    """Do what the block says, in the order that LinuxCNC documents. True when the program ends by it (M2, M30)."""
    words, g = block.words, block.g
    if block.comment:
        comment(m, block.comment)
    if SPINDLE_MODE in g:
        m.state.surface_speed = int(g[SPINDLE_MODE] == 960)
        m.out.call("SET_SPINDLE_MODE", 0, abs(words.get("d", 1e30)) if m.state.surface_speed else 0.0)
    if FEED_MODE in g:
        set_feed_mode(m, g[FEED_MODE])
    if "f" in words and m.state.feed_mode != INVERSE_TIME:
        m.state.feed_rate = words["f"]
        m.out.rate(words["f"])
    if "s" in words:
        m.state.speed = words["s"]
        m.out.speed(words["s"])
    if "t" in words:
        select_tool(m, int(words["t"]))
    if block.m:
        _m_words(m, block)
    if g:
        _g_words(m, block)
    if block.motion != -1:
        move(m, block)
    if TOOL_CHANGE in block.m and m.leaving is not None:
        hold_beside_contour(m, m.leaving)
    if STOP in block.m:
        return stop(m, block.m[STOP])
    return False


def _m_words(m: Context, block: Block) -> None:
    groups, words = block.m, block.words
    if SIGNALS in groups:
        signal(m, groups[SIGNALS], words)
    if TOOL_CHANGE in groups:
        if groups[TOOL_CHANGE] == 61:
            name_tool(m, words)
        else:
            change_tool(m)
    spindle = groups.get(SPINDLE, -1)
    if spindle == 19:
        orient(m, words)
    elif spindle >= 70:
        m.saved_modes(m, spindle)
    elif spindle >= 0:
        name, turning = {
            3: ("START_SPINDLE_CLOCKWISE", 1),
            4: ("START_SPINDLE_COUNTERCLOCKWISE", -1),
            5: ("STOP_SPINDLE_TURNING", 0),
        }[spindle]
        m.out.call(name, 0)
        m.state.spindle = turning
    coolant = groups.get(COOLANT)
    if coolant == 7:
        m.out.call("MIST_ON")
        m.state.mist = 1
    elif coolant == 8:
        m.out.call("FLOOD_ON")
        m.state.flood = 1
    elif coolant == 9:
        m.out.call("MIST_OFF")
        m.out.call("FLOOD_OFF")
        m.state.mist = m.state.flood = 0
    if OVERRIDES in groups:
        override(m, groups[OVERRIDES], words)


def _g_words(m: Context, block: Block) -> None:
    """All G words but those of motion."""
    g, words = block.g, block.words
    non_modal = g.get(NON_MODAL)
    if m.state.tcp:
        check_words(g)
    if non_modal == 40:
        m.out.call("DWELL", words["p"])
    if PLANE in g:
        select_plane(m, g[PLANE])
    if UNITS in g:
        set_units(m, g[UNITS])
    if DIAMETER in g:
        set_diameter(m, g[DIAMETER] == 70, block)
    if COMPENSATION in g:
        compensate(m, g[COMPENSATION], words)
    if TOOL_OFFSET in g:
        set_tool_offset(m, g[TOOL_OFFSET], block)
    if COORDINATES in g:
        select_system(m, g[COORDINATES])
    if CONTROL in g:
        control_path(m, g[CONTROL], words)
    if DISTANCE in g:
        _distance(m, g[DISTANCE] == 900)
    if ARC_DISTANCE in g:
        _arc_distance(m, g[ARC_DISTANCE] == 901)
    if RETRACT in g:
        set_retract(m, g[RETRACT])
    if non_modal == 100:
        if words["l"] in (2, 20):
            set_system(m, block)
        else:
            set_tool(m, block)
    elif non_modal in (280, 300):
        home(m, block, non_modal)
    elif non_modal in (281, 301):
        keep_home(m, non_modal)
    elif non_modal in (520, 920):
        set_g92(m, block, non_modal)
    elif non_modal == 53:
        draw_points(m, block)
    if G92_SERIES in g:
        g92_mode(m, g[G92_SERIES])


def comment(m: Context, text: str) -> None:
    """A comment in parentheses; (MSG, ...) is a message for the operator, and (DEBUG, ...) one with values in it.

    (PRINT, ...), with values too, is for whoever writes the program.
    """
    with suppress(UnicodeError):  # in another coding: its bytes as they are
        text = text.encode("latin-1").decode("utf-8")
    text = text.lstrip(" \t\r\n\x0b\x0c")
    lower = text.lower()
    if lower.startswith("msg,"):
        m.out.call("MESSAGE", text[4:])
        return
    if lower.startswith("debug,"):
        message = expanded(text[6:], m.parameters)
        if m.parameters.numbers[DEBUG_SHOWN] > 0.0:
            m.out.call("MESSAGE", message)
        return
    if lower.startswith("print,"):
        m.out.call("PRINT", expanded(text[6:], m.parameters))
        return
    for name in ("logopen,", "logappend,"):
        if lower.startswith(name):
            m.out.call(name[:-1].upper(), text[len(name) :])
            return
    if lower.startswith("log,"):
        m.out.call("LOG", expanded(text[4:], m.parameters))
        return
    if lower == "logclose":
        m.out.call("LOGCLOSE")
        return
    for name in (*_ACTIVE_COMMENTS, *_ACTIVE_ALONE):
        if lower == name if name in _ACTIVE_ALONE else lower.startswith(name):
            raise Fault(active_comment(name), "(")
    m.out.comment(text)


def set_feed_mode(m: Context, code: int) -> None:
    """G93, G94, G95. The last two forget the feed rate, as in LinuxCNC."""
    name, mode = {
        930: ("inverse time", INVERSE_TIME),
        940: ("units per minute", PER_MINUTE),
        950: ("units per revolution", PER_REVOLUTION),
    }[code]
    m.out.comment(f"interpreter: feed mode set to {name}")
    m.state.feed_mode = mode
    m.out.call("SET_FEED_MODE", 0, int(mode == PER_REVOLUTION))
    if mode != INVERSE_TIME:
        m.state.feed_rate = 0.0
        m.out.rate(0.0)


def select_tool(m: Context, number: int) -> None:
    """T."""
    try:
        m.tools.selected = m.tools.find(number)
    except Fault as fault:
        tool, offset = divmod(number, 100)
        turret = f"; as of a lathe's turret (tool {tool}, offset {offset}), write T{tool} M6 and then G43"
        raise Fault(f"{fault}{turret if tool and offset else ''}", "t") from None
    m.out.call("SELECT_TOOL", number)


def change_tool(m: Context) -> None:
    """M6: the selected tool into the spindle, which stands still for it."""
    if m.tools.selected < 0:
        raise Fault("no tool is selected; write T and its number on the line or before", "m6")
    if m.state.comp_side:
        raise Fault("the tool cannot change while the cutter is compensated; write it after G40", "m6")
    if m.state.tcp:
        raise Fault("the tool cannot change while G43.4 is in force; write G49 before", "m6")
    m.out.call("START_CHANGE")
    m.out.call("STOP_SPINDLE_TURNING", 0)
    m.state.spindle = 0
    m.out.call("CHANGE_TOOL", m.tools.selected)
    m.tools.change()
    tell_tool(m)


def name_tool(m: Context, words: dict[str, float]) -> None:
    """M61 Q: this tool is in the spindle; nothing is changed."""
    try:
        number = whole(words.get("q", -1.0))
        if number < 0:
            raise Fault("M61 needs the tool that is in the spindle; write Q and its number (Q0: none)")
        slot = m.tools.find(number)
    except Fault as fault:
        fault.key = "q" if "q" in words else "m61"
        raise
    m.tools.put(slot)
    m.out.call("CHANGE_TOOL_NUMBER", slot, number)
    tell_tool(m)


def orient(m: Context, words: dict[str, float]) -> None:
    """M19 R (degrees) P (0 the shorter way, 1 clockwise, 2 counter-clockwise) Q (s to wait for it)."""
    m.state.spindle = 0
    angle, way = words.get("r", 0.0), words.get("p", 0.0)
    if not 0.0 <= angle <= 360.0:
        raise Fault(f"R{angle:g} is no angle of the spindle; write 0 to 360 degrees", "r")
    if way not in (0.0, 1.0, 2.0):
        raise Fault("P says which way the spindle turns; write 0 (the shorter), 1 or 2", "p")
    if "q" in words and words["q"] <= 0.0:
        raise Fault("Q says how many seconds the spindle may take; write more than 0", "q")
    if "r" in words or "p" in words:
        m.out.call("ORIENT_SPINDLE", 0, angle, int(way))
    if "q" in words:
        m.out.call("WAIT_SPINDLE_ORIENT_COMPLETE", words["q"])


def override(m: Context, code: int, words: dict[str, float]) -> None:
    """M48 to M53: whether the operator's override, adaptive feed and feed hold work."""
    state, out = m.state, m.out
    if state.comp_side:
        raise Fault("overrides do not change while the cutter is compensated; write it after G40", f"m{code}")
    on = code == 48 or (code != 49 and words.get("p", 1.0) != 0.0)
    does = "ENABLE" if on else "DISABLE"
    if code in (48, 49, 50):
        state.feed_override = int(on)
        out.call(f"{does}_FEED_OVERRIDE")
    if code in (48, 49, 51):
        state.speed_override = int(on)
        out.call(f"{does}_SPEED_OVERRIDE", 0)
    if code == 52:
        state.adaptive_feed = int(on)
        out.call(f"{does}_ADAPTIVE_FEED")
    elif code == 53:
        state.feed_hold = int(on)
        out.call(f"{does}_FEED_HOLD")


def set_diameter(m: Context, diameter: bool, block: Block) -> None:
    """G7 (X words are diameters), G8 (radii): from the words of this block on."""
    if m.state.diameter != diameter:
        m.state.diameter = int(diameter)
        m.out.comment(f"interpreter: Lathe diameter mode changed to {'diameter' if diameter else 'radius'}")
        scale = 0.5 if diameter else 2.0
        for letter in ("x", "i", "j", "k") if block.motion == 760 else ("x",):
            if letter in block.words:
                block.words[letter] *= scale


def set_retract(m: Context, code: int) -> None:
    """G98, G99: where canned cycles go out to."""
    if m.state.comp_side:
        raise Fault("where cycles retract to cannot change while the cutter is compensated", f"g{code}")
    m.out.comment(f"interpreter: retract mode set to {'old_z' if code == 980 else 'r_plane'}")
    m.state.retract_high = int(code == 980)


def select_plane(m: Context, code: int) -> None:
    """G17, G18, G19."""
    plane = {170: 0, 180: 1, 190: 2}[code]
    if m.state.comp_side and plane != m.state.plane:
        raise Fault("the plane cannot change while the cutter is compensated; write it after G40", f"g{code}")
    m.out.call("SELECT_PLANE", PLANES[plane])
    m.state.plane = plane


def control_path(m: Context, code: int, words: dict[str, float]) -> None:
    """G61 (exact path), G61.1 (exact stop), G64 (blending: within P of the path; Q: joins nearly straight lines)."""
    if m.state.comp_side:
        raise Fault("path control cannot change while the cutter is compensated; write it after G40", f"g{code}")
    state, unit = m.state, INCH if m.state.inches else 1.0
    state.path_mode = {610: "EXACT_PATH", 611: "EXACT_STOP", 640: "CONTINUOUS"}[code]
    if code != 640:
        m.out.call("SET_MOTION_CONTROL_MODE", state.path_mode)
    else:
        tolerance = words.get("p", 0.0)
        collinear = words.get("q", tolerance)
        state.path_tolerance, state.path_collinear = tolerance * unit, collinear * unit
        m.out.call("SET_MOTION_CONTROL_MODE", "CONTINUOUS", tolerance)
        m.out.call("SET_NAIVECAM_TOLERANCE", collinear)


def _distance(m: Context, absolute: bool) -> None:
    if m.state.absolute != absolute:
        m.out.comment(f"interpreter: distance mode changed to {'absolute' if absolute else 'incremental'}")
        m.state.absolute = int(absolute)


def _arc_distance(m: Context, absolute: bool) -> None:
    if m.state.arc_absolute != absolute:
        m.out.comment(f"interpreter: IJK distance mode changed to {'absolute' if absolute else 'incremental'}")
        m.state.arc_absolute = int(absolute)
