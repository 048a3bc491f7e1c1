"""Process data: how mappings are changed, and when PDOs are sent and taken (CiA 301, 7.5.2.35 to 38)."""

from __future__ import annotations

import struct

import pytest

from rds.bus.modules.cia402.codes import ENABLE_OPERATION, SHUTDOWN, Mode, State

from .conftest import NODE, Abort, Rig

INVALID = 1 << 31


def refused(rig: Rig, index: int, value: int, size: int, subindex: int) -> int:
    with pytest.raises(Abort) as abort:
        rig.write(index, value, size, subindex)
    return abort.value.code


def test_a_mapping_is_not_changed_while_the_pdo_exists(rig: Rig) -> None:
    assert refused(rig, 0x1600, 0, 1, 0) == 0x08000022
    assert refused(rig, 0x1600, 0x607A0020, 4, 2) == 0x08000022
    rig.write(0x1400, INVALID | 0x200 + NODE, 4, 1)
    assert refused(rig, 0x1600, 0x607A0020, 4, 2) == 0x08000022  # the number of entries is not 0
    rig.write(0x1600, 0, 1, 0)
    rig.write(0x1600, 0x607A0020, 4, 2)
    rig.write(0x1600, 2, 1, 0)
    rig.write(0x1400, 0x200 + NODE, 4, 1)


@pytest.mark.parametrize(
    "mapping, entry, code",
    [
        (0x1600, 0x12340020, 0x06020000),  # no object
        (0x1600, 0x607D0920, 0x06090011),  # no sub-index
        (0x1600, 0x60640020, 0x06040041),  # read only: not for an RPDO
        (0x1600, 0x607A0010, 0x06040041),  # not its length
        (0x1600, 0x60650020, 0x06040041),  # not to be mapped
        (0x1A00, 0x60400008, 0x06040041),
        (0x1A00, 0x00050008, 0x06020000),  # a dummy is for RPDOs only
    ],
)
def test_an_entry_is_checked(rig: Rig, mapping: int, entry: int, code: int) -> None:
    rig.write(mapping - 0x200, INVALID | 0x40000000 | 0x200 + NODE, 4, 1)
    rig.write(mapping, 0, 1, 0)
    assert refused(rig, mapping, entry, 4, 1) == code


def test_more_than_eight_bytes_are_refused(rig: Rig) -> None:
    rig.write(0x1400, INVALID | 0x200 + NODE, 4, 1)
    rig.write(0x1600, 0, 1, 0)
    for place in (1, 2, 3):
        rig.write(0x1600, 0x607A0020, 4, place)
    assert refused(rig, 0x1600, 3, 1, 0) == 0x06040042
    assert refused(rig, 0x1600, 9, 1, 0) == 0x06090031


@pytest.mark.parametrize("value", [0x101, 0x582, 0x602, 0x702, 0x001, 0x20000202])
def test_an_identifier_that_is_taken_is_refused(rig: Rig, value: int) -> None:
    rig.write(0x1400, INVALID | 0x200 + NODE, 4, 1)
    assert refused(rig, 0x1400, value, 4, 1) == 0x06090030


def test_an_identifier_is_not_changed_while_the_pdo_exists(rig: Rig) -> None:
    assert refused(rig, 0x1400, 0x333, 4, 1) == 0x08000022
    rig.write(0x1400, INVALID | 0x333, 4, 1)
    rig.write(0x1400, 0x333, 4, 1)
    assert 0x333 in rig.drive.listens_to and 0x200 + NODE not in rig.drive.listens_to


@pytest.mark.parametrize("kind", [241, 251, 252, 253])
def test_transmission_types_that_do_not_exist(rig: Rig, kind: int) -> None:
    assert refused(rig, 0x1800, kind, 1, 2) == 0x06090030


def test_dummies_fill_an_rpdo(rig: Rig) -> None:
    rig.write(0x1400, INVALID | 0x200 + NODE, 4, 1)
    rig.write(0x1600, 0, 1, 0)
    rig.write(0x1600, 0x00060010, 4, 1)
    rig.write(0x1600, 0x60400010, 4, 2)
    rig.write(0x1600, 2, 1, 0)
    rig.write(0x1400, 0x200 + NODE, 4, 1)
    rig.nmt(1)
    rig.send(0x200 + NODE, struct.pack("<HH", 0xFFFF, SHUTDOWN))
    assert rig.drive.state is State.READY


