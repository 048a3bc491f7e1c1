"""LSS (CiA 305) of a simulated drive, byte by byte: one of several is chosen by its address, and gets a node-ID."""

from __future__ import annotations

import pytest

from rds.bus.modules.cia402.lss import UNCONFIGURED, Slave

IDENTITY = (0x319, 0x402, 0x10000, 77)
GLOBAL, NODE_ID, STORE, SELECTED, INQUIRE_NODE = 0x04, 0x11, 0x17, 0x44, 0x5E


class Drive:
    """A slave, and the node-IDs that it has taken."""

    def __init__(self, node: int = UNCONFIGURED):
        self.taken: list[int] = []
        self.slave = Slave(lambda: IDENTITY, node, self.taken.append)

    def ask(self, command: int, value: int = 0) -> bytes | None:
        """What it answers."""
        return self.slave.receive(bytes([command]) + value.to_bytes(4, "little") + bytes(3))

    def select(self, *address: int) -> list[bytes | None]:
        """The four numbers of an address, 0x40 to 0x43; the answer to each."""
        return [self.ask(0x40 + part, number) for part, number in enumerate(address)]


@pytest.mark.parametrize("node", [UNCONFIGURED, 9])
def test_the_drive_with_the_address_alone_is_configured(node: int) -> None:
    drive = Drive(node)
    assert drive.select(*IDENTITY) == [None, None, None, bytes([SELECTED]) + bytes(7)]
    assert drive.ask(INQUIRE_NODE) == bytes([INQUIRE_NODE, node]) + bytes(6)
    assert drive.ask(NODE_ID, 5) == bytes([NODE_ID]) + bytes(7)
    assert drive.ask(STORE) == bytes([STORE]) + bytes(7)
    assert drive.ask(GLOBAL, 0) is None and drive.taken == [5]


@pytest.mark.parametrize("part", range(4))
def test_another_address_leaves_it_as_it_was(part: int) -> None:
    drive = Drive()
    other = list(IDENTITY)
    other[part] += 1
    assert drive.select(*other) == [None] * 4
    assert drive.ask(NODE_ID, 5) is None and not drive.slave.is_configuring


def test_an_address_in_another_order_is_none_and_the_vendor_begins_anew() -> None:
    drive = Drive()
    for part in (0, 2, 1, 3):
        assert drive.ask(0x40 + part, IDENTITY[part]) is None
    drive.select(*IDENTITY[:2])
    assert drive.select(*IDENTITY)[-1] is not None


def test_a_node_id_that_cannot_be_is_refused() -> None:
    drive = Drive()
    drive.select(*IDENTITY)
    assert drive.ask(NODE_ID, 128) == bytes([NODE_ID, 1]) + bytes(6)
    drive.ask(GLOBAL, 0)
    assert drive.taken == []


@pytest.mark.parametrize(
    "address, answers",
    [
        ((0x319, 0x402, 0, 0xFFFFFFFF, 0, 0xFFFFFFFF), True),
        ((0x319, 0x402, 0x10000, 0x10000, 77, 77), True),
        ((0x318, 0x402, 0, 0xFFFFFFFF, 0, 0xFFFFFFFF), False),
        ((0x319, 0x403, 0, 0xFFFFFFFF, 0, 0xFFFFFFFF), False),
        ((0x319, 0x402, 0x10001, 0xFFFFFFFF, 0, 0xFFFFFFFF), False),
        ((0x319, 0x402, 0, 0xFFFF, 0, 0xFFFFFFFF), False),
        ((0x319, 0x402, 0, 0xFFFFFFFF, 78, 0xFFFFFFFF), False),
        ((0x319, 0x402, 0, 0xFFFFFFFF, 0, 76), False),
    ],
)
@pytest.mark.parametrize("node", [UNCONFIGURED, 9])
def test_a_range_of_addresses_finds_the_drives_in_it(node: int, address: tuple[int, ...], answers: bool) -> None:
    drive = Drive(node)
    heard = [drive.ask(0x46 + part, number) for part, number in enumerate(address)]
    assert heard == [None] * 5 + [bytes([0x4F]) + bytes(7) if answers else None]
    assert not drive.slave.is_configuring


def test_those_without_a_node_id_say_so() -> None:
    assert Drive().ask(0x4C) == bytes([0x50]) + bytes(7)
    assert Drive(9).ask(0x4C) is None
