"""Which CANopen devices are on a bus, and what they say of themselves."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import can
import canopen
from canopen.sdo import SdoAbortedError, SdoCommunicationError

from rds.bus.modules.cia402.codes import State, state_of
from rds.bus.modules.cia402.configure import library
from rds.bus.modules.cia402.identity import number, upload
from rds.bus.modules.cia402.presence import refuse_clashes
from rds.bus.tools.link import BUILTIN, bus_failed, bus_name, open_bus
from rds.bus.tools.listening import pause

_WAIT = 0.3  # s for the devices to answer
_ANSWERS_IN = 1.0  # s for one that was heard to answer a question: a busy computer's drive is no silent device
_DRIVE = 402


@dataclass(frozen=True)
class FoundDevice:
    """A CANopen device; what it doesn't say is None."""

    node: int
    profile: int | None  # low half of the device type 0x1000: 402 for a drive
    name: str | None  # 0x1008
    vendor: int | None  # 0x1018:01
    product: int | None  # 0x1018:02
    revision: int | None  # 0x1018:03
    state: State | None  # of a drive
    answers: bool = True  # to SDO requests; a host that sends heartbeats does not

    @property
    def is_drive(self) -> bool:
        """Whether it is a CiA 402 drive."""
        return self.profile == _DRIVE

    @property
    def kind(self) -> str:
        """What it is, in a word. A run's host, too, is heard by its heartbeats, and answers no request."""
        if not self.answers:
            return "host, or a silent device"
        return "drive" if self.is_drive else "device"

    @property
    def version(self) -> str | None:
        """The revision number's halves, major and minor (CiA 301, object 0x1018:03)."""
        return None if self.revision is None else f"{self.revision >> 16}.{self.revision & 0xFFFF}"


def scan(
    interface: str = BUILTIN, channel: str | None = None, timeout: float = _WAIT, **options: Any
) -> list[FoundDevice]:
    """The devices that answer an SDO request or are heard within `timeout` s, by node-ID; nothing is changed on them.

    `options` go to the python-can interface. Raises MachineError naming the devices that share a node-ID, and if
    the bus can't be opened or fails.
    """
    bus = open_bus(interface, channel, [0x580, 0x700], 0x780, node="scan", **options)
    try:
        with library(bus) as network, _quiet():
            network.scanner.search()
            pause(timeout)
            nodes = sorted(network.scanner.nodes)
            refuse_clashes(network, nodes)
            return [_ask(network, node) for node in nodes]
    except can.CanTimeoutError:  # with bit timing, nobody acknowledges where nobody is
        return []
    except (can.CanError, OSError) as error:
        raise bus_failed(bus_name(interface, channel), error) from error
    finally:
        bus.shutdown()


@contextmanager
def _quiet() -> Iterator[None]:
    """Without the library's own word on each request that nobody answers: here that is no error."""
    log = logging.getLogger("canopen.sdo.client")
    before, log.disabled = log.disabled, True
    try:
        yield
    finally:
        log.disabled = before


def _ask(network: canopen.Network, node_id: int) -> FoundDevice:
    node = network.add_node(node_id, canopen.ObjectDictionary())
    node.sdo.RESPONSE_TIMEOUT = _ANSWERS_IN
    try:
        kind = int.from_bytes(node.sdo.upload(0x1000, 0), "little")
    except SdoCommunicationError:  # every device has this object: nobody answers
        return FoundDevice(node_id, None, None, None, None, None, None, answers=False)
    except SdoAbortedError:
        kind = None
    status, name = number(node, 0x6041), upload(node, 0x1008)
    profile = None if kind is None else kind & 0xFFFF
    return FoundDevice(
        node=node_id,
        profile=profile,
        name=None if name is None else name.rstrip(b"\0").decode("ascii", "replace"),
        vendor=number(node, 0x1018, 1),
        product=number(node, 0x1018, 2),
        revision=number(node, 0x1018, 3),
        state=state_of(status) if status is not None and profile == _DRIVE else None,
    )
