"""Where a program pauses and ends: M0, M1, M60; M2 and M30, and the state after them."""

from __future__ import annotations

from rds.nc.language.context import Context, rotate
from rds.nc.language.offsets import call_origin, minus, plus
from rds.nc.language.parameters import SYSTEM, SYSTEMS
from rds.nc.language.state import PER_MINUTE, PLANES, XY


def stop(m: Context, code: int) -> bool:
    """M0, M1, M60 (the program pauses), M2, M30 (it ends: True)."""
    out = m.out
    if out.compensation is not None:
        out.put(out.compensation.stop(out.line, (out.digits, out.n)))
    if code == 1:
        out.call("OPTIONAL_PROGRAM_STOP")
    elif code in (0, 60):
        if code == 60:
            out.call("PALLET_SHUTTLE")
        out.call("PROGRAM_STOP")
    else:
        _end(m, code)
        return True
    return False


def _end(m: Context, code: int) -> None:
    """The state after M2 and M30: G54, G17, G90, G94, F0, G40, spindle and coolant off, G1."""
    state, out = m.state, m.out
    out.compensation = None
    position = state.position()
    rotate(position, state.rotation)
    position = plus(position, state.origin)
    state.origin_index = 1
    m.parameters.numbers[SYSTEM] = 1.0
    state.origin = m.vector_from_machine(SYSTEMS + 21)
    state.rotation = m.parameters.numbers[SYSTEMS + 30]
    position = minus(position, state.origin)
    rotate(position, -state.rotation)
    state.move_to(position)
    call_origin(m)
    out.call("SET_XY_ROTATION", state.rotation)
    if state.plane != XY:
        out.call("SELECT_PLANE", PLANES[XY])
        state.plane = XY
    state.absolute = 1
    state.feed_mode, state.feed_rate = PER_MINUTE, 0.0
    out.call("SET_FEED_MODE", 0, 0)
    out.rate(0.0)
    if not state.feed_override:
        out.call("ENABLE_FEED_OVERRIDE")
    state.feed_override = state.speed_override = 1
    state.comp_side, state.arc_allowed = 0, 1
    out.call("STOP_SPINDLE_TURNING", 0)
    out.call("SET_SPINDLE_MODE", 0, 0.0)
    state.spindle = 0
    state.motion = 10
    if state.mist:
        out.call("MIST_OFF")
    if state.flood:
        out.call("FLOOD_OFF")
    state.mist = state.flood = 0
    if code == 30:
        out.call("PALLET_SHUTTLE")
    out.call("PROGRAM_END")
