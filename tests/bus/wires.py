"""What tests of media in virtual time share."""

from __future__ import annotations

from typing import Any

from rds.bus.hub import wire
from rds.bus.medium.fault_kinds import Fault
from rds.bus.medium.injector import Injector
from rds.bus.medium.medium import Delivery, Medium, UntimedMedium
from rds.bus.medium.station import Station
from rds.bus.medium.timed_medium import TimedMedium

MBIT = 1_000_000
SECOND = 1_000_000_000


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


def untimed() -> UntimedMedium[str]:
    medium: UntimedMedium[str] = UntimedMedium()
    for number, name in enumerate("ABC"):
        medium.join(name, Station(number, name), 0)
    return medium


class Hand:
    """An injector, and what it noted."""

    def __init__(self, medium: Medium[str]):
        self.notes: list[str] = []
        self.medium = medium
        self.injector = Injector(medium, self.notes.append)

    def inject(self, kind: str, now: int = 0, owner: object = None, **words: Any) -> None:
        self.injector.inject([Fault(kind, **words)], now, owner)


def heard(medium: Medium[str], now: int) -> list[tuple[int, str]]:
    """(identifier, who got it) of what is complete."""
    found = []
    for delivery in drain(medium, now):
        getters = [name for name in "ABC" if name != delivery.sender and name not in delivery.deaf]
        found.append((identifier_of(delivery), "".join(getters)))
    return found
