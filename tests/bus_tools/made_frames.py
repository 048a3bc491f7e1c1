"""Frames of every kind, for logs and servers."""

from __future__ import annotations

import can

START = 1_700_000_000.25  # s since the epoch, a whole number of ms


def frame(identifier: int = 0x123, data: bytes = b"", at: float = 0.0, **flags: object) -> can.Message:
    """A standard frame `at` s after the start."""
    options: dict = {"is_extended_id": False, **flags}
    return can.Message(arbitration_id=identifier, data=data, timestamp=START + at, **options)


def of_every_kind() -> list[can.Message]:
    """Standard and extended, short and long, remote, FD, own and error frames, at uneven times."""
    kinds = [
        frame(0x000),
        frame(0x7FF, bytes(range(8))),
        frame(0x123, b"\xff"),
        frame(0x123, b"ab", is_rx=False),
        frame(0x00000021, b"\x01\x02", is_extended_id=True),
        frame(0x1FFFFFFF, bytes(8), is_extended_id=True),
        frame(0x101, is_remote_frame=True),
        frame(0x102, is_remote_frame=True, dlc=5),
        frame(0x1ABCDE, is_extended_id=True, is_remote_frame=True, dlc=8),
        frame(0x100, bytes(range(12)), is_fd=True),
        frame(0x100, bytes(range(64)), is_fd=True, bitrate_switch=True),
        frame(0x18DAF110, bytes(20), is_fd=True, is_extended_id=True, error_state_indicator=True),
        frame(0x100, b"\x05", is_fd=True),
        frame(0, is_error_frame=True, is_extended_id=True),
        frame(0x22, b"last", at=0.0),
    ]
    for k, message in enumerate(kinds):
        message.timestamp = START + k * 0.0123457
    return kinds


def kept(message: can.Message) -> tuple[object, ...]:
    """What two frames must agree in, times aside. Of an error frame, formats keep only that it was one."""
    if message.is_error_frame:
        return ("error",)
    return (
        message.arbitration_id,
        bytes(message.data),
        message.dlc,
        message.is_extended_id,
        message.is_remote_frame,
        message.is_fd,
        message.bitrate_switch,
        message.error_state_indicator,
    )
