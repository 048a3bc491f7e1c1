"""What tests of media in virtual time share."""

from __future__ import annotations

from rds.bus.hub import wire
from rds.bus.medium.medium import Delivery, Medium
from rds.bus.medium.station import Station
from rds.bus.medium.timed_medium import TimedMedium

MBIT = 1_000_000


def record(identifier: int, data: bytes = b"", flags: int = 0, dlc: int | None = None) -> bytes:
    """A frame as the hub sees it."""
    header = wire.HEADER.pack(0, identifier, wire.FRAME, flags, len(data) if dlc is None else dlc, len(data))
    return header + data.ljust(wire.DATA, b"\0")


def identifier_of(delivery: Delivery[str]) -> int:
    """Of the frame."""
    return int(wire.HEADER.unpack_from(delivery.frame)[1])


def bus(*names: str, bitrate: int = MBIT, data_bitrate: int | None = None) -> TimedMedium[str]:
    """A timed bus with these nodes (default: A, B, C)."""
    medium: TimedMedium[str] = TimedMedium(bitrate, data_bitrate)
    for number, name in enumerate(names or ("A", "B", "C")):
        medium.join(name, Station(number, name), 0)
    return medium


def drain(medium: Medium[str], now: int) -> list[Delivery[str]]:
    """Everything that is complete."""
    taken = []
    while (delivery := medium.take(now)) is not None:
        taken.append(delivery)
    return taken
