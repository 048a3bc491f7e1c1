"""Why a module did not do what it was told, as sentences with a remedy."""

from __future__ import annotations

from rds.bus.modules.oacs.codes import Result

REASONS = {
    Result.OUTSIDE_TRAVEL: "that is outside its travel; choose a target inside (the module's information has it)",
    Result.AT_LIMIT: "its limit switch is open on that side; move it the other way, or check the switch's wire",
    Result.EMERGENCY_LATCHED: "its emergency stop is latched; release the button, then reset the emergency stop",
    Result.BAD_VALUE: "a value cannot be; see the ranges in docs/oacs.md",
    Result.NOT_FOR_THIS_MODULE: "a module of its kind cannot do that",
    Result.STALLED: "the axis did not move for 3 s; raise the gains or the output limit, or free the axis",
    Result.BUSY: "it is in motion; wait for its end, or stop it",
    Result.STOPPED_BY_LIMIT: (
        "a limit switch opened, or a homing found none; home it or move it the other way, or check the switch's wire"
    ),
    Result.STOPPED_BY_EMERGENCY: "the emergency stop was pressed; release it, then reset it",
    Result.STOPPED_BY_COMMAND: "it was told to stop",
    Result.HOST_COMMANDS: "a run commands it cyclically; wait for its end",
    Result.TIME_OVER: "its time was over",
    Result.HOST_SILENT: "it heard nothing of the host for 2 s; check the host and the cable",
    Result.NOTHING_MOVES: "nothing moves; start a motion first",
}

# what a module answers at once, and never at the end of a motion that it has accepted
REFUSED = frozenset(
    {Result.OUTSIDE_TRAVEL, Result.BAD_VALUE, Result.NOT_FOR_THIS_MODULE, Result.BUSY, Result.NOTHING_MOVES}
)


def reason(result: int) -> str:
    """The sentence for a result that is not a success."""
    try:
        return REASONS[Result(result)]
    except (ValueError, KeyError):
        return f"result {result}, which this program does not know; update it"
