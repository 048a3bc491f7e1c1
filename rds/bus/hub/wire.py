"""What the built-in bus's nodes and its hub say to each other: records of 80 bytes, no I/O here.

A record is a header of 16 bytes and 64 bytes of data:

    int64 time stamp, ns since the epoch · uint32 identifier · uint8 kind · uint8 flags · uint8 dlc · uint8 length

All little-endian. With one size for all, one receive call is one frame, and bytes 8 to 15, the *key*, say all that
the hub has to know of a frame: whether it is valid and whom it is for.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct
from typing import NamedTuple

RECORD = 80  # bytes
DATA = 64  # bytes of data in a record
HEADER = Struct("<qIBBBB")
KEY = Struct("<IBBBB")
KEY_AT = slice(8, 16)
STAMP = Struct("<q")

# kinds of record
FRAME, HELLO, FILTERS, WELCOME, GOODBYE, SETTINGS, CONTROL = range(7)

# flags of a frame
EXTENDED, REMOTE, ERROR, FD, BITRATE_SWITCH, ERROR_STATE, OWN = (1 << bit for bit in range(7))

# purposes of a hello: become a node; change the filters of the node with this number; ask and tell the hub things
JOIN, RETUNE, ASK = range(3)

_MAGIC = b"rds-can1"
_HELLO = Struct("<8sBBHQ32sB")
_SETTINGS = Struct("<IIqB")
_WELCOME = Struct("<QQII")
_FILTER = Struct("<IIB")
FILTERS_PER_RECORD = DATA // _FILTER.size
NAME = DATA - _SETTINGS.size  # bytes
_FD_LENGTHS = frozenset((*range(9), 12, 16, 20, 24, 32, 48, 64))


class WireError(Exception):
    """A record that nobody who keeps the protocol would have sent; the text says what is wrong with it."""


class Filter(NamedTuple):
    """A frame passes if identifier & mask == wanted & mask, and it is extended as asked (None: either)."""

    wanted: int
    mask: int
    extended: bool | None = None

    def passes(self, identifier: int, extended: bool) -> bool:
        """Whether a frame with this identifier passes."""
        return (identifier ^ self.wanted) & self.mask == 0 and self.extended in (None, extended)


class Hello(NamedTuple):
    """The first record of a connection. `filters` records follow it, seven filters in each."""

    purpose: int
    receive_own: bool
    filters: int  # how many
    node: int  # whose filters to change (RETUNE)
    token: bytes  # 32 bytes, proof of being the same user where the transport gives none
    settings: bool = False  # a record of settings follows, before the filters


class Settings(NamedTuple):
    """What a node may say of itself and of the bus that it expects."""

    name: str = ""  # at most NAME bytes
    bitrate: int = 0  # bit/s; 0: whatever there is
    data_bitrate: int = 0
    restart_ms: int = -1  # from bus off to the request for recovery; -1: never by itself
    error_frames: bool = False  # whether it wants its controller's error frames


class Welcome(NamedTuple):
    """The hub's answer to a hello. Rates in bit/s; 0 on a bus without bit timing."""

    node: int
    hub_pid: int
    bitrate: int = 0
    data_bitrate: int = 0


def record(kind: int, data: bytes = b"") -> bytes:
    """A record that is not a frame."""
    return HEADER.pack(0, 0, kind, 0, 0, len(data)) + data.ljust(DATA, b"\0")


def encode_hello(hello: Hello) -> bytes:
    """The record of `hello`."""
    return record(HELLO, _HELLO.pack(_MAGIC, *hello))


def decode_hello(data: bytes) -> Hello:
    """The hello in a whole record; WireError if it is none, or of another version."""
    if data[12] != HELLO:
        raise WireError(f"the first record is of kind {data[12]} instead of a hello")
    magic, purpose, receive_own, filters, node, token, settings = _HELLO.unpack_from(data, HEADER.size)
    if magic != _MAGIC:
        raise WireError("a hello of another program or version")
    if purpose not in (JOIN, RETUNE, ASK):
        raise WireError(f"the hello's purpose {purpose} is unknown")
    return Hello(purpose, bool(receive_own), filters, node, token, bool(settings))


def encode_settings(settings: Settings) -> bytes:
    """The record of `settings`."""
    name, *numbers = settings
    return record(SETTINGS, _SETTINGS.pack(*numbers) + name.encode())


