"""What strangers may send to a bus: every frame there is, given to real modules of every dialect in every state.

No frame that may pass changes anything of a module or makes it speak; and every frame that does is in its dialect's
table. Modules are in bus time, with a bus that is none: nothing here waits.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any

import can
import pytest

from rds.bus.modules import dialects
from rds.bus.modules.bus_node import BusNode
from rds.bus.modules.cia402 import codes
from rds.bus.modules.cia402.drive import Drive
from rds.bus.modules.cia402.host import Cia402Drivers
from rds.bus.modules.cia402.node import DriveNode
from rds.bus.modules.oacs import codes as words
from rds.bus.modules.oacs import messages
from rds.bus.modules.oacs.module import OacsModule
from rds.bus.modules.oacs.module_data import read_modules
from rds.bus.modules.oacs.node import OacsNode
from rds.bus.modules.rds import frames
from rds.bus.modules.rds.drivers import AxisDrivers
from rds.bus.modules.rds.module import AxisModule
from rds.bus.modules.rds.module_node import ModuleNode
from rds.bus.tools.live_machine import acts_on_machine, harmless_identifiers, live_modules
from rds.machines import load_machine

STANDARD = range(0x800)
NOW = 100.0  # s, bus time
NODE = 2  # of each module here
CNC, MRMT = load_machine("mini-cnc"), load_machine("mrmt-oacs")
_DATA = read_modules(MRMT)

# whatever a module of one of the dialects might take for a command, and every length
PAYLOADS = [
    *(bytes(length) for length in range(9)),
    b"\x08",  # the emergency stop is reset, of the cyclic frames; as the first of eight, it is made
    b"\x08" + bytes(7),
    b"\x09",
    b"\x01" + bytes(7),
    *(bytes((command, node)) for command in (1, 2, 0x80, 0x81, 0x82) for node in (0, NODE)),  # NMT
    b"\xff" * 8,
    b"\x00\x20" * 4,  # voltages, without a number
    b"\xe8\x03\0\0\0\0\0\0",  # a sample period
    b"\x2b\x40\x60\x00\x06\x00\x00\x00",  # SDO: controlword
    b"\x23\x16\x10\x01\x00\x00\x00\x00",  # SDO: nobody's heartbeat is awaited
    b"\x0f\x00\x10\x00\x00\x00",  # RPDO: controlword and target
    b"\x80\x00\x10\x00",
    messages.encode("Command", NODE, Code=words.Code.MOVE, Move=words.Move.HOME).data,
    messages.encode("Command", NODE, Code=words.Code.EMERGENCY).data,
    b"\x05",  # a heartbeat
]


class StillTime:
    """Bus time that is always now."""

    def at(self, stamp: float) -> float:
        return NOW

    def now(self) -> float:
        return NOW


@pytest.fixture(autouse=True)
def still(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rds.bus.modules.bus_node.BusTime", StillTime)


class NoBus:
    """Takes what is sent; gives the frames in `waiting`."""

    channel_info = "no bus"

    def __init__(self) -> None:
        self.sent: list[can.Message] = []
        self.waiting: list[can.Message] = []

    def send(self, message: can.Message, timeout: float | None = None) -> None:
        self.sent.append(message)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        return self.waiting.pop(0) if self.waiting else None

    def set_filters(self, filters: Any) -> None:
        """It has none."""


def opener(_: Iterable[int]) -> Any:
    return NoBus()


def feed(node: BusNode, identifier: int, data: bytes) -> None:
    node.receive(can.Message(arbitration_id=identifier, data=data, is_extended_id=False), NOW)


def rds_module(state: str) -> BusNode:
    node = ModuleNode("X", lambda _: AxisModule(CNC.axis("X"), 0, 0.001, NOW), opener)
    if state == "commanded":
        feed(node, frames.COMMAND, frames.encode_voltages([5.0]))
        assert node.module.motion is not None and node.module.expires is not None
    if state == "stopped":
        feed(node, frames.GENERAL, frames.EMERGENCY)
        assert node.module.emergency
    return node


def oacs_module(state: str) -> BusNode:
    axis = MRMT.axis("Z")
    node = OacsNode("Z", lambda _: OacsModule(axis, _DATA["Z"], 1, MRMT.sample_period, NOW, 77), opener)
    assert node.module.node == NODE
    if state == "commanded":
        jog = messages.encode("Command", NODE, Code=words.Code.MOVE, Move=words.Move.HOME)
        feed(node, jog.identifier, jog.data)
        assert node.module.mover.motion is not None
    if state == "stopped":
        feed(node, words.GENERAL, messages.encode("GeneralCall", Code=words.Code.EMERGENCY).data)
        assert node.module.plant.emergency
    return node


def drive(state: str) -> BusNode:
    node = DriveNode("X", lambda _, __: Drive(CNC.axis("X"), NOW, 10.0, NODE), opener)
    if state == "commanded":
        feed(node, 0x600 + NODE, b"\x23\x16\x10\x01\xe8\x03\x7f\x00")  # it waits for the host's heartbeat
        feed(node, 0x600 + NODE, b"\x2f\x60\x60\x00\x03\0\0\0")  # profile velocity
        feed(node, 0x600 + NODE, b"\x23\xff\x60\x00\xe8\x03\0\0")
        feed(node, 0x000, bytes((1, NODE)))
        for word in (codes.SHUTDOWN, codes.SWITCH_ON, codes.ENABLE_OPERATION):
            feed(node, 0x600 + NODE, b"\x2b\x40\x60\x00" + word.to_bytes(4, "little"))
        assert node.drive.state is codes.State.OPERATION_ENABLED
    if state == "stopped":
        feed(node, 0x000, bytes((2, NODE)))
        assert node.drive.nmt is codes.Nmt.STOPPED
    return node


MAKERS = {"rds": rds_module, "oacs": oacs_module, "cia402": drive}
EVERY_MODULE = pytest.mark.parametrize(
    "dialect, state", [(dialect, state) for dialect in MAKERS for state in ("at rest", "commanded", "stopped")]
)


def content(thing: Any, seen: set[int] | None = None) -> Any:
    """All that an object consists of, as plain values that can be compared."""
    seen = set() if seen is None else seen
    if isinstance(thing, (int, float, str, bytes, type(None))):
        return thing
    if isinstance(thing, bytearray):
        return bytes(thing)
    if callable(thing) or id(thing) in seen or isinstance(thing, (NoBus, StillTime)):
        return type(thing).__name__
    seen.add(id(thing))
    if isinstance(thing, dict):
        return {repr(key): content(value, seen) for key, value in thing.items()}
    if isinstance(thing, (list, tuple, deque)):
        return [content(value, seen) for value in thing]
    if isinstance(thing, (set, frozenset)):
        return sorted(map(repr, thing))
    slots = [name for kind in type(thing).__mro__ for name in getattr(kind, "__slots__", ())]
    named = {name: getattr(thing, name) for name in slots if hasattr(thing, name)} | getattr(thing, "__dict__", {})
    return {name: content(value, seen) for name, value in named.items()}


def settled(node: BusNode) -> Any:
    """All that the node consists of, when all that is due now has been done."""
    for _ in range(3):
        node.expire(NOW)
    return content(node)


def all_of(kind: str, identifiers: Iterable[int]) -> Iterator[can.Message]:
    flags: dict[str, Any] = {
        "data": {"is_extended_id": False},
        "extended": {"is_extended_id": True},
        "remote": {"is_extended_id": False, "is_remote_frame": True},
        "FD": {"is_extended_id": False, "is_fd": True},
    }[kind]
    for identifier in identifiers:
        for data in [b""] if kind == "remote" else PAYLOADS:
            yield can.Message(arbitration_id=identifier, data=data, **flags)


def heeded(make: Callable[[], BusNode], identifiers: tuple[int, ...], kind: str) -> set[int]:
    """Those identifiers whose frames change anything of the node, or make it speak."""
    node = make()
    before = settled(node)
    spoken = sum(len(list(node.receive(message, NOW))) for message in all_of(kind, identifiers))
    if not spoken and settled(node) == before:
        return set()
    if len(identifiers) == 1:
        return set(identifiers)
    half = len(identifiers) // 2
    return heeded(make, identifiers[:half], kind) | heeded(make, identifiers[half:], kind)


@EVERY_MODULE
def test_what_may_pass_does_nothing(dialect: str, state: str) -> None:
    frames_that_pass = tuple(i for i in STANDARD if all(acts_on_machine(m) is None for m in all_of("data", (i,))))
    assert frames_that_pass == tuple(harmless_identifiers()) and len(frames_that_pass) > 100
    assert not heeded(partial(MAKERS[dialect], state), frames_that_pass, "data")


@EVERY_MODULE
def test_what_a_module_heeds_is_in_its_dialects_table(dialect: str, state: str) -> None:
    table = {i for first, last, _ in dialects.identifiers(dialect) for i in range(first, last + 1)}
    if dialect == "oacs":  # these modules answer the cyclic frames as well
        table |= {i for first, last, _ in dialects.identifiers("rds") for i in range(first, last + 1)}
    make = partial(MAKERS[dialect], state)
    listens_to = set(make().identifiers)
    assert listens_to <= table
    assert not heeded(make, tuple(sorted(set(STANDARD) - table)), "data")
    assert any(heeded(make, (identifier,), "data") for identifier in listens_to), "the frames are those that act"


def test_the_frame_that_reset_the_emergency_stop_may_not_pass() -> None:
    node = rds_module("stopped")
    reset = can.Message(arbitration_id=frames.CALL, data=frames.RESET, is_extended_id=False)
    node.receive(reset, NOW)
    assert not node.module.emergency  # type: ignore[attr-defined]
    assert "resets their emergency stop" in str(acts_on_machine(reset))


@pytest.mark.parametrize("kind", ["extended", "remote", "FD"])
def test_extended_remote_and_fd_frames_may_never_pass(kind: str) -> None:
    high = (0x1C000000, 0x1C000001, 0x1E200000 + 77, 0x1FFFFFFF) if kind == "extended" else ()
    assert all(acts_on_machine(message) for message in all_of(kind, (*STANDARD, *high)))
    assert acts_on_machine(can.Message(is_error_frame=True))


@EVERY_MODULE
@pytest.mark.parametrize("kind", ["extended", "remote"])
def test_no_module_heeds_extended_or_remote_frames(dialect: str, state: str, kind: str) -> None:
    assert not heeded(partial(MAKERS[dialect], state), tuple(STANDARD), kind)


@EVERY_MODULE
def test_no_module_heeds_an_error_frame(dialect: str, state: str) -> None:
    node = MAKERS[dialect](state)
    bus: Any = node.bus
    before = settled(node)
    bus.sent.clear()
    bus.waiting = [
        can.Message(arbitration_id=i, data=PAYLOADS[-1], is_error_frame=True, timestamp=NOW) for i in (0, 1, 0x10, 0x13)
    ]
    for _ in range(4):
        node.step()
    assert not bus.waiting and not bus.sent
    assert settled(node) == before


def test_a_drive_can_be_given_no_identifier_that_may_pass() -> None:
    node = drive("at rest")
    for identifier in harmless_identifiers():
        for index, subindex in ((0x1400, 1), (0x1800, 1), (0x1005, 0), (0x1014, 0)):
            request = b"\x23" + index.to_bytes(2, "little") + bytes((subindex,)) + identifier.to_bytes(4, "little")
            answers = list(
                node.receive(can.Message(arbitration_id=0x600 + NODE, data=request, is_extended_id=False), NOW)
            )
            assert [data[0] for _, data, _ in answers] == [0x80], (hex(identifier), hex(index))


def test_hosts_take_nothing_for_an_answer_that_may_pass() -> None:
    bus: Any = NoBus()
    ours, drives = AxisDrivers(CNC, bus=bus), Cia402Drivers(CNC, bus=bus)
    assert not set(ours._listens_to) & set(harmless_identifiers())
    assert not (set(drives._handlers) | drives._hosts) & set(harmless_identifiers())
    assert not [i for i in harmless_identifiers() if messages.kind_of(i)]


def test_every_dialect_has_a_table_and_a_module_here() -> None:
    assert set(MAKERS) == set(dialects.dialect_names()) - set(dialects.SERIAL_DIALECTS)
    for dialect in MAKERS:
        assert all(0 <= first <= last < 0x800 and what for first, last, what in dialects.identifiers(dialect))


class Wire(NoBus):
    """A bus with one node on it."""

    def __init__(self, node: BusNode) -> None:
        super().__init__()
        self.node = node

    def send(self, message: can.Message, timeout: float | None = None) -> None:
        for identifier, data, extended in self.node.receive(message, NOW):
            self.waiting.append(can.Message(arbitration_id=identifier, data=data, is_extended_id=extended))


@pytest.mark.parametrize("dialect, who", [("rds", "module 2"), ("oacs", "module 2"), ("cia402", "drive 2")])
def test_whoever_is_on_a_bus_is_found_and_nothing_happens_to_it(dialect: str, who: str) -> None:
    node = MAKERS[dialect]("at rest")  # a drive that sends no heartbeat yet
    before = settled(node)
    wire: Any = Wire(node)
    assert live_modules(wire, 0.05) == [who]
    if dialect == "rds":  # the others remember when they were asked something last, and what
        assert settled(node) == before
