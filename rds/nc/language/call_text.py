"""One canonical call as text, as LinuxCNC's `rs274 -g` prints it."""

from __future__ import annotations

from rds.nc.language.canon import Call

# How each call is written; others are written with %.4f for floats and %s for the rest, separated by commas.
_FORMATS = {
    "USE_LENGTH_UNITS": "CANON_UNITS_%s",  # MM, INCHES
    "SELECT_PLANE": "CANON_PLANE_%s",  # XY, XZ, YZ
    "SET_FEED_REFERENCE": "%s",
    "COMMENT": '"%s"',
    "MESSAGE": '"%s"',
    "PRINT": '"%s"',
    "SET_MOTION_CONTROL_MODE": "CANON_%s",  # EXACT_PATH, EXACT_STOP, CONTINUOUS (with its tolerance)
    "USE_TOOL_LENGTH_OFFSET": "%.4f %.4f %.4f, %.4f %.4f %.4f, %.4f %.4f %.4f",
    "SET_SPINDLE_MODE": "%d %.4f",
    "START_SPEED_FEED_SYNC": "%f,%d",
    "SET_MOTION_OUTPUT_VALUE": "%d,%f",
    "SET_AUX_OUTPUT_VALUE": "%d,%f",
    "SET_TOOL_TABLE_ENTRY": "%d, %d, %.4f %.4f %.4f %.4f %.4f %.4f %.4f %.4f %.4f, %.4f, %.4f, %d",
    "LOG": '"%s"',
    "LOGOPEN": '"%s"',
    "LOGAPPEND": '"%s"',
}
# Calls of which only the first arguments are written, and what stands behind them.
_SHORTENED = {
    "NURBS_FEED": (1, ", ..."),
    "STRAIGHT_PROBE": (6, ""),
    "RIGID_TAP": (3, ""),
    "CHANGE_TOOL_NUMBER": (1, ""),
}
_RENAMED = {"WAIT_SPINDLE_ORIENT_COMPLETE": "SPINDLE.0.WAIT_ORIENT_COMPLETE"}
UNWRITTEN = frozenset(("WAIT", "RETRACT_BY_HAND"))  # calls that `rs274 -g` does not print


def call_text(call: Call) -> str:
    """`SELECT_PLANE(CANON_PLANE_XY)`."""
    if call.name == "SET_MOTION_CONTROL_MODE" and len(call.args) == 2:
        return f"{call.name}(CANON_{call.args[0]}, {call.args[1]:f})"
    pattern = _FORMATS.get(call.name)
    args, rest = call.args, ""
    if call.name in _SHORTENED:
        count, rest = _SHORTENED[call.name]
        args = args[:count]
    if pattern is None:
        pattern = ", ".join("%.4f" if isinstance(value, float) else "%s" for value in args)
    return f"{_RENAMED.get(call.name, call.name)}({pattern % args}{rest})"
