"""Getting drives ready before the cycle starts: found, reset, mapped, homed, through the `canopen` library.

Nothing here relies on an object that CiA 301 and CiA 402 don't define; what they leave optional is written where the
drive's EDS has it, and a refusal of an optional object is reported in the log and lived with.
"""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import ceil, inf

import can
import canopen
from canopen.sdo import SdoAbortedError, SdoCommunicationError

from rds.bus.modules.cia402 import codes
from rds.bus.modules.cia402.codes import Mode, NmtCommand, State, error_text, state_of, status_text
from rds.bus.modules.cia402.eds_file import read_eds
from rds.bus.modules.cia402.mapping import Layout, find_fixed, map_dynamically
from rds.bus.modules.cia402.presence import refuse_clashes
from rds.bus.modules.cia402.settings import Command, DriveSettings, Settings
from rds.bus.tools.link import bus_failed
from rds.bus.tools.listening import pause
from rds.core.contracts import Limits, Watch, unwatched
from rds.core.errors import InputError, MachineError

LOG = logging.getLogger(__name__)

_SEND = 0.5  # s for a frame to be taken
_LOOK = 0.02  # s between two looks at whether the library's receiving thread shall end
_SEARCH = 0.5  # s for a drive to answer
_STEP = 0.002  # s between two looks whether it has
_ANSWERS_IN = 1.0  # s for one that was found to answer a request; computers stall for less
_SECOND_ANSWER = 0.03  # s more for one that has the same node-ID
_CHANGE = 2.0  # s for a drive to change its state or mode
_LOST_AFTER = 3  # heartbeats that may be missing
_PROFILE = 402
_HALF = 1 << 31
_DEVICE_TYPE = b"\x00\x10\x00"  # object 0x1000:00 in an SDO frame


class _Network(canopen.Network):
    """The library on a bus where a frame that nobody takes is an error after a while, not a wait for ever."""

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        assert self.bus is not None
        with self.send_lock:
            self.bus.send(
                can.Message(arbitration_id=can_id, is_extended_id=False, data=data, is_remote_frame=remote), _SEND
            )
        self.check()


@contextmanager
def library(bus: can.BusABC) -> Iterator[canopen.Network]:
    """The library on an open bus, with its receiving thread, until the block ends."""
    network = _Network(bus)
    network.notifier = can.Notifier(bus, network.listeners, _LOOK)
    try:
        yield network
    finally:
        network.notifier.stop()


def prepare(
    network: canopen.Network, settings: Settings, period: float, watch: Watch = unwatched
) -> tuple[list[Limits], list[Layout]]:
    """Bring all drives to OPERATIONAL (NMT) and SWITCH ON DISABLED, mapped, in their mode, homed where asked for.

    Returns the software limits of each, and where its words stand in its PDOs. While a drive is homed it waits for the
    host's heartbeats, as it does under command: should the host die, it ends the homing. `watch` is called all the
    while; what it raises ends the homing.

    Raises MachineError naming node and object, and what the drive said; InputError for an EDS that can't be read.
    """
    search(network, settings.drives)
    nodes = [load(network, drive) for drive in settings.drives]
    layouts: list[Layout] = []
    for drive, node in zip(settings.drives, nodes, strict=True):
        with _naming(drive):
            node.nmt.state = "PRE-OPERATIONAL"
            _communication(node, drive, settings, period)
            layouts.append((find_fixed if drive.fixed_mapping else map_dynamically)(node, drive, settings.transmission))
            _reset_fault(node, drive)
            if drive.command is Command.PP:
                _profile(node, drive)
            for index, subindex, value in drive.write:
                _download(node, index, subindex, value)
            node.nmt.state = "OPERATIONAL"
    homed = [pair for pair in zip(settings.drives, nodes, strict=True) if pair[0].homing is not None]
    if homed:
        alive = network.send_periodic(0x700 + settings.host, bytes([codes.Nmt.OPERATIONAL]), settings.heartbeat)
        try:
            for drive, node in homed:
                with _naming(drive), _stops_told(network, drive):
                    _watch_host(node, drive, settings)
                    home(node, drive, settings.homing_timeout, watch)
                    _optional(node, drive, 0x1016, 1, 0)
        finally:
            alive.stop()
    limits = []
    for drive, node in zip(settings.drives, nodes, strict=True):
        with _naming(drive):
            _choose(node, drive, drive.command.mode)
            _still_target(node, drive)
            _watch_host(node, drive, settings)
            limits.append(_software_limits(node, drive))
    return limits, layouts


