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
# Each by the call that switches it on again. Cycles and threads do both within a line, which needs no word.
OVERRIDES_OFF = {"ENABLE_FEED_OVERRIDE": "DISABLE_FEED_OVERRIDE", "ENABLE_SPEED_OVERRIDE": "DISABLE_SPEED_OVERRIDE"}
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
        self._off: dict[str, tuple[str, int]] = {}  # where overrides were locked that are so still

    def take(self, call: Call, file: str) -> bool:
        """Whether the call, in `file`, is one of those."""
        if call.name in WITHOUT_EFFECT:
            return True
        if call.name in OVERRIDES_OFF.values():
            self._off.setdefault(call.name, (file, call.line))
        elif call.name in OVERRIDES_OFF:
            self._was_off(OVERRIDES_OFF[call.name], call.line)
        elif call.name in PASSED_OVER:
            self._tell(call.name, PASSED_OVER[call.name], file, call.line)
        else:
            return False
        return True

    def end(self) -> None:
        """The program ends."""
        for name in tuple(self._off):
            self._was_off(name)

    def _was_off(self, name: str, until: int | None = None) -> None:
        """Tell of an override that the program locked, unless a cycle did so within the line `until`."""
        file, line = self._off.pop(name, ("", until))
        if line != until:
            self._tell("override", "M49, M50 P0 and M51 P0 lock no override of the operator's here", file, line or 0)

    def _tell(self, key: str, why: str, file: str, line: int) -> None:
        if key not in self._told:
            self._told.add(key)
            said = f"{why}; leave it out, or run the program where it is done"
            self._warn(ProgramError(said, file=file, line=line))
