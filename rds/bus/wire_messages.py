"""Messages of python-can as records of the built-in bus's wire, and back."""

from __future__ import annotations

import struct
import time
from typing import Any

import can

from rds.bus import wire


def record_of(msg: can.Message) -> bytes:
    """The record, with the present instant, which tells the hub how late it is. ValueError for no possible frame."""
    data = msg.data
    length = len(data)
    flags = 0
    if msg.is_extended_id:
        flags = wire.EXTENDED
    if msg.is_remote_frame:
        flags |= wire.REMOTE
    if msg.is_error_frame:
        flags |= wire.ERROR
    if msg.is_fd:
        flags |= wire.FD
        if msg.bitrate_switch:
            flags |= wire.BITRATE_SWITCH
        if msg.error_state_indicator:
            flags |= wire.ERROR_STATE
    try:
        header = wire.HEADER.pack(time.monotonic_ns(), msg.arbitration_id, wire.FRAME, flags, msg.dlc, length)
        if flags or length > 8 or msg.arbitration_id > 0x7FF or msg.dlc != length:
            wire.check_frame(header[wire.KEY_AT])
    except (wire.WireError, struct.error) as error:
        raise ValueError(f"no such frame can be sent: {msg!r}: {error}") from None
    return (header + data).ljust(wire.RECORD, b"\0")


def message_of(record: bytes, channel: Any) -> can.Message:
    """The message of a whole record; it bears `channel`."""
    stamp, identifier, _, flags, dlc, length = wire.HEADER.unpack_from(record)
    if not flags:
        return can.Message(
            stamp * 1e-9,
            identifier,
            False,
            False,
            False,
            channel,
            dlc,
            bytearray(record[16 : 16 + length]),
        )
    return can.Message(
        timestamp=stamp * 1e-9,
        arbitration_id=identifier,
        is_extended_id=bool(flags & wire.EXTENDED),
        is_remote_frame=bool(flags & wire.REMOTE),
        is_error_frame=bool(flags & wire.ERROR),
        channel=channel,
        dlc=dlc,
        data=bytearray(record[16 : 16 + length]),
        is_fd=bool(flags & wire.FD),
        is_rx=not flags & wire.OWN,
        bitrate_switch=bool(flags & wire.BITRATE_SWITCH),
        error_state_indicator=bool(flags & wire.ERROR_STATE),
    )


def filters_of(filters: Any) -> list[wire.Filter]:
    """The wire's filters for python-can's; none for None, which lets everything through."""
    if filters is None:
        return []
    return [wire.Filter(f["can_id"] & 0xFFFFFFFF, f["can_mask"] & 0xFFFFFFFF, f.get("extended")) for f in filters]
