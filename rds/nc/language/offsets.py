"""Where positions are counted from: coordinate systems, G92, tool length, and the machine's own coordinates.

A position in program coordinates p, with rotation R about Z, lies in the machine at R (p + G92) + origin + tool.
"""

from __future__ import annotations

from rds.nc.language.blocks import Block
from rds.nc.language.context import INCH, Context, given, rotate
from rds.nc.language.expressions import Fault
from rds.nc.language.parameters import G28_HOME, G30_HOME, G92, G92_APPLIED, SYSTEM, SYSTEMS, TOOL
from rds.nc.language.state import State
from rds.nc.language.tool_centre import check_switch, switch

NOTHING = [0.0] * 6


def plus(one: list[float], other: list[float]) -> list[float]:
    return [a + b for a, b in zip(one, other, strict=True)]


def minus(one: list[float], other: list[float]) -> list[float]:
    return [a - b for a, b in zip(one, other, strict=True)]


def call_origin(m: Context) -> None:
    m.out.call("SET_G5X_OFFSET", m.state.origin_index, *m.state.origin)


def call_g92(m: Context) -> None:
    m.out.call("SET_G92_OFFSET", *m.state.axis_offset)


def start(m: Context) -> None:
    """The offsets that the parameters hold, and the calls that tell them."""
    state, numbers = m.state, m.parameters.numbers
    m.out.call("USE_LENGTH_UNITS", "MM")
    state.origin_index = int(numbers[SYSTEM] + 0.0001)
    if not 1 <= state.origin_index <= 9:
        state.origin_index, numbers[SYSTEM] = 1, 1.0
    _load_system(m)
    call_origin(m)
    if numbers[G92_APPLIED]:
        state.axis_offset = m.vector_from_machine(G92)
    call_g92(m)
    m.out.call("SET_XY_ROTATION", state.rotation)


def _load_system(m: Context) -> None:
    base = SYSTEMS + 20 * m.state.origin_index
    m.state.origin = m.vector_from_machine(base + 1)
    m.state.rotation = m.parameters.numbers[base + 10]


def _in_system(m: Context, system: int) -> list[float]:
    """The position in the coordinates of another system."""
    state, base = m.state, SYSTEMS + 20 * system
    position = plus(state.position(), state.axis_offset)
    rotate(position, state.rotation)
    position = minus(plus(position, state.origin), m.vector_from_machine(base + 1))
    rotate(position, -m.parameters.numbers[base + 10])
    if m.parameters.numbers[G92_APPLIED]:
        position = minus(position, m.vector_from_machine(G92))
    return position


def select_system(m: Context, code: int) -> None:
    """G54 to G59.3."""
    if m.state.comp_side:
        raise Fault(
            "the coordinate system cannot change while the cutter is compensated; write it after G40", f"g{code}"
        )
    index = (code - 530) // 10 if code <= 590 else code - 584
    if index == m.state.origin_index:
        m.out.comment("interpreter: continuing to use same coordinate system")
        return
    m.state.move_to(_in_system(m, index))
    m.state.origin_index = index
    m.parameters.numbers[SYSTEM] = float(index)
    _load_system(m)
    call_origin(m)
    call_g92(m)
    m.out.call("SET_XY_ROTATION", m.state.rotation)


def set_system(m: Context, block: Block) -> None:
    """G10 L2 (origin and rotation) and L20 (origin such that the position gets the values given)."""
    state, numbers, words = m.state, m.parameters.numbers, block.words
    system = int(words["p"] + 0.0001) or state.origin_index
    active = system == state.origin_index
    by_position = words["l"] == 20
    if state.comp_side and (active or by_position):
        raise Fault("the coordinate system cannot be set while the cutter is compensated; set it after G40", "g100")
    here = _in_system(m, system)
    base = SYSTEMS + 20 * system
    if "r" in words:
        numbers[base + 10] = words["r"]
    rotation = numbers[base + 10]
    origin = m.vector_from_machine(base + 1)
    if by_position:
        wanted = list(here)
        for index, value in given(words):
            wanted[index] = value
        rotate(here, rotation)
        rotate(wanted, rotation)
        origin[0] = here[0] + origin[0] - wanted[0]
        origin[1] = here[1] + origin[1] - wanted[1]
        for index, _ in given(words):
            if index > 1:
                origin[index] = here[index] + origin[index] - wanted[index]
        if active:
            position = state.position()
            rotate(position, state.rotation)
            state.move_to(position)
            state.rotation = 0.0
        changed = {0, 1} | {index for index, _ in given(words)}
    else:
        for index, value in given(words):
            origin[index] = value
        changed = {index for index, _ in given(words)}
    for index in changed:
        numbers[base + 1 + index] = m.to_machine(origin[index]) if index < 3 else origin[index]
    if not active:
        m.out.comment("interpreter: setting coordinate system origin")
        return
    position = state.position()
    rotate(position, state.rotation)
    position = minus(plus(position, state.origin), origin)
    state.origin = origin
    call_origin(m)
    rotate(position, -rotation)
    state.move_to(position)
    state.rotation = rotation
    m.out.call("SET_XY_ROTATION", rotation)


