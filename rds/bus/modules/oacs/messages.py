"""Messages of the oacs dialect to frames and back, by the DBC file; checked, with errors that name the place.

The DBC is read on first use, or by `load()`: cantools takes about half a second to import, which a program that only
exchanges cyclic frames (rds/bus/modules/rds/frames.py) never spends. After that a message costs some 20 µs.

A message that each module has under an identifier of its own (`Command`, `Status`...) is one kind here, with the
module's number beside it. The DBC spells it out for the four modules of the thesis; the others, up to number 15,
speak the same bytes.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from math import isfinite
from typing import TYPE_CHECKING, Any, NamedTuple

from rds.bus.modules.oacs import codes as words
from rds.core.errors import InputError, MachineError

if TYPE_CHECKING:
    from cantools.database.can import Database, Message, Signal

PER_NODE = {
    "Command": words.COMMAND,
    "Flow": words.FLOW,
    "Download": words.DOWNLOAD,
    "Parameter": words.PARAMETER,
    "Status": words.STATUS,
    "Acceleration": words.ACCELERATION,
    "Current": words.CURRENT,
}
TO_ALL = {"Reply": words.HOST, "GeneralCall": words.GENERAL}
FROM_HOST = {
    "GeneralCall": "calls or stops all modules (oacs)",
    "Command": "commands a module (oacs)",
    "Flow": "takes part in a module's data download (oacs)",
}
# Standard identifiers of this dialect, first and last, and what a frame with one does to a machine.
IDENTIFIERS = (
    *((i, i, FROM_HOST.get(kind, "speaks for a module (oacs)")) for kind, i in TO_ALL.items()),
    *(
        (base + words.NODES[0], base + words.NODES[-1], FROM_HOST.get(kind, "speaks for a module (oacs)"))
        for kind, base in PER_NODE.items()
    ),
)
TEMPLATE = "X"  # the module whose messages in the DBC stand for those of all


class Frame(NamedTuple):
    """What goes on the bus."""

    identifier: int
    data: bytes
    extended: bool = False


class Decoded(NamedTuple):
    """A message: its kind, the module it is from or for (0: all), and its fields in their units."""

    kind: str
    node: int
    fields: dict[str, Any]


@cache
def load() -> Database:
    """The DBC file, read once."""
    from cantools.database.can import Database

    database = Database()
    database.add_dbc_string(files("rds.bus.modules.oacs").joinpath("oacs.dbc").read_text(encoding="utf-8"))
    return database


def encode(kind: str, node: int = 0, **fields: Any) -> Frame:
    """The frame of a message of this `kind`; `node` where each module has its own. Fields left out are 0.

    Raises InputError naming the field that is unknown, missing, or outside its range.
    """
    message = _message(kind)
    signals = _present(message, fields)
    for name in fields:
        if name not in signals:
            raise InputError(f"message {kind} has no field {name!r} here; it has {', '.join(signals)}")
    values = {name: fields.get(name, 0) for name in signals}
    for name, value in values.items():
        _check_value(kind, signals[name], value)
    data = message.encode(values, scaling=True, padding=False, strict=False)
    if kind == "Identity":
        return Frame(words.identity_identifier(values["BoardID"], values["Serial"]), data, True)
    return Frame(PER_NODE[kind] + words.check_node(node) if kind in PER_NODE else TO_ALL[kind], data)


def kind_of(identifier: int, extended: bool = False) -> tuple[str, int] | None:
    """Kind of message and module's number (0: all) of a frame with this identifier; None if it is not of the dialect.

    The cyclic frames are not: rds/bus/modules/rds/frames.py has them.
    """
    if extended:
        node, base = identifier >> 20 & 0xF, identifier & ~0xFFFFFF
        return ("Identity", node) if base == words.IDENTITY and node in words.NODES else None
    if identifier in (words.HOST, words.GENERAL):
        return "GeneralCall" if identifier else "Reply", 0
    return _by_identifier().get(identifier)


@cache
def _by_identifier() -> dict[int, tuple[str, int]]:
    return {base + node: (kind, node) for kind, base in PER_NODE.items() for node in words.NODES}


def decode(identifier: int, data: bytes | bytearray, extended: bool = False) -> Decoded:
    """The message in a frame. Fields hold numbers in the units of the DBC, codes as int.

    Raises MachineError naming the identifier, the bytes and the field, for a frame that is not of the dialect, has
    another length, or holds a code or a number that cannot be.
    """
    known = kind_of(identifier, extended)
    if known is None:
        raise _wrong(identifier, data, "is no message of the oacs dialect")
    kind, node = known
    message = _message(kind)
    if len(data) != message.length:
        raise _wrong(identifier, data, f"has {len(data)} bytes; {kind} has {message.length}")
    if message.is_multiplexed() and data[0] not in _codes_of(message):
        raise _wrong(identifier, data, f"field Code = {data[0]} is unknown in {kind}; known: {_codes_of(message)}")
    fields: dict[str, Any] = dict(message.decode(bytes(data), decode_choices=False))  # type: ignore[arg-type]
    for name, signal in _signals(kind).items():
        if name in fields:
            problem = _problem(signal, fields[name])
            if problem:
                raise _wrong(identifier, data, f"field {name} of {kind} {problem}")
    if kind == "Identity" and identifier != words.identity_identifier(fields["BoardID"], fields["Serial"]):
        raise _wrong(identifier, data, "fields BoardID and Serial of Identity are not those of its identifier")
    return Decoded(kind, node, fields)


def text(fields: dict[str, Any], name: str, length: int) -> str:
    """The text whose letters are the fields `name`1 to `name``length`; unprintable ones become '?'."""
    letters = (chr(fields[f"{name}{i}"]) for i in range(1, length + 1) if fields[f"{name}{i}"])
    return "".join(letter if letter.isascii() and letter.isprintable() else "?" for letter in letters)


def letters(name: str, value: str, length: int) -> dict[str, int]:
    """Fields for the first `length` letters of `value`, the reverse of `text`."""
    coded = value.encode("ascii", "replace")[:length].ljust(length, b"\0")
    return {f"{name}{i}": letter for i, letter in enumerate(coded, 1)}


@cache
def _message(kind: str) -> Message:
    if kind in PER_NODE:
        return load().get_message_by_name(f"{kind}_{TEMPLATE}")
    if kind in TO_ALL or kind == "Identity":
        return load().get_message_by_name(kind)
    raise InputError(f"there is no message {kind!r}; there are {', '.join([*PER_NODE, *TO_ALL, 'Identity'])}")


@cache
def _signals(kind: str) -> dict[str, Signal]:
    return {signal.name: signal for signal in _message(kind).signals}


def _present(message: Message, fields: dict[str, Any]) -> dict[str, Signal]:
    """The signals that a message with this Code has."""
    code = fields.get("Code")
    if message.is_multiplexed() and code not in _codes_of(message):
        raise InputError(f"message {message.name} needs Code, one of {_codes_of(message)}, instead of {code!r}")
    return {s.name: s for s in message.signals if s.multiplexer_ids is None or code in s.multiplexer_ids}


def _codes_of(message: Message) -> list[int]:
    """Values of Code, which say what other fields are there."""
    return [int(code) for code in message.get_signal_by_name("Code").choices or ()]


def _check_value(kind: str, signal: Signal, value: Any) -> None:
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise InputError(f"field {signal.name} of {kind} = {value!r} must be a number")
    problem = _problem(signal, value)
    if problem:
        raise InputError(f"field {signal.name} of {kind} {problem}")


def _problem(signal: Signal, value: float) -> str:
    """What is wrong with a field's value; "" if nothing."""
    if not isfinite(value):
        return f"= {value!r} is not a finite number"
    if signal.choices and value not in signal.choices:
        return f"= {value!r} is unknown; known: {', '.join(f'{k} {v}' for k, v in signal.choices.items())}"
    low, high = signal.minimum, signal.maximum
    if low is not None and high is not None and not low <= value <= high:
        return f"= {value!r} is outside {low} to {high} {signal.unit or ''}".rstrip()
    return ""


def _wrong(identifier: int, data: bytes | bytearray, what: str) -> MachineError:
    return MachineError(f"frame {identifier:#05x} [{bytes(data).hex(' ') or 'no bytes'}] {what}")