def decode_settings(data: bytes) -> Settings:
    """The settings in a whole record; WireError if it holds none."""
    if data[12] != SETTINGS or not _SETTINGS.size <= data[15] <= DATA:
        raise WireError(f"a record of kind {data[12]} instead of settings")
    bitrate, data_bitrate, restart_ms, error_frames = _SETTINGS.unpack_from(data, HEADER.size)
    name = data[HEADER.size + _SETTINGS.size : HEADER.size + data[15]].decode(errors="replace")
    return Settings(name, bitrate, data_bitrate, restart_ms, bool(error_frames))


def encode_text(text: str) -> bytes:
    """A question or an answer as records; each but the last has its flag set."""
    body = text.encode()
    parts = [body[i : i + DATA] for i in range(0, len(body), DATA)] or [b""]
    last = len(parts) - 1
    return b"".join(
        HEADER.pack(0, 0, CONTROL, number < last, 0, len(part)) + part.ljust(DATA, b"\0")
        for number, part in enumerate(parts)
    )


def decode_part(data: bytes) -> tuple[bytes, bool]:
    """The part of a text in a record, and whether more follows; WireError carries the hub's reason if it refused."""
    if data[12] == GOODBYE:
        raise WireError(goodbye_reason(data))
    if data[12] != CONTROL or data[15] > DATA:
        raise WireError(f"a record of kind {data[12]} instead of a question")
    return data[HEADER.size : HEADER.size + data[15]], bool(data[13])


def encode_filters(filters: Sequence[Filter]) -> bytes:
    """As many records as the filters need."""
    packed = [_FILTER.pack(wanted, mask, 2 if ext is None else int(ext)) for wanted, mask, ext in filters]
    step = FILTERS_PER_RECORD
    return b"".join(record(FILTERS, b"".join(packed[i : i + step])) for i in range(0, len(packed), step))


def decode_filters(data: bytes) -> list[Filter]:
    """The filters in one whole record; WireError if it holds none."""
    length = data[15]
    if data[12] != FILTERS or length == 0 or length % _FILTER.size or length > DATA:
        raise WireError(f"a record of kind {data[12]} with {length} bytes instead of filters")
    body = data[HEADER.size : HEADER.size + length]
    return [Filter(wanted, mask, None if ext == 2 else bool(ext)) for wanted, mask, ext in _FILTER.iter_unpack(body)]


def encode_welcome(welcome: Welcome) -> bytes:
    """The record of `welcome`."""
    return record(WELCOME, _WELCOME.pack(*welcome))


def decode_welcome(data: bytes) -> Welcome:
    """The welcome in a whole record; WireError carries the hub's reason if it refused."""
    if data[12] == GOODBYE:
        raise WireError(goodbye_reason(data))
    if data[12] != WELCOME:
        raise WireError(f"the hub answered with a record of kind {data[12]} instead of a welcome")
    return Welcome._make(_WELCOME.unpack_from(data, HEADER.size))


def encode_goodbye(reason: str) -> bytes:
    """The last record that a node gets; the reason is cut to 64 bytes."""
    return record(GOODBYE, reason.encode("ascii", "replace")[:DATA])


def goodbye_reason(data: bytes) -> str:
    """Why the hub let the node go."""
    return data[HEADER.size : HEADER.size + data[15]].decode("ascii", "replace")


def check_frame(key: bytes) -> tuple[int, bool]:
    """Identifier and whether it is extended, of the frame with this key; WireError if no such frame can exist."""
    identifier, kind, flags, dlc, length = KEY.unpack(key)
    if kind != FRAME:
        raise WireError(f"a record of kind {kind} where only frames may come")
    extended = bool(flags & EXTENDED)
    if identifier > (0x1FFFFFFF if extended else 0x7FF):
        raise WireError(f"identifier {identifier:#x} is too large for {'29' if extended else '11'} bits")
    lengths_ok = length in _FD_LENGTHS if flags & FD else length <= 8
    if not lengths_ok or dlc > (DATA if flags & FD else 8):
        raise WireError(f"{length} bytes (dlc {dlc}) are no length of a {'CAN FD' if flags & FD else 'CAN'} frame")
    if not flags & (FD | REMOTE | ERROR) and dlc != length:
        raise WireError(f"it has {length} bytes of data, and its length (dlc) says {dlc}")
    if flags & REMOTE and flags & FD:
        raise WireError("CAN FD has no remote frames; ask by a classic one")
    if flags & REMOTE and length:
        raise WireError(
            f"a remote frame has no data, and this one {length} bytes; its length (dlc) says what it asks for"
        )
    if flags & OWN:
        raise WireError(f"flags {flags:#x} contradict each other")
    return identifier, extended
