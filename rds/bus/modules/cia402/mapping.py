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
_INVALID, _NUMBER = 1 << 31, 0x7FF
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
    """RPDO 1: controlword and target. TPDO 1: statusword and actual position (or velocity). No other PDO."""
    for maps in (node.rpdo, node.tpdo):
        for number, pdo in maps.items():
            identifier = pdo.com_record[1].raw
            if number > 1 and not identifier & _INVALID:
                pdo.com_record[1].raw = identifier | _INVALID
    received, sent = node.rpdo[1], node.tpdo[1]
    for pdo, objects, kind in (
        (received, (_CONTROLWORD, drive.command.target), transmission),
        (sent, (_STATUSWORD, actual_of(drive)), 1),
    ):
        pdo.clear()
        for index in objects:
            pdo.add_variable(index)
        pdo.cob_id, pdo.trans_type, pdo.enabled = pdo.predefined_cob_id, kind, True
        pdo.rtr_allowed = pdo is received  # the bit has no meaning there
        pdo.save()
    return standard(drive)


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
