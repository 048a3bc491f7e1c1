"""How long a disturbed frame keeps the bus: up to the faulty bit, then flags and delimiter of the error frame.

The sender sees the faulty bit at once and sends its error flag, six equal bits. The others notice it by the sixth
equal bit in a row, and send theirs; so the flags together last 6 to 12 bits, the frame's own bits before the fault
decide. Source: ISO 11898-1, 10.4.4 (error frame: superposition of flags, delimiter of 8 bits) and 10.5 (stuffing).
"""

from __future__ import annotations

from rds.bus.medium.bit_string import BitString
from rds.bus.medium.bits import ERROR_DELIMITER, ERROR_FLAG, Bits
from rds.core.errors import InputError

_BEHIND_ARBITRATION = ("ide", "fdf")  # first field after arbitration, of a standard and an extended frame


def vulnerable(string: BitString, extended: bool) -> range:
    """The bits in which an error can be injected: behind arbitration, before the CRC's delimiter (FD: before its CRC).

    A bit that changes during arbitration is a lost arbitration; what changes behind the CRC does not strike all
    nodes alike.
    """
    names = {field.name for field in string.fields}
    last = "stuff count" if "stuff count" in names else "delimiter"
    return range(string.field(_BEHIND_ARBITRATION[extended]).start, string.field(last).start)


def faulty_bit(string: BitString, extended: bool, bit: int | None) -> int:
    """The bit to disturb: `bit`, or by default the frame's middle, or where arbitration ends if that is later.

    Positions count the bits on the wire from 0, the start bit. InputError outside the vulnerable part.
    """
    allowed = vulnerable(string, extended)
    if bit is None:
        return min(max(len(string.bits) // 2, allowed.start), allowed.stop - 1)
    if bit not in allowed:
        raise InputError(
            f"bit {bit} can't be disturbed in this frame; bits {allowed.start} to {allowed.stop - 1} can "
            "(behind arbitration, before the end of its CRC)"
        )
    return bit


def flipped(string: BitString, bit: int) -> str:
    """What all nodes see up to the faulty bit, and it the other way round."""
    return string.bits[:bit] + "10"[int(string.bits[bit])]


def broken_frame(string: BitString, seen: str, passive: bool, answered: bool) -> Bits:
    """Bits of a frame that is broken off, with its error frame, without interframe space.

    `seen` is what was on the wire up to and with the faulty bit; `passive`: the sender's flag is recessive;
    `answered`: an error-active node sees the flag and sends its own.
    """
    bit = len(seen) - 1
    fast = len([position for position in string.fast if position <= bit])
    nominal = len(seen) - fast
    until_noticed = noticed_after(seen, "1" if passive else "0") if answered else 0
    if bit in string.fast:
        # the others still sample at the data's rate until they notice
        return Bits(nominal + ERROR_FLAG + ERROR_DELIMITER, fast + until_noticed)
    return Bits(nominal + until_noticed + ERROR_FLAG + ERROR_DELIMITER, fast)


def noticed_after(seen: str, flag: str) -> int:
    """How many bits of an error flag (of this level) pass until its sixth equal bit in a row; 0: no later than it."""
    run = len(seen) - len(seen.rstrip(seen[-1]))
    if run > 5:  # the faulty bit itself breaks the rule of stuffing
        return 0
    return 6 - run if seen[-1] == flag else 6
