"""Canonical calls that move nothing: those without effect, those that are passed over and told, those refused."""

from __future__ import annotations

from collections.abc import Callable

from rds.nc.language.canon import Call
from rds.nc.language.errors import ProgramError

Report = Callable[[ProgramError], None]
# Calls that say nothing to axes and spindle. A pallet shuttle (M60, M30) comes with a stop or the end.
WITHOUT_EFFECT = {
    "COMMENT",
    "MESSAGE",
    "PRINT",
    "ON_RESET",
    "SET_FEED_REFERENCE",
    "START_CHANGE",
    "PALLET_SHUTTLE",
    "FINISH",
    "TURN_PROBE_ON",
    "TURN_PROBE_OFF",
    "RELOAD_TOOLDATA",
    "SET_TOOL_TABLE_ENTRY",
    "ENABLE_SPEED_OVERRIDE",  # nobody changes the spindle's speed but the program
    "DISABLE_SPEED_OVERRIDE",
}
# Calls that nothing here carries out, and that spoil nothing: told once each.
PASSED_OVER = {
    "LOG": "(LOG, ...) writes no file here",
    "LOGOPEN": "(LOGOPEN, ...) opens no file here",
    "LOGAPPEND": "(LOGAPPEND, ...) opens no file here",
    "LOGCLOSE": "(LOGCLOSE) closes no file here",
    "WAIT": "M66 waits for no input here, and #5399 keeps its value",
    "ENABLE_ADAPTIVE_FEED": "there is no adaptive feed here",
    "DISABLE_ADAPTIVE_FEED": "there is no adaptive feed here",
    "ENABLE_FEED_HOLD": "the operator's feed hold works all the same",
    "DISABLE_FEED_HOLD": "the operator's feed hold works all the same",
}
# Why no machine here does what a call wants, and what to write instead.
BEYOND = {
    "ORIENT_SPINDLE": "the spindle here cannot stop at an angle (M19, G87); leave it out, or bore with G85 or G86",
    "WAIT_SPINDLE_ORIENT_COMPLETE": "the spindle here cannot stop at an angle (M19); leave it out",
    "RETRACT_BY_HAND": (
        "G88 leaves the tool in the hole for the operator to take it out by hand, and no hand moves the axes in a run"
        " here; bore with G85, G86 or G89"
    ),
    "RIGID_TAP": "the axes here do not follow the spindle back (G33.1); tap with G84, or cut the thread with G33",
}


class PassedOver:
    """Takes the calls that nothing here carries out, and tells `warn` of each kind once."""

    def __init__(self, warn: Report):
        self._warn = warn
        self._told: set[str] = set()  # names of calls

    def take(self, call: Call, file: str) -> bool:
        """Whether the call, in `file`, is one of those."""
        if call.name in WITHOUT_EFFECT:
            return True
        if call.name not in PASSED_OVER:
            return False
        if call.name not in self._told:
            self._told.add(call.name)
            said = f"{PASSED_OVER[call.name]}; leave it out, or run the program where it is done"
            self._warn(ProgramError(said, file=file, line=call.line))
        return True
