"""The named parameters that LinuxCNC gives every program, which tell the interpreter's state: #<_x>, #<_feed>, ..."""

from __future__ import annotations

from collections.abc import Callable

from rds.nc.language.context import Context
from rds.nc.language.control import Control
from rds.nc.language.expressions import Fault
from rds.nc.language.offsets import in_machine
from rds.nc.language.state import INVERSE_TIME, PER_MINUTE, PER_REVOLUTION


def known_names(m: Context, control: Control, line: Callable[[], int]) -> dict[str, Callable[[], float]]:
    """What each predefined name gives when it is asked for."""
    state, tools = m.state, m.tools

    def position(index: int, in_the_machine: bool) -> Callable[[], float]:
        def value() -> float:
            if state.comp_side:
                raise Fault("the position cannot be read while the cutter is compensated; read it after G40")
            return (in_machine(m, state.position()) if in_the_machine else state.position())[index]

        return value

    names: dict[str, Callable[[], float]] = {
        "_line": lambda: float(line()),
        "_motion_mode": lambda: float(state.motion),
        "_plane": lambda: 170.0 + 10.0 * state.plane,
        "_ccomp": lambda: {0: 400.0, 1: 410.0, -1: 420.0}[state.comp_side],
        "_metric": lambda: float(not state.inches),
        "_imperial": lambda: float(state.inches),
        "_absolute": lambda: float(state.absolute),
        "_incremental": lambda: float(not state.absolute),
        "_inverse_time": lambda: float(state.feed_mode == INVERSE_TIME),
        "_units_per_minute": lambda: float(state.feed_mode == PER_MINUTE),
        "_units_per_rev": lambda: float(state.feed_mode == PER_REVOLUTION),
        "_coord_system": lambda: (
            530.0 + 10.0 * state.origin_index if state.origin_index < 7 else 584.0 + state.origin_index
        ),
        "_retract_r_plane": lambda: float(not state.retract_high),
        "_retract_old_z": lambda: float(state.retract_high),
        "_spindle_rpm_mode": lambda: float(not state.surface_speed),
        "_spindle_css_mode": lambda: float(state.surface_speed),
        "_lathe_diameter_mode": lambda: float(state.diameter),
        "_lathe_radius_mode": lambda: float(not state.diameter),
        "_tool_offset": lambda: float(any(state.tool_offset)),
        "_ijk_absolute_mode": lambda: float(state.arc_absolute),
        "_spindle_on": lambda: float(state.spindle != 0),
        "_spindle_cw": lambda: float(state.spindle == 1),
        "_mist": lambda: float(state.mist),
        "_flood": lambda: float(state.flood),
        "_speed_override": lambda: float(state.speed_override),
        "_feed_override": lambda: float(state.feed_override),
        "_adaptive_feed": lambda: float(state.adaptive_feed),
        "_feed_hold": lambda: float(state.feed_hold),
        "_feed": lambda: state.feed_rate,
        "_rpm": lambda: abs(state.speed),
        "_current_tool": lambda: float(tools.spindle.number),
        "_selected_tool": lambda: float(tools.slots[tools.selected].number if tools.selected > 0 else 0),
        "_current_pocket": lambda: float(tools.spindle.pocket),
        "_selected_pocket": lambda: float(tools.slots[tools.selected].pocket if tools.selected > 0 else tools.selected),
        "_value": lambda: control.value,
        "_value_returned": lambda: float(control.returned),
        "_call_level": lambda: float(control.depth),
        # of the interpreter that this one follows, LinuxCNC's 2.9.0; nothing is remapped, and no task runs above it
        **dict.fromkeys(("_vminor", "_remap_level", "_task", "_u", "_v", "_w"), lambda: 0.0),
        "_vmajor": lambda: 2.9,
    }
    for index, axis in enumerate("xyzabc"):
        names[f"_{axis}"] = position(index, False)
        names[f"_abs_{axis}"] = position(index, True)
    return names
