"""The words of socketcand's protocol in RAW mode: text to frames and back, no I/O.

Everything is ASCII between '<' and '>', words separated by blanks. Source: doc/protocol.md and state_raw.c of
github.com/linux-can/socketcand, whose data bytes stand without blanks in what it says and with blanks in what it hears.
"""

from __future__ import annotations

import re

import can

from rds.core.errors import InputError

LONGEST = 256  # characters of one element; a send of eight bytes has 50
_INSIDE = rb"[ \t\x21-\x3b=\x3f-\x7e]{0,%d}" % (LONGEST - 2)  # what may stand between '<' and '>'
_ELEMENT = re.compile(rb"[ \t\r\n]*<(" + _INSIDE + rb")>")
_BEGUN = re.compile(rb"[ \t\r\n]*(<" + _INSIDE + rb")?")
_HTTP = re.compile(rb"(GET|HEAD|POST|PUT|DELETE|CONNECT|OPTIONS|TRACE|PATCH|PRI) ")
_BYTE = re.compile(r"[0-9A-Fa-f]{1,2}")
_IDENTIFIER = re.compile(r"[0-9A-Fa-f]{1,8}")


def split(received: bytes) -> tuple[list[list[str]], bytes, str]:
    """The complete elements in `received` as lists of words, the beginning of the next one, and what is wrong.

    Elements end at the first byte that is not the protocol's: one outside '<' and '>' other than blanks and ends of
    lines, one that is not printable ASCII, and one that makes an element longer than `LONGEST`. The last answer says
    which, and is "" where all is well; whoever sends such a byte speaks another protocol and can't be understood.
    """
    elements = []
    end = 0
    while match := _ELEMENT.match(received, end):
        end = match.end()
        elements.append(match[1].decode("ascii").split())
    begun = _BEGUN.match(received, end)
    assert begun is not None  # it matches nothing, too
    if begun.end() == len(received):
        return elements, begun[1] or b"", ""
    if _HTTP.match(received, end):
        return elements, b"", "this is a web page's request (HTTP), not socketcand's protocol"
    if len(begun[1] or b"") == LONGEST - 1:
        return elements, b"", f"an element has more than {LONGEST} characters"
    stray = received[begun.end() : begun.end() + 1]
    return elements, b"", f"byte {stray!r} does not belong to socketcand's protocol"


def to_text(message: can.Message) -> bytes | None:
    """What a client in RAW mode is told of a frame; None for a CAN FD frame, for which there are no words."""
    seconds = f"{message.timestamp:.6f}"
    identifier = f"{message.arbitration_id:08X}" if message.is_extended_id else f"{message.arbitration_id:03X}"
    if message.is_error_frame:
        return f"< error {message.arbitration_id:03X} {seconds} >".encode()
    if message.is_fd:
        return None
    if message.is_remote_frame:
        return f"< rtr {identifier} {seconds} {min(message.dlc, 8)} >".encode()
    return f"< frame {identifier} {seconds} {message.data.hex().upper()} >".encode()


def to_frame(words: list[str]) -> can.Message:
    """The frame that the words of `send` or `sendrtr` ask for; an identifier of eight digits is an extended one.

    Raises InputError saying what is wrong with them.
    """
    verb, *rest = words
    if len(rest) < 2 or not _IDENTIFIER.fullmatch(rest[0]) or not rest[1].isascii() or not rest[1].isdigit():
        raise InputError(f"{verb!r} takes an identifier in hexadecimal and a length, not {' '.join(rest)[:60]!r}")
    identifier, extended, length = int(rest[0], 16), len(rest[0]) == 8, int(rest[1])
    if identifier > (0x1FFFFFFF if extended else 0x7FF):
        raise InputError(f"identifier {rest[0]} is too large; write an extended one with eight digits")
    if length > 8:
        raise InputError(f"length {length} is more than 8; socketcand's protocol has no CAN FD frames")
    remote = verb == "sendrtr"
    data = rest[2:]
    if len(data) != (0 if remote else length):
        hint = "; a remote frame is asked for by sendrtr" if not data else ""
        raise InputError(f"{len(data)} bytes of data where the length says {0 if remote else length}{hint}")
    if not all(_BYTE.fullmatch(byte) for byte in data):
        raise InputError(f"data must be bytes in hexadecimal, as in '1 F1', not {' '.join(data)[:60]!r}")
    values = bytes(int(byte, 16) for byte in data)
    return can.Message(
        arbitration_id=identifier, is_extended_id=extended, is_remote_frame=remote, dlc=length, data=values
    )
