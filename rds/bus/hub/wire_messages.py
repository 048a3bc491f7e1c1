"""Messages of python-can as records of the built-in bus's wire, and back."""

from __future__ import annotations

import struct
import time
from collections.abc import Iterable
from operator import index
from typing import Any

import can

from rds.bus.hub import wire

_WORD = 0xFFFFFFFF


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
        why = f"identifier {msg.arbitration_id} is less than 0" if msg.arbitration_id < 0 else error
        raise ValueError(f"no such frame can be sent: {msg!r}: {why}") from None
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


def filters_of(filters: Iterable[Any]) -> list[wire.Filter]:
    """The wire's filters for python-can's. ValueError for what is none of them."""
    return [_filter_of(each) for each in filters]


def _filter_of(given: Any) -> wire.Filter:
    try:
        extended = given.get("extended")
        return wire.Filter(index(given["can_id"]) & _WORD, index(given["can_mask"]) & _WORD, extended)
    except (TypeError, AttributeError, KeyError):
        raise ValueError(
            f"filter {given!r} must be a dict with the whole numbers can_id and can_mask, and extended (true or false) "
            "where it matters"
        ) from None
