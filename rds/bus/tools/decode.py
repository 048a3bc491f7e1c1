"""Frames in words: by the DBC files given, the cyclic messages by rds/bus/modules/rds/frames.py, others by our DBC."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import can

from rds.bus.modules.rds import frames
from rds.bus.modules.rds.frames import Kind, Status
from rds.core.errors import InputError, MachineError
from rds.core.extras import needed_for
from rds.core.limits import allow

OWN_DBC = "oacs.dbc"  # in rds/bus/modules/oacs
_LONGEST_REASON = 300  # characters
_LARGEST = 16 << 20  # bytes of a DBC file; a truck's has two million


class Decoded(NamedTuple):
    """A frame's name and its signals: numbers with their unit, words for codes."""

    name: str
    signals: dict[str, str]


Decoder = Callable[[can.Message], Decoded | None]


def decoder(files_: Sequence[Path] = ()) -> Decoder:
    """What decodes a frame: the DBC files in their order, then the cyclic messages, then the dialect's own DBC file.

    A file that is given says what is on this bus, be it a bus with no machine of ours on it.

    The dialect's own file is left out where cantools isn't installed. A frame that nothing knows is None; one that
    does not fit its description says so under its name. Raises InputError for a file that is no DBC, or if a file is
    given and cantools is missing.
    """
    given = [load_dbc(path) for path in files_]
    own = own_dbc()
    ours = [load_dbc(own)] if own is not None and find_spec("cantools") is not None else []

    def decode(message: can.Message) -> Decoded | None:
        if message.is_error_frame or message.is_remote_frame:
            return None
        found = _by_databases(given, message)
        if found is None and not message.is_extended_id:
            found = cyclic(message.arbitration_id, bytes(message.data))
        return found or _by_databases(ours, message)

    return decode


def cyclic(identifier: int, data: bytes) -> Decoded | None:
    """The cyclic messages between host and modules; None for others and for those of another length."""
    try:
        if identifier in (frames.COMMAND, frames.DRY_COMMAND):
            voltages = frames.decode_voltages(identifier, data)
            name = "command" if identifier == frames.COMMAND else "dry command"
            return Decoded(name, {f"slot {i}": f"{volts:+.3f} V" for i, volts in enumerate(voltages)})
        if identifier == frames.MORE_VOLTAGES:
            voltages = frames.decode_voltages(identifier, data)
            return Decoded("more voltages", {f"slot {i}": f"{volts:+.3f} V" for i, volts in enumerate(voltages, 4)})
        if identifier == frames.SETUP:
            return Decoded("set-up", {"period": f"{frames.decode_setup(identifier, data) * 1e3:g} ms"})
        if identifier == frames.CALL and not data:
            return Decoded("call", {})
        if identifier - frames.ANSWER in frames.NODES:
            answer = frames.decode_answer(identifier, data)
            status = Status(answer.status)
            return Decoded(
                f"{_name(Kind, answer.kind)} of module {identifier - frames.ANSWER}",
                {
                    "position": f"{answer.counts} counts",
                    "status": "none" if not status else (status.name or hex(status)).lower().replace("|", "+"),
                    "ticks": str(answer.ticks),
                },
            )
    except MachineError:
        return None
    return None


def _name(kinds: Any, value: int) -> str:
    try:
        return str(kinds(value).name).lower()
    except ValueError:
        return f"kind {value}"


def own_dbc() -> Path | None:
    """The file of the dialect's own messages, where it is installed."""
    try:
        path = Path(str(files("rds.bus.modules.oacs").joinpath(OWN_DBC)))
    except ModuleNotFoundError:
        return None
    return path if path.is_file() else None


def load_dbc(path: Path) -> Any:
    """cantools' database of a DBC file; InputError if it is none, or where cantools is missing."""
    with needed_for("reading a DBC file", where=str(path)):
        import cantools.database
    if not path.is_file():
        raise InputError("there is no such DBC file; check the name", str(path))
    size = path.stat().st_size
    allow(size, _LARGEST, f"it has {size} bytes", "give a part of it", path)
    try:
        return cantools.database.load_file(path, encoding=_encoding(path.read_bytes()), strict=False)
    # cantools raises errors of its parsers, of textparser and plain ones
    except Exception as error:
        reason = str(error).strip() or type(error).__name__
        if len(reason) > _LONGEST_REASON:  # it quotes the line
            reason = f"{reason[:_LONGEST_REASON]}..."
        remedy = "correct that place, or remove it"
        if "more than 11 bits" in reason:
            remedy = "where its frames are extended ones, add 2147483648 (2^31) to the number behind BO_"
        raise InputError(f"it can't be read as a DBC file: {reason}; {remedy}", str(path)) from error


def _encoding(data: bytes) -> str | None:
    """UTF-8, with or without its mark, where a file is in it; None: what cantools takes, for DBC code page 1252.

    `°` in UTF-8 would else be the unit `Â°`, which nobody knows.
    """
    try:
        data.decode()
    except UnicodeDecodeError:
        return None
    return "utf-8-sig"


def _by_databases(databases: Sequence[Any], message: can.Message) -> Decoded | None:
    return next((found for database in databases if (found := _by_database(database, message)) is not None), None)


def _by_database(database: Any, message: can.Message) -> Decoded | None:
    try:
        description = database.get_message_by_frame_id(message.arbitration_id, force_extended_id=message.is_extended_id)
    except KeyError:
        return None
    if bool(description.is_extended_frame) != message.is_extended_id:
        return None
    try:
        values = description.decode(bytes(message.data))
    # a short frame, an unknown multiplexer: whatever is wrong with it, the monitor goes on
    except Exception as error:
        return Decoded(description.name, {"does not fit": str(error).strip() or type(error).__name__})
    units = {signal.name: signal.unit for signal in description.signals}
    return Decoded(description.name, {name: _quantity(value, units.get(name)) for name, value in values.items()})


def _quantity(value: Any, unit: str | None) -> str:
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return f"{text} {unit}" if unit else text
