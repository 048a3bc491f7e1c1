"""M62 to M68: outputs of the machine, and what its inputs say."""

from __future__ import annotations

from rds.nc.language.context import Context
from rds.nc.language.expressions import Fault
from rds.nc.language.parameters import INPUT


def signal(m: Context, code: int, words: dict[str, float]) -> None:
    """M62 to M65 P (digital outputs on and off, with motion or at once), M66 P or E (an input), M67 and M68 E Q (analog
    outputs).
    """
    key = f"m{code}"
    if m.state.comp_side:
        raise Fault("inputs and outputs do not go with cutter compensation; write it after G40", key)
    letter = "p" if code <= 65 else "e"
    if code == 66:
        _read_input(m, words)
        return
    if letter not in words:
        raise Fault(f"M{code} needs {letter.upper()}, the number of the output; add it", key)
    index = round(words[letter])
    if index < 0:
        raise Fault(f"{letter.upper()}{words[letter]:g} is no output; they count from 0", letter)
    where = "AUX" if code in (64, 65, 68) else "MOTION"
    if code <= 65:
        m.out.call(f"{'SET' if code in (62, 64) else 'CLEAR'}_{where}_OUTPUT_BIT", index)
    else:
        m.out.call(f"SET_{where}_OUTPUT_VALUE", index, words.get("q", -1.0))


def _read_input(m: Context, words: dict[str, float]) -> None:
    """M66: nothing answers here, so #5399 keeps its value, as for `rs274`."""
    if ("p" in words) == ("e" in words):
        raise Fault("M66 reads one input; write P (digital) or E (analog) with its number", "m66")
    letter = "p" if "p" in words else "e"
    if words[letter] < 0.0:
        raise Fault(f"{letter.upper()}{words[letter]:g} is no input; they count from 0", letter)
    if words.get("l", 0.0) and (letter == "e" or words.get("q", 0.0) <= 0.0):
        raise Fault("M66 waits (L1 to L4) only for a digital input P, with Q above 0, the seconds at most", "l")
    m.out.call("WAIT", letter.upper(), round(words[letter]), int(words.get("l", 0.0)), words.get("q", 0.0))
    if letter == "p":
        m.parameters.numbers[INPUT] = float(m.parameters.numbers[INPUT] != 0.0)
