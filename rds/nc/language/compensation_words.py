"""G40 to G42.1: cutter compensation begins and ends, and where the cutter is after it."""

from __future__ import annotations

from rds.nc.compensation.compensation import LEFT, RIGHT, Compensation
from rds.nc.language.arcs import AXES_OF
from rds.nc.language.context import Context, rotate
from rds.nc.language.expressions import Fault, whole
from rds.nc.language.offsets import plus
from rds.nc.language.state import PLANES, XY, YZ


def compensate(m: Context, code: int, words: dict[str, float]) -> None:
    """G40, G41, G42, G41.1, G42.1."""
    out, state = m.out, m.state
    if code == 400:
        out.comment("interpreter: cutter radius compensation off")
        compensation, out.compensation = out.compensation, None
        if compensation is not None:
            entered = compensation.entered
            out.put(compensation.off(out.line, (out.digits, out.n)))
            if entered:
                m.leaving, m.left_turned = compensation, state.rotation
                state.arc_allowed = 0
        state.comp_side = 0
        return
    if state.plane == YZ:
        raise Fault("cutter compensation works in the planes of G17 and G18 only; write one of them before", f"g{code}")
    if state.comp_side:
        raise Fault("the cutter is compensated already; write G40 before", f"g{code}")
    side = LEFT if code in (410, 411) else RIGHT
    radius, orientation = _cutter(m, code, words)
    if radius < 0.0:
        side, radius = -side, -radius
    out.comment(f"interpreter: cutter radius compensation on {'left' if side == LEFT else 'right'}")
    state.comp_side = side
    m.leaving = None
    if radius == 0.0:
        m.remark(
            f"G{code / 10:g} with a diameter of 0 moves nothing aside; write D and the number of a tool of the table,"
            " or load it by T and M6 before"
        )
    if radius > 0.0:
        start = (state.x, state.y, state.z) if state.plane == XY else (state.z, state.x, state.y)
        units = "INCHES" if state.inches else "MM"
        out.compensation = Compensation(
            side, radius, PLANES[state.plane], start, units=units, orientation=orientation, record=m.stretches
        )


def _cutter(m: Context, code: int, words: dict[str, float]) -> tuple[float, int]:
    """Radius in program units (negative: the other side) and orientation of the cutter to compensate."""
    if code in (411, 421):
        if "d" not in words:
            raise Fault("D is missing; write the cutter's diameter, for example D6", f"g{code}")
        if "l" in words and m.state.plane == XY:
            raise Fault("L, the orientation of a lathe tool, goes with the plane of G18 only; leave it out", "l")
        return words["d"] / 2.0, int(words.get("l", 0))
    slot = 0
    if "d" in words:
        try:
            number = _tool_of(words["d"], code)
            if number < 0:
                raise Fault(f"D{number} is negative; write the number of a tool")
            slot = m.tools.find(number)
        except Fault as fault:
            fault.key = "d"
            raise
    tool = m.tools.slots[slot]
    if m.state.plane == XY and tool.orientation not in (0, 9):
        raise Fault(f"tool {tool.number} is a lathe tool, which is compensated in the plane of G18 only", f"g{code}")
    return m.from_machine(tool.diameter) / 2.0, tool.orientation


def _tool_of(d: float, code: int) -> int:
    """The number of the tool that D of G41 or G42 names, which some take for the cutter's diameter."""
    try:
        return whole(d)
    except Fault:
        word = f"G{code // 10}"
        said = f"D of {word} is a tool's number, a whole number, not {d:g}; write {word}.1 D{d:g} for a diameter"
        raise Fault(said) from None


def hold_beside_contour(m: Context, compensation: Compensation) -> None:
    """After G40 and M6 the program goes on from where the cutter is, beside the contour, as LinuxCNC does, which asks
    the machine for its position after a change of tools: G0 Z5 alone then goes straight up.
    """
    beside = [0.0, 0.0, 0.0]
    first, second, _ = AXES_OF[PLANES.index(compensation.plane)]
    beside[first], beside[second] = compensation.beside()
    rotate(beside, m.left_turned - m.state.rotation)
    m.state.x, m.state.y, m.state.z = plus([m.state.x, m.state.y, m.state.z], beside)
    m.leaving = None
