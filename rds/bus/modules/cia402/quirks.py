"""What is wrong with a drive out of the box, for trying how it is found: a simulated drive has it on request."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum

from rds.core.errors import InputError


class Quirk(StrEnum):
    """One thing that is wrong."""

    WRONG_SIGN = "wrong-sign"  # a positive torque moves the encoder downwards: motor phases or encoder are swapped
    WRONG_GEAR = "wrong-gear"  # 0x6091 tells a gear of 10:1 that is not there
    ZERO_LIMITS = "zero-limits"  # 0x6072 and 0x607D are zero
    CLOSED_BRAKE = "closed-brake"  # the axis does not move
    FIXED_MAPPING = "fixed-mapping"  # 0x1600 and 0x1A00 cannot be written
    NO_NODE_ID = "no-node-id"  # it has none until LSS gives it one


def read_quirks(words: str | Iterable[str]) -> frozenset[Quirk]:
    """From names, or from one text of names with commas. InputError for one that there is not."""
    names = words.split(",") if isinstance(words, str) else words
    try:
        return frozenset(Quirk(name.strip()) for name in names if name.strip())
    except ValueError as error:
        raise InputError(f"{error}; there are {', '.join(Quirk)}", "quirks") from None
