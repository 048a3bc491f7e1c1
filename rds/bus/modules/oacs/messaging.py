"""Sending and hearing messages on a python-can bus, with the bus's errors in the words of the machine's user."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import NamedTuple

import can

from rds.bus.modules.oacs import messages
from rds.bus.modules.oacs.messages import Decoded, Frame
from rds.bus.tools.link import bus_failed
from rds.bus.tools.listening import frames_within
from rds.core.errors import MachineError


class ReceivedMessage(NamedTuple):
    """A message, its time stamp (s, the bus's clock) and when it was in hand (s, time.monotonic)."""

    message: Decoded
    stamp: float
    at: float


def send(bus: can.BusABC, frame: Frame) -> None:
    """Put a frame on the bus. MachineError if the bus does not take it."""
    identifier, data, extended = frame
    try:
        bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=extended), timeout=0.5)
    except (can.CanError, OSError) as error:
        raise bus_failed(bus.channel_info, error) from error


def hear(bus: can.BusABC, until: float) -> ReceivedMessage | None:
    """The next message of a module; None if there is none until `until` (time.monotonic). MachineError: bus failed.

    Frames of others, and frames that make no sense, are passed over: on a bus everybody may speak.
    """
    while True:
        left = until - time.monotonic()
        try:
            frame = bus.recv(max(left, 0.0))
        except (can.CanError, OSError) as error:
            raise bus_failed(bus.channel_info, error) from error
        if frame is None:
            if left <= 0.0:
                return None
            continue
        if (heard := _heard(frame)) is not None:
            return heard


def hear_all(bus: can.BusABC, seconds: float) -> Iterator[ReceivedMessage]:
    """Every message of the next `seconds`. MachineError: bus failed."""
    try:
        for frame in frames_within(bus, seconds):
            if (heard := _heard(frame)) is not None:
                yield heard
    except (can.CanError, OSError) as error:
        raise bus_failed(bus.channel_info, error) from error


def _heard(frame: can.Message) -> ReceivedMessage | None:
    """The message that a frame is; None if it is somebody else's, or makes no sense."""
    if frame.is_error_frame or frame.is_remote_frame:
        return None
    if messages.kind_of(frame.arbitration_id, frame.is_extended_id) is None:
        return None
    try:
        message = messages.decode(frame.arbitration_id, frame.data, frame.is_extended_id)
    except MachineError:
        return None
    return ReceivedMessage(message, frame.timestamp, time.monotonic())