def search(network: canopen.Network, drives: Sequence[DriveSettings]) -> None:
    """Check that exactly one CiA 402 device answers for each drive. Raises MachineError."""
    answers: dict[int, list[bytes]] = {drive.node: [] for drive in drives}

    def note(identifier: int, data: bytearray, _: float) -> None:
        if bytes(data[1:4]) == _DEVICE_TYPE:  # and not a late answer to somebody before us
            answers[identifier - 0x580].append(bytes(data))

    for drive in drives:
        network.subscribe(0x580 + drive.node, note)
    with contextlib.suppress(can.CanTimeoutError):  # with bit timing, nobody acknowledges where nobody is
        for drive in drives:  # one that was stopped, as by an emergency stop, answers to nothing else
            network.send_message(0x000, bytes([NmtCommand.ENTER_PRE_OPERATIONAL, drive.node]))
            network.send_message(0x600 + drive.node, b"\x40" + _DEVICE_TYPE + bytes(4))
    for _ in range(round(_SEARCH / _STEP)):
        if all(answers.values()):
            break
        pause(_STEP)
    pause(_SECOND_ANSWER)
    for drive in drives:
        network.unsubscribe(0x580 + drive.node, note)
    network.check()  # if the bus has failed, nobody could answer
    missing = [drive.name for drive in drives if not answers[drive.node]]
    if missing:
        raise MachineError(f"no drive answers for {', '.join(missing)}; check power, cable, bit rate and node-ID")
    refuse_clashes(network, [drive.node for drive in drives])
    for drive in drives:
        if len(answers[drive.node]) > 1:
            raise MachineError(
                f"{len(answers[drive.node])} devices answer as node {drive.node}, which axis {drive.axis.name} shall "
                "have for itself; give each device a node-ID of its own"
            )
        profile = int.from_bytes(answers[drive.node][0][4:6], "little")
        if answers[drive.node][0][0] & 0xE0 == 0x40 and profile != _PROFILE:
            raise MachineError(f"{drive.name} is a device of profile {profile}, not a drive (402)")


def home(node: canopen.RemoteNode, drive: DriveSettings, timeout: float, watch: Watch = unwatched) -> None:
    """Carry out the drive's homing method. Raises MachineError if it fails or takes longer than `timeout` s."""
    _download(node, 0x6098, 0, drive.homing or 0)
    if drive.home_offset is not None:
        _download(node, 0x607C, 0, drive.home_offset)
    _choose(node, drive, Mode.HOMING)
    try:
        for word, state in (
            (codes.SHUTDOWN, State.READY),
            (codes.SWITCH_ON, State.SWITCHED_ON),
            (codes.ENABLE_OPERATION, State.OPERATION_ENABLED),
        ):
            _download(node, 0x6040, 0, word)
            _wait_for_state(node, drive, state)
        _download(node, 0x6040, 0, codes.ENABLE_OPERATION | codes.BIT_4)
        _wait_for_home(node, drive, time.monotonic() + timeout, watch)
        _check_home(node, drive)
    except BaseException:  # be it an interrupt from the keyboard: no power, and what was wrong is said
        with contextlib.suppress(MachineError, SdoCommunicationError, can.CanError, OSError):
            _take_power(node)
        raise
    _take_power(node)
    _wait_for_state(node, drive, State.SWITCH_ON_DISABLED)


@contextmanager
def _stops_told(network: canopen.Network, drive: DriveSettings) -> Iterator[None]:
    """A failure after an NMT stop, which is what an emergency stop sends, is told as such."""
    stopped: list[int] = []

    def note(_: int, data: bytearray, __: float) -> None:
        if len(data) == 2 and data[0] == NmtCommand.STOP and data[1] in (0, drive.node):
            stopped.append(data[1])

    network.subscribe(0x000, note)
    try:
        yield
    except (MachineError, SdoAbortedError, SdoCommunicationError) as error:
        if not stopped:
            raise
        raise MachineError(
            f"emergency stop: {drive.name} was stopped from outside this run (NMT stop) while it was homed"
        ) from error
    finally:
        network.unsubscribe(0x000, note)


def _take_power(node: canopen.RemoteNode) -> None:
    """Disable the voltage. Said again where something else was answered: a late answer is not the one to this."""
    for last in (False, False, True):
        try:
            _download(node, 0x6040, 0, codes.DISABLE_VOLTAGE)
            return
        except SdoCommunicationError:
            if last:
                raise