def set_g92(m: Context, block: Block, code: int) -> None:
    """G92: the position gets the values given. G52: the origin is shifted by them, whatever it was shifted before."""
    state = m.state
    _not_compensated(state, f"g{code}")
    m.parameters.numbers[G92_APPLIED] = 1.0
    position = state.position()
    for index, value in given(block.words):
        if code == 520:
            position[index] += state.axis_offset[index] - value
            state.axis_offset[index] = value
        else:
            state.axis_offset[index] = position[index] + state.axis_offset[index] - value
            position[index] = value
    state.move_to(position)
    call_g92(m)
    m.vector_to_machine(G92, state.axis_offset)


def g92_mode(m: Context, code: int) -> None:
    """G92.1 (off and forgotten), G92.2 (off), G92.3 (on again)."""
    state, numbers = m.state, m.parameters.numbers
    _not_compensated(state, f"g{code}")
    position = plus(state.position(), state.axis_offset)
    if code == 923:
        numbers[G92_APPLIED] = 1.0
        state.axis_offset = m.vector_from_machine(G92)
        position = minus(position, state.axis_offset)
    else:
        numbers[G92_APPLIED] = 0.0
        state.axis_offset = list(NOTHING)
        if code == 921:
            numbers[G92 : G92 + 9] = [0.0] * 9
    state.move_to(position)
    call_g92(m)


def _not_compensated(state: State, key: str) -> None:
    if state.comp_side:
        raise Fault("offsets cannot change while the cutter is compensated; write it after G40", key)


def set_tool_offset(m: Context, code: int, block: Block) -> None:
    """G43 (of a tool in the table), G43.1 (given by axis words), G43.4 (for the tool's tip), G49 (none)."""
    state, words = m.state, block.words
    check_switch(m, code)
    if state.comp_side:
        raise Fault("the tool offset cannot change while the cutter is compensated; write it after G40", f"g{code}")
    offset = list(state.tool_offset if code in (431, 432) else NOTHING)
    if code == 431:
        for index, value in given(words):
            offset[index] = value
    elif code == 432 and "h" not in words:
        if not given(words):
            raise Fault("G43.2 adds an offset; write H (of a tool) or axis words", "g432")
        for index, value in given(words):
            offset[index] += value
    elif code != 490:
        if code == 432 and given(words):
            raise Fault("G43.2 has either H or axis words; leave one away", "h")
        tool = m.tools.slots[_slot(m, words)]
        offset = plus(offset, [m.from_machine(length) for length in tool.offset[:3]] + list(tool.offset[3:]))
    switch(m, code, offset)
    m.out.call("USE_TOOL_LENGTH_OFFSET", *offset, 0.0, 0.0, 0.0)
    shift = minus(state.tool_offset, offset)
    rotate(shift, -state.rotation)
    state.move_to(plus(state.position(), shift))
    state.tool_offset = offset


def _slot(m: Context, words: dict[str, float]) -> int:
    if "h" not in words:
        return 0
    try:
        return m.tools.find(int(words["h"]))
    except Fault as fault:
        fault.key = "h"
        raise


