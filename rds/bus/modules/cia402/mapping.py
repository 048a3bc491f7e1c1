"""Process data of a drive: mapped by the host, or found where the drive's mapping is fixed. CiA 301, 7.5.2.35ff."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from struct import Struct

import canopen
from canopen.sdo import SdoAbortedError

from rds.bus.modules.cia402.settings import Command, DriveSettings
from rds.core.errors import MachineError

RPDOS, TPDOS = (0x200, 0x300, 0x400, 0x500), (0x180, 0x280, 0x380, 0x480)  # + node-ID: the predefined connection set
_CONTROLWORD, _STATUSWORD = 0x6040, 0x6041
_INVALID, _NO_REMOTE_REQUEST, _NUMBER = 1 << 31, 1 << 30, 0x7FF
_PDOS, _MAPPING = 0x200, 0x200  # PDOs each way at most; from the communication object of one to its mapping
_DUMMIES = range(1, 8)  # data types that stand in a mapping for bits of no object
_SIGNED = {16: "h", 32: "i"}
Entry = tuple[int, int, int]  # index, sub-index, bits


@dataclass(frozen=True)
class Layout:
    """Where words stand in the two PDOs of a drive: controlword and target, statusword and actual value."""

    receive: int  # identifier of the RPDO
    command: str  # struct format
    send: int  # identifier of the TPDO
    answer: str

    @property
    def command_size(self) -> int:
        """Bytes of the RPDO."""
        return Struct(self.command).size


def standard(drive: DriveSettings) -> Layout:
    """As map_dynamically() maps: the first PDO each way, and nothing else in it."""
    target = "h" if drive.command is Command.CST else "i"
    return Layout(RPDOS[0] + drive.node, f"<H{target}", TPDOS[0] + drive.node, "<Hi")


def actual_of(drive: DriveSettings) -> int:
    """The object that the host reads in every cycle: the actual velocity or position."""
    return 0x606C if drive.reads_velocity else 0x6064


def map_dynamically(node: canopen.RemoteNode, drive: DriveSettings, transmission: int) -> Layout:
    """RPDO 1: controlword and target. TPDO 1: statusword and actual position (or velocity). No other PDO.

    The bits are those of CiA 402, and the entries those that the drive takes, whatever its EDS says of them. Raises
    MachineError that names what it refuses.
    """
    layout = standard(drive)
    target_bits = 16 if drive.command is Command.CST else 32
    for communication, identifier, kind, objects in (
        (0x1400, layout.receive, transmission, ((_CONTROLWORD, 16), (drive.command.target, target_bits))),
        (0x1800, layout.send | _NO_REMOTE_REQUEST, 1, ((_STATUSWORD, 16), (actual_of(drive), 32))),
    ):
        for other in range(communication + 1, communication + _PDOS):
            if other in node.object_dictionary and not (taken := _number(node, other, 1)) & _INVALID:
                _write(node, drive, other, 1, taken | _INVALID, 4)
        mapping = communication + _MAPPING
        _write(node, drive, communication, 1, identifier | _INVALID, 4)
        _write(node, drive, communication, 2, kind, 1)
        _write(node, drive, mapping, 0, 0, 1)
        for place, (index, bits) in enumerate(objects, 1):
            _write(node, drive, mapping, place, index << 16 | bits, 4)
        _write(node, drive, mapping, 0, len(objects), 1)
        _write(node, drive, communication, 1, identifier, 4)
    return layout


def _write(node: canopen.RemoteNode, drive: DriveSettings, index: int, subindex: int, value: int, size: int) -> None:
    try:
        node.sdo.download(index, subindex, value.to_bytes(size, "little"))
    except SdoAbortedError as error:
        raise MachineError(f"{drive.name} refuses 0x{index:04X}:{subindex:02X} = {value:#x}: {error}") from error


def find_fixed(node: canopen.RemoteNode, drive: DriveSettings, transmission: int) -> Layout:
    """The PDOs of a drive whose mapping cannot be changed that have what the host needs; they are made synchronous.

    The RPDO must have the controlword, the target and nothing else; the TPDO the statusword before the actual value.
    Raises MachineError that says what is mapped, where none will do.
    """
    target, actual = drive.command.target, actual_of(drive)
    received = _first(node, 0x1600, lambda entries: _command_format(entries, target))
    sent = _first(node, 0x1A00, lambda entries: _answer_format(entries, actual))
    for what, found, first, of in (
        (f"the controlword and the target 0x{target:04X}, and nothing else", received, 0x1600, "RPDO"),
        (f"the statusword, and after it 0x{actual:04X}", sent, 0x1A00, "TPDO"),
    ):
        if found is None:
            there = "; ".join(f"{of} {number}: {text}" for number, text in _in_words(node, first)) or f"no {of}"
            raise MachineError(
                f"{drive.name} has a fixed mapping, and no {of} with {what} ({there}); choose another mode, or a drive "
                "whose mapping can be changed"
            )
    assert received is not None and sent is not None
    for number, kind, base in ((received[0], transmission, 0x1400), (sent[0], 1, 0x1800)):
        node.sdo.download(base + number, 2, bytes([kind]))
        identifier = _number(node, base + number, 1)
        if identifier & _INVALID:
            node.sdo.download(base + number, 1, (identifier & ~_INVALID).to_bytes(4, "little"))
    receive, send = (
        _number(node, base + number, 1) & _NUMBER for base, number in ((0x1400, received[0]), (0x1800, sent[0]))
    )
    return Layout(receive, received[1], send, sent[1])


def _first(node: canopen.RemoteNode, mapping: int, fits: Callable[[list[Entry]], str | None]) -> tuple[int, str] | None:
    for number, entries in _mapped(node, mapping):
        form = fits(entries)
        if form is not None:
            return number, form
    return None


def _mapped(node: canopen.RemoteNode, mapping: int) -> Iterator[tuple[int, list[Entry]]]:
    """The PDOs that there are, by number from 0, with what is mapped in them."""
    for number in range(4):
        try:
            count = _number(node, mapping + number, 0)
            words = [_number(node, mapping + number, place) for place in range(1, count + 1)]
        except SdoAbortedError:
            continue
        yield number, [(word >> 16, word >> 8 & 0xFF, word & 0xFF) for word in words]


def _command_format(entries: list[Entry], target: int) -> str | None:
    real = [(index, subindex) for index, subindex, _ in entries if index not in _DUMMIES]
    if real != [(_CONTROLWORD, 0), (target, 0)]:
        return None
    return _format(entries, (_CONTROLWORD, target))


def _answer_format(entries: list[Entry], actual: int) -> str | None:
    indices = [index for index, _, _ in entries]
    if _STATUSWORD not in indices or actual not in indices or indices.index(_STATUSWORD) > indices.index(actual):
        return None
    return _format(entries, (_STATUSWORD, actual))


def _format(entries: list[Entry], wanted: tuple[int, int]) -> str | None:
    """The struct format of a PDO in which all but the wanted objects are padding; None if one is no whole bytes."""
    parts = []
    for index, _, bits in entries:
        if bits % 8:
            return None
        if index == wanted[0] and bits == 16:
            parts.append("H")
        elif index == wanted[1] and bits in _SIGNED:
            parts.append(_SIGNED[bits])
        else:
            parts.append(f"{bits // 8}x")
    return "<" + "".join(parts)


def _in_words(node: canopen.RemoteNode, mapping: int) -> Iterator[tuple[int, str]]:
    for number, entries in _mapped(node, mapping):
        yield number + 1, ", ".join(f"0x{index:04X}:{subindex:02X}" for index, subindex, _ in entries) or "nothing"


def _number(node: canopen.RemoteNode, index: int, subindex: int) -> int:
    return int.from_bytes(node.sdo.upload(index, subindex), "little")
