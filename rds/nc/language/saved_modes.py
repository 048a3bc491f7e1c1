"""M70 to M73: modes that are saved, and restored later or when a subroutine returns.

They are restored as LinuxCNC does it: by a line of the words that differ, with F in tenths and S in whole numbers.
"""

from __future__ import annotations

from typing import NamedTuple

from rds.nc.language.context import INCH
from rds.nc.language.parameters import G92_APPLIED, Parameters
from rds.nc.language.state import INVERSE_TIME, PER_MINUTE, State

# In the order in which LinuxCNC restores them: G words, then M words.
_WORDS = (
    *("plane", "compensation", "distance", "feed", "system", "tool offset"),
    *("retract", "spindle", "arc distance", "diameter", "g92"),
)
_COMMANDS = ("turning", "mist", "flood", "overrides")


class SavedModes(NamedTuple):
    """What M70 or M73 found. `again`: M73, they are restored when the subroutine returns."""

    units: str
    words: dict[str, str]
    commands: dict[str, str]
    feed: float
    speed: float
    path: tuple[str, float, float]  # mode, tolerance, collinear, in mm
    again: bool = False


def modes_now(state: State, parameters: Parameters, again: bool = False) -> SavedModes:
    """The modes in force."""
    system = 53 + state.origin_index
    words = {
        "plane": f"G{17 + state.plane}",
        "compensation": {0: "G40", 1: "G41", -1: "G42"}[state.comp_side],
        "distance": "G90" if state.absolute else "G91",
        "feed": {INVERSE_TIME: "G93", PER_MINUTE: "G94"}.get(state.feed_mode, "G95"),
        "system": f"G{system}" if system <= 59 else f"G59.{system - 59}",
        "tool offset": "G43" if any(state.tool_offset) else "G49",
        "retract": "G98" if state.retract_high else "G99",
        "spindle": "G96" if state.surface_speed else "G97",
        "arc distance": "G90.1" if state.arc_absolute else "G91.1",
        "diameter": "G7" if state.diameter else "G8",
        "g92": "G92.3" if parameters.numbers[G92_APPLIED] else "G92.2",
    }
    commands = {
        "turning": {0: "M5", 1: "M3", -1: "M4"}[state.spindle],
        "mist": "M7" if state.mist else "" if state.flood else "M9",
        "flood": "M8" if state.flood else "",
        "overrides": "M48" if state.feed_override else "M51",
    }
    units = "G20" if state.inches else "G21"
    path = (state.path_mode, state.path_tolerance, state.path_collinear)
    return SavedModes(units, words, commands, state.feed_rate, state.speed, path, again)


def lines_to_restore(saved: SavedModes, now: SavedModes, inches: bool) -> list[str]:
    """The lines that bring the saved modes back, when `now` (with the saved units) is in force."""
    text = ""
    if saved.feed != now.feed:
        text += f"f{saved.feed:.1f}"
    if saved.speed != now.speed:
        text += f"s{saved.speed:.0f}"
    text += "".join(saved.words[name].lower() for name in _WORDS if saved.words[name] != now.words[name])
    mode, tolerance, collinear = saved.path
    if mode == "CONTINUOUS" and saved.path != now.path:
        unit = INCH if inches else 1.0
        text += f"g64p{tolerance / unit:f}q{collinear / unit:f}"
    elif mode != now.path[0]:
        text += {"EXACT_PATH": "g61", "EXACT_STOP": "g61.1"}[mode]
    changed = (saved.commands[name] for name in _COMMANDS if saved.commands[name] != now.commands[name])
    commands = [word.lower() for word in changed if word]
    first = [text + "".join(commands[:1])]
    return [line for line in (*first, *commands[1:]) if line]