def set_tool(m: Context, block: Block) -> None:
    """G10 L1 (the tool's offset is what is given), L10 and L11 (it is such that the position becomes what is given, in
    the active coordinate system or in G59.3), L0 (the table is read anew): for this run, the file stays as it is.
    """
    words, tools = block.words, m.tools
    kind = int(words["l"])
    if kind == 0:
        if tools.spindle.number:
            raise Fault("G10 L0 does not go with a tool in the spindle; write T0 M6 before", "g100")
        m.out.call("RELOAD_TOOLDATA")
        return
    if kind != 1:
        _not_compensated(m.state, "g100")
    try:
        slot = tools.find(int(words["p"] + 0.5))
    except Fault as fault:
        fault.key = "p"
        raise
    tool = tools.slots[slot]
    offset = [m.from_machine(length) for length in tool.offset[:3]] + list(tool.offset[3:])
    axes = dict(given(words))
    if kind == 1:
        for index, value in axes.items():
            offset[index] = value
    else:
        _offset_by_position(m, axes, offset, fixture=kind == 11)
    orientation = tool.orientation
    if "q" in words:
        orientation = int(words["q"])
        if orientation != words["q"] or not 0 <= orientation <= 9:
            raise Fault(f"Q{words['q']:g} is no orientation of a lathe tool; write 0 to 9", "q")
    changed = tool._replace(
        offset=tuple([m.to_machine(length) for length in offset[:3]] + offset[3:]),
        diameter=m.to_machine(words["r"]) * 2.0 if "r" in words else tool.diameter,
        front=words.get("i", tool.front),
        back=words.get("j", tool.back),
        orientation=orientation,
    )
    tools.slots[slot] = changed
    entry = (changed.number, *changed.offset, 0.0, 0.0, 0.0, changed.front, changed.back, changed.orientation)
    m.out.call("SET_TOOL_TABLE_ENTRY", slot, *entry)
    if slot == tools.loaded:
        tools.put(slot)
        m.out.call("SET_TOOL_TABLE_ENTRY", 0, *entry)
    tell_tool(m)


def _offset_by_position(m: Context, axes: dict[int, float], offset: list[float], *, fixture: bool) -> None:
    """The offset with which the position gets the values given, in the active system, or in that of the fixture (G59.3
    without G92); the part along an axis of the (perhaps turned) system that is not given stays.
    """
    state = m.state
    system = 9 if fixture else state.origin_index
    rotation = m.parameters.numbers[SYSTEMS + 20 * system + 10]
    here = plus(state.position(), state.axis_offset)
    rotate(here, state.rotation)
    here = minus(plus(plus(here, state.origin), state.tool_offset), m.vector_from_machine(SYSTEMS + 20 * system + 1))
    rotate(here, -rotation)
    if not fixture and m.parameters.numbers[G92_APPLIED]:
        here = minus(here, m.vector_from_machine(G92))
    for index, value in axes.items():
        if index > 1:
            offset[index] = here[index] - value
    if 0 in axes or 1 in axes:
        kept = offset[:2]
        rotate(kept, -rotation)
        wanted = [here[index] - axes[index] if index in axes else kept[index] for index in (0, 1)]
        rotate(wanted, rotation)
        offset[:2] = wanted


def tell_tool(m: Context) -> None:
    """Parameters 5400 to 5413: the tool in the spindle."""
    tool = m.tools.spindle
    numbers = [float(tool.number), *tool.offset, 0.0, 0.0, 0.0]
    numbers += [tool.diameter, tool.front, tool.back, float(tool.orientation)]
    m.parameters.numbers[TOOL : TOOL + 14] = numbers


def in_machine(m: Context, position: list[float]) -> list[float]:
    """A position in program coordinates in the machine's, program units."""
    found = plus(position, m.state.axis_offset)
    rotate(found, m.state.rotation)
    return plus(plus(found, m.state.tool_offset), m.state.origin)


def from_machine(m: Context, position: list[float]) -> list[float]:
    """A position in the machine in program coordinates. Rotary tool offsets are left out, as in LinuxCNC."""
    state = m.state
    found = minus(position, state.origin)
    found[:3] = [value - offset for value, offset in zip(found[:3], state.tool_offset[:3], strict=True)]
    rotate(found, -state.rotation)
    return minus(found, state.axis_offset)


def keep_home(m: Context, code: int) -> None:
    """G28.1, G30.1: this is where G28 or G30 goes."""
    if m.state.comp_side:
        raise Fault("the reference point cannot be set while the cutter is compensated; set it after G40", f"g{code}")
    home = G28_HOME if code == 281 else G30_HOME
    m.vector_to_machine(home, in_machine(m, m.state.position()))


def home_of(m: Context, code: int) -> list[float]:
    """Where G28 or G30 goes, in program coordinates."""
    return from_machine(m, m.vector_from_machine(G28_HOME if code == 280 else G30_HOME))


def set_units(m: Context, code: int) -> None:
    """G20, G21: positions and offsets so far are the same lengths in the new units."""
    state = m.state
    inches = int(code == 200)
    m.out.call("USE_LENGTH_UNITS", "INCHES" if inches else "MM")
    if inches == state.inches:
        return
    state.inches = inches
    factor = 1.0 / INCH if inches else INCH
    for name in ("x", "y", "z"):
        setattr(state, name, getattr(state, name) * factor)
    for vector in (state.origin, state.axis_offset, state.tool_offset):
        vector[:3] = [length * factor for length in vector[:3]]
    for compensation in (m.out.compensation, m.leaving):
        if compensation is not None:
            compensation.scale(factor, "INCHES" if inches else "MM")