def _wait_for_home(node: canopen.RemoteNode, drive: DriveSettings, deadline: float, watch: Watch) -> None:
    attained = codes.TARGET_REACHED | codes.MODE_12
    while (status := _status(node)) & attained != attained or status & codes.MODE_13:
        if status & codes.MODE_13 or state_of(status) is not State.OPERATION_ENABLED:
            raise MachineError(f"{drive.name}: homing by method {drive.homing} failed: {_describe(node, status)}")
        if time.monotonic() > deadline:
            raise MachineError(
                f"{drive.name}: homing by method {drive.homing} did not end in time; give it a longer homing_timeout, "
                f"or check its speeds 0x6099: {_describe(node, status)}"
            )
        watch(drive.axis.name, _position(node) * drive.direction / drive.counts)
        time.sleep(0.01)


def _check_home(node: canopen.RemoteNode, drive: DriveSettings) -> None:
    """MachineError for a drive that takes 0x607C as the position that home gets: CiA 402 says minus that.

    One that has run on past its mark, or on to its zero, stands at neither.
    """
    offset = drive.home_offset or 0
    if abs((stands := _position(node)) - offset) < abs(offset) / 4:
        raise MachineError(
            f"{drive.name}: it stands at {stands} counts after homing, where `home` asks for {-offset}: this drive's "
            "home offset 0x607C is the position that home gets, which CiA 402 counts the other way round; take `home` "
            f"out, and give write = [[0x607C, 0, {-offset}]]"
        )


# --- steps


def load(network: canopen.Network, drive: DriveSettings) -> canopen.RemoteNode:
    node = network.add_node(drive.node, read_eds(drive.eds, drive.node))
    node.sdo.RESPONSE_TIMEOUT = _ANSWERS_IN
    return node


def _communication(node: canopen.RemoteNode, drive: DriveSettings, settings: Settings, period: float) -> None:
    """Heartbeat, SYNC and the interpolation time."""
    _optional(node, drive, 0x1016, 1, 0)
    _optional(node, drive, 0x1017, 0, round(settings.heartbeat * 1e3))
    _optional(node, drive, 0x1006, 0, round(period * 1e6))
    exponent = -3
    while exponent > -6 and abs(round(period / 10.0**exponent) * 10.0**exponent - period) > 1e-9:
        exponent -= 1
    value = round(period / 10.0**exponent)
    if value > 255:
        what = f"a sample period of {period} s does not fit the drive's interpolation time 0x60C2"
        raise InputError(f"{what}; choose a whole number of ms, at most 255", drive.name)
    _optional(node, drive, 0x60C2, 2, exponent)
    _optional(node, drive, 0x60C2, 1, value)


def _reset_fault(node: canopen.RemoteNode, drive: DriveSettings) -> None:
    """Power off, and out of a fault that is there from before."""
    _download(node, 0x6040, 0, codes.DISABLE_VOLTAGE)
    if state_of(_status(node)) in (State.FAULT, State.FAULT_REACTION_ACTIVE):
        _wait(lambda: state_of(_status(node)) is State.FAULT)
        _download(node, 0x6040, 0, codes.FAULT_RESET)
        _download(node, 0x6040, 0, codes.DISABLE_VOLTAGE)
    _wait_for_state(node, drive, State.SWITCH_ON_DISABLED)


def _profile(node: canopen.RemoteNode, drive: DriveSettings) -> None:
    """The profile of mode pp, within the axis's limits; the drive's own where the machine's file has none."""
    limits = drive.axis.limits
    if limits is not None:
        for index, most in ((0x6081, limits.velocity), (0x6083, limits.acceleration)):
            _download(node, index, 0, round(most * drive.velocity_counts))
        _optional(node, drive, 0x6084, 0, round(limits.acceleration * drive.velocity_counts))  # without it: 0x6083


def _choose(node: canopen.RemoteNode, drive: DriveSettings, mode: Mode) -> None:
    if 0x6502 in node.object_dictionary:
        supported = int.from_bytes(node.sdo.upload(0x6502, 0), "little")
        if not supported & mode.supported_bit:
            raise MachineError(f"{drive.name} has no mode of operation {mode} (it has 0x6502 = {supported:#010x})")
    _download(node, 0x6060, 0, mode)
    if not _wait(lambda: int.from_bytes(node.sdo.upload(0x6061, 0), "little", signed=True) == mode):
        raise MachineError(f"{drive.name} did not take mode of operation {mode}: {_describe(node, _status(node))}")


