"""Whole messages over a pipe: eight bytes of length, then the bytes."""

from __future__ import annotations

from typing import IO

FUNCTION, ITEM = b"f", b"i"  # what a message to a worker begins with


def send(stream: IO[bytes], data: bytes) -> None:
    """Write one message."""
    stream.write(len(data).to_bytes(8, "little"))
    stream.write(data)
    stream.flush()


def receive(stream: IO[bytes]) -> bytes:
    """Read one message; EOFError if the other side is gone."""
    return _exactly(stream, int.from_bytes(_exactly(stream, 8), "little"))


def _exactly(stream: IO[bytes], count: int) -> bytes:
    data = stream.read(count)
    if len(data) < count:
        raise EOFError
    return data