def test_an_rpdo_of_type_1_waits_for_sync_and_one_of_type_255_does_not(rig: Rig) -> None:
    rig.map(0x607A, transmission=1)
    rig.nmt(1)
    rig.send(0x200 + NODE, rig.pack(SHUTDOWN, 0))
    assert rig.drive.state is State.SWITCH_ON_DISABLED
    rig.send(0x80)
    assert rig.drive.state is State.READY
    rig.write(0x1400, 255, 1, 2)
    rig.send(0x200 + NODE, rig.pack(0x07, 0))
    assert rig.drive.state is State.SWITCHED_ON


def test_pdos_need_operational(rig: Rig) -> None:
    rig.map(0x607A, transmission=255)
    assert rig.send(0x80) == []
    rig.send(0x200 + NODE, rig.pack(SHUTDOWN, 0))
    assert rig.drive.state is State.SWITCH_ON_DISABLED


def test_a_tpdo_comes_with_every_nth_sync(rig: Rig) -> None:
    rig.map(0x607A)
    rig.write(0x1800, 3, 1, 2)
    rig.nmt(1)
    came = [bool(rig.send(0x80)) for _ in range(9)]
    assert came == [False, False, True] * 3


def test_type_0_comes_with_sync_after_a_change(rig: Rig) -> None:
    rig.map(0x607A)
    rig.write(0x1800, 0, 1, 2)
    rig.nmt(1)
    assert [len(rig.send(0x80)) for _ in range(3)] == [1, 0, 0]
    rig.write(0x6040, SHUTDOWN, 2)
    assert [len(rig.send(0x80)) for _ in range(2)] == [1, 0]


def test_an_event_driven_tpdo_comes_with_a_change_and_with_its_timer(rig: Rig) -> None:
    rig.nmt(1)
    mine = 0x180 + NODE
    rig.frames.clear()
    rig.wait(0.25)
    times = [t for t, identifier, _ in rig.frames if identifier == mine]
    assert len(times) == 2 and times[1] - times[0] == pytest.approx(0.1, abs=2e-3)
    rig.frames.clear()
    rig.write(0x6040, SHUTDOWN, 2)
    assert [struct.unpack("<H", data)[0] & 0x6F for _, identifier, data in rig.frames if identifier == mine] == [0x21]


def test_an_inhibit_time_holds_a_tpdo_back(rig: Rig) -> None:
    assert refused(rig, 0x1800, 500, 2, 3) == 0x08000022
    rig.write(0x1800, INVALID | 0x40000180 + NODE, 4, 1)
    rig.write(0x1800, 500, 2, 3)  # 50 ms
    rig.write(0x1800, 0, 2, 5)
    rig.write(0x1800, 0x40000180 + NODE, 4, 1)
    rig.nmt(1)
    rig.wait(0.06)
    rig.frames.clear()
    for word in (0x06, 0x07, 0x0F):
        rig.write(0x6040, word, 2)
        rig.wait(0.01)
    rig.wait(0.1)
    states = [struct.unpack("<H", d)[0] & 0x6F for _, identifier, d in rig.frames if identifier == 0x180 + NODE]
    assert states == [0x27]  # the two between were too soon after the one before


def test_an_rpdo_that_is_too_short_is_reported_once_and_changes_nothing(rig: Rig) -> None:
    rig.map(0x607A, transmission=255)
    rig.nmt(1)
    for _ in range(5):
        rig.send(0x200 + NODE, b"\x06\x00")
    assert rig.emergencies() == [0x8210]
    assert rig.drive.state is State.SWITCH_ON_DISABLED


def test_a_missing_rpdo_is_a_fault_when_its_timer_is_set(rig: Rig) -> None:
    rig.map(0x607A)
    rig.write(0x1400, 5, 2, 5)
    rig.write(0x1006, 1_000_000, 4)  # no other time-out
    rig.nmt(1)
    rig.enable(Mode.CYCLIC_POSITION)
    rig.cycle(0, ENABLE_OPERATION)
    rig.wait(0.02)
    assert rig.drive.state is State.FAULT and rig.emergencies() == [0x8250]


def test_a_sync_counter_must_come_when_it_is_wanted(rig: Rig) -> None:
    rig.map(0x607A)
    rig.write(0x1019, 10, 1)
    rig.nmt(1)
    assert rig.send(0x80, b"\x01")[0][0] == 0x180 + NODE
    rig.send(0x80)
    assert rig.emergencies() == [0x8240]