def _still_target(node: canopen.RemoteNode, drive: DriveSettings) -> None:
    """No target from before: stay where you are."""
    target = drive.command.target
    _download(node, target, 0, _position(node) if target == 0x607A else 0)


def _software_limits(node: canopen.RemoteNode, drive: DriveSettings) -> Limits:
    """0x607D in axis units. None: an EDS without it, a spindle, 0 and 0 (which drives take for none), or a whole turn
    of the counter."""
    if drive.reads_velocity or 0x607D not in node.object_dictionary:
        return -inf, inf
    try:
        low, high = (int.from_bytes(node.sdo.upload(0x607D, place), "little", signed=True) for place in (1, 2))
    except SdoAbortedError as error:
        LOG.warning("%s does not tell its software limits: %s", drive.name, error)
        return -inf, inf
    if low >= high:
        return -inf, inf
    scale = drive.direction / drive.counts
    ends = (low * scale if low > -_HALF else -inf * scale, high * scale if high < _HALF - 1 else inf * scale)
    return min(ends), max(ends)


def _watch_host(node: canopen.RemoteNode, drive: DriveSettings, settings: Settings) -> None:
    """From the host's first heartbeat on (when the loop takes command), the drive waits for the next ones."""
    time_allowed = ceil(settings.heartbeat * _LOST_AFTER * 1e3)
    _optional(node, drive, 0x1016, 1, 0)
    _optional(node, drive, 0x1016, 1, settings.host << 16 | time_allowed)


# --- helpers


def _download(node: canopen.RemoteNode, index: int, subindex: int, value: int) -> None:
    try:
        variable = node.object_dictionary.get_variable(index, subindex)
        if variable is None:
            raise MachineError(f"node {node.id}: the EDS has no object 0x{index:04X}:{subindex:02X}")
        size = max(len(variable) // 8, 1)
        if not -(1 << 8 * size - 1) <= int(value) < 1 << 8 * size:
            raise InputError(
                f"0x{index:04X}:{subindex:02X} = {int(value)} does not fit into the {8 * size} bits of this object; "
                "give a smaller number",
                f"node {node.id}",
            )
        node.sdo.download(index, subindex, (int(value) % (1 << 8 * size)).to_bytes(size, "little"))
    except SdoAbortedError as error:
        raise MachineError(f"node {node.id} refuses 0x{index:04X}:{subindex:02X} = {int(value)}: {error}") from error


def _optional(node: canopen.RemoteNode, drive: DriveSettings, index: int, subindex: int, value: int) -> None:
    if node.object_dictionary.get_variable(index, subindex) is None:
        LOG.info("%s has no object 0x%04X:%02X", drive.name, index, subindex)
        return
    try:
        _download(node, index, subindex, value)
    except MachineError as error:
        LOG.warning("%s; going on without", error)


def _position(node: canopen.RemoteNode) -> int:
    return int.from_bytes(node.sdo.upload(0x6064, 0), "little", signed=True)


def _status(node: canopen.RemoteNode) -> int:
    return int.from_bytes(node.sdo.upload(0x6041, 0), "little")


def _wait(holds: Callable[[], bool]) -> bool:
    deadline = time.monotonic() + _CHANGE
    while not holds():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.002)
    return True


def _wait_for_state(node: canopen.RemoteNode, drive: DriveSettings, state: State) -> None:
    if not _wait(lambda: state_of(_status(node)) is state):
        raise MachineError(f"{drive.name} did not reach {state} in {_CHANGE:g} s: {_describe(node, _status(node))}")


def _describe(node: canopen.RemoteNode, status: int) -> str:
    """Statusword and error code for people."""
    try:
        code = int.from_bytes(node.sdo.upload(0x603F, 0), "little")
    except (SdoAbortedError, SdoCommunicationError):
        return f"statusword {status_text(status)}"
    return f"statusword {status_text(status)}, error code {error_text(code)}"


@contextmanager
def _naming(drive: DriveSettings) -> Iterator[None]:
    """What the library raises, as a MachineError that names the drive."""
    try:
        yield
    except SdoAbortedError as error:
        raise MachineError(f"{drive.name} refused an object during configuration: {error}") from error
    except SdoCommunicationError as error:
        raise MachineError(f"{drive.name} stopped answering during configuration: {error}") from error
    except (KeyError, AttributeError) as error:
        raise MachineError(f"{drive.name}: the EDS {drive.eds} lacks what is needed: {error}") from error
    except (can.CanError, OSError) as error:
        raise bus_failed(f"of {drive.name}", error) from error
