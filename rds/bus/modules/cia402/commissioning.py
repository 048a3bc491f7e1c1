"""A drive out of the box made ready, step by step: each says what it will do, waits for a yes, and can be taken back.

Nothing here prints or asks: the `Operator` does. `rds drive setup` is one (rds/cli/drive.py).
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import can
import canopen
from canopen.sdo import SdoAbortedError

from rds.bus.modules.cia402 import examination
from rds.bus.modules.cia402.codes import Mode, NmtCommand
from rds.bus.modules.cia402.commissioned import Choices, cia402_table, machine_text
from rds.bus.modules.cia402.configure import library, load
from rds.bus.modules.cia402.first_motion import FirstMotion, first_motion
from rds.bus.modules.cia402.identity import Identity, answers, check_eds, identify, keep_eds, kept_eds, number, upload
from rds.bus.modules.cia402.mapping import find_fixed, map_dynamically
from rds.bus.modules.cia402.parameters import store
from rds.bus.modules.cia402.settings import Command, DriveSettings, read_settings
from rds.core.errors import InputError, MachineError
from rds.core.private_files import write_private
from rds.machines import load_machine
from rds.machines.machine import Machine

ORDER = ("csp", "csv", "cst", "pp")  # modes, the easiest to track a sine with first


class Declined(Exception):
    """Somebody said no; what was changed until then has been taken back."""


class Operator(Protocol):
    """Where a set-up says what it does, and asks."""

    def say(self, text: str) -> None:
        """A finding."""

    def agree(self, step: str) -> bool:
        """What will be done now; whether it may."""

    def choose_direction(self, moved: int) -> int:
        """Whether a motion of so many counts went towards the machine's plus: 1, else -1."""


@dataclass(frozen=True)
class CommissioningOptions:
    """What a user has said beforehand; None: find out."""

    node: int
    axis: str = "X"
    unit: str = "mm"
    lead: float = 1.0  # axis units per revolution of the shaft
    counts: float | None = None
    travel: float = 10.0  # to both sides
    period: float = 0.002  # s
    mode: str | None = None
    eds: Path | None = None
    torque: int = 100  # ‰ at most, of the first motion
    distance: int = 40  # counts of it
    keep_in_drive: bool = False  # store parameters in the drive at the end


@dataclass
class Commissioned:
    """What a set-up ends with."""

    identity: Identity
    choices: Choices
    units: examination.Units
    motion: FirstMotion

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        found = asdict(self)
        found["loop_delay_s"] = self.motion.loop_delay(self.choices.period)
        return found


def commission(
    bus: can.BusABC, options: CommissioningOptions, name: str, operator: Operator, eds_folder: Path | None = None
) -> Commissioned:
    """Make the drive with node-ID `options.node` ready.

    Declined after a no; MachineError and InputError say what is wrong.
    What is changed on the drive for the set-up alone is written back at its end, whatever the end is.
    """
    before: dict[tuple[int, int], bytes] = {}
    try:
        return _commission(bus, options, name, operator, before, eds_folder)
    except BaseException:
        _set(bus, options.node, before)
        raise


def _commission(
    bus: can.BusABC,
    options: CommissioningOptions,
    name: str,
    operator: Operator,
    before: dict[tuple[int, int], bytes],
    eds_folder: Path | None,
) -> Commissioned:
    with library(bus) as network:
        identity, eds = _recognize(network, options, operator, eds_folder)
        units = examination.read_units(_bare(network, options.node))
        choices = _units(options, name, units, eds, operator)
        with _machine(choices) as machine:
            _mapping(network, machine, choices, identity, options, operator)
        _limits(_bare(network, options.node), choices, options, operator, before)
    motion = _move(bus, choices, options, units, operator, before)
    wanted = {(index, subindex): value for index, subindex, value in choices.write}
    sizes = {key: len(data) for key, data in before.items() if key in wanted}
    own = {key: (wanted[key] % (1 << 8 * size)).to_bytes(size, "little") for key, size in sizes.items()}
    _set(bus, options.node, before | own)  # and not what limited the first motion
    choices.direction = operator.choose_direction(motion.moved)
    worst, whole = motion.exchange_worst * 1e3, motion.loop_delay(choices.period) * 1e3
    operator.say(
        f"a cycle takes {motion.exchange * 1e3:.2f} ms from SYNC to answer (99 %: {worst:.2f} ms); from a sample to "
        f"the effect of its command {whole:.1f} ms"
    )
    if motion.exchange_worst > choices.period:
        operator.say(
            f"that is more than the sample period of {choices.period * 1e3:g} ms: give a longer one (--sample-period)"
        )
    if options.keep_in_drive:
        if not operator.agree(
            "store the drive's parameters in its memory (0x1010); the way back is `rds drive restore`"
        ):
            raise Declined
        with library(bus) as network:
            store(_bare(network, options.node))
    return Commissioned(identity, choices, units, motion)


# --- steps


def _recognize(
    network: canopen.Network, options: CommissioningOptions, operator: Operator, folder: Path | None
) -> tuple[Identity, Path | None]:
    """Identity and EDS."""
    network.send_message(0x000, bytes([NmtCommand.ENTER_PRE_OPERATIONAL, options.node]))
    node = _bare(network, options.node)
    if not answers(node):
        raise MachineError(
            f"no device answers as node {options.node}; `rds scan` lists those that do, and `rds drive node-id` gives "
            "one to a drive that has none"
        )
    identity = identify(node)
    if number(node, 0x6041) is None:
        raise MachineError(
            f"node {options.node} ({identity.name or 'without a name'}) is no CiA 402 drive: it has no statusword "
            "(0x6041); `rds scan` lists what is on the bus"
        )
    operator.say(str(identity))
    eds = options.eds or kept_eds(identity, folder)
    if eds is None:
        if identity.vendor or identity.product != 0x402:  # not our simulated drive
            operator.say(
                "no EDS of this drive is kept here: the objects of CiA 402 are assumed; give its own by --eds FILE"
            )
        return identity, None
    findings = check_eds(eds, identity)
    for finding in findings:
        operator.say(f"note: {finding}")
    if findings and not operator.agree(f"use {eds} all the same"):
        raise Declined
    if options.eds is not None and not findings and identity.vendor:
        eds = keep_eds(eds, identity, folder)
        operator.say(f"its EDS is kept for the next time: {eds}")
    return identity, eds


def _units(
    options: CommissioningOptions, name: str, units: examination.Units, eds: Path | None, operator: Operator
) -> Choices:
    operator.say(str(units))
    counts = options.counts or units.counts(options.lead)
    if counts is None:
        raise InputError(
            "the drive does not say how it counts (0x6092, 0x608F): give the position units per axis unit by --counts "
            "(mostly four times the encoder's lines, times the gear, divided by the lead)"
        )
    proposal = (
        f"take {counts:g} counts per {options.unit} ({options.lead:g} {options.unit} per revolution of the shaft), "
        f"travel ±{options.travel:g} {options.unit} from where the axis stands at the start"
    )
    if not operator.agree(proposal):
        raise Declined
    return Choices(
        name=name,
        axis=options.axis,
        unit=options.unit,
        travel=(-options.travel, options.travel),
        period=options.period,
        mode=options.mode or ORDER[0],
        node=options.node,
        counts=counts,
        eds=None if eds is None else str(eds),
    )


def _mapping(
    network: canopen.Network,
    machine: Machine,
    choices: Choices,
    identity: Identity,
    options: CommissioningOptions,
    operator: Operator,
) -> None:
    """The first mode that the drive has and that can be commanded in process data."""
    if not operator.agree(
        "map statusword and position, controlword and target into the drive's process data; the way back is to switch "
        "it off and on"
    ):
        raise Declined
    wished = (options.mode,) if options.mode else ORDER
    modes = [mode for mode in wished if identity.has(Command[mode.upper()].mode)]
    refused = f"it has no mode {' or '.join(wished)} (0x6502 = {identity.modes or 0:#x})"
    if identity.modes is None:
        modes = [mode for mode in wished if _accepts(_bare(network, choices.node), Command[mode.upper()].mode)]
        refused = f"it has no list of modes (0x6502), and does not accept {' or '.join(wished)} in 0x6060"
    for mode in modes:
        refused = ""
        for fixed in (False, True):
            settings = _settings(machine, replace(choices, mode=mode, fixed_mapping=fixed))
            node = load(network, settings)
            try:
                (find_fixed if fixed else map_dynamically)(node, settings, 1)
            except (SdoAbortedError, MachineError) as error:
                refused += f"; {error}" if refused else str(error)
                continue
            choices.mode, choices.fixed_mapping = mode, fixed
            how = ", by the process data that the drive has: its mapping is fixed" if fixed else ""
            if mode == "pp":
                how += ": it moves by profiles of its own to positions that stand, and cannot track a sine"
            operator.say(f"mode {mode}{how}")
            return
    raise MachineError(f"node {choices.node} takes no command in process data: {refused}")


def _limits(
    node: canopen.RemoteNode,
    choices: Choices,
    options: CommissioningOptions,
    operator: Operator,
    before: dict[tuple[int, int], bytes],
) -> None:
    for finding in examination.limits(node, choices.torque_limit):
        if finding.stops:
            raise MachineError(finding.text)
        if not finding.write:
            operator.say(finding.text)
            continue
        what = ", ".join(f"0x{index:04X}:{subindex:02X} = {value}" for index, subindex, value in finding.write)
        if not operator.agree(f"{finding.text}: write {what} before each run"):
            raise Declined
        choices.write += finding.write
    for key in {(index, subindex) for index, subindex, _ in choices.write} | {(0x6072, 0)}:
        data = node.sdo.upload(*key) if number(node, *key) is not None else None
        if data is not None:
            before[key] = bytes(data)


def _move(
    bus: can.BusABC,
    choices: Choices,
    options: CommissioningOptions,
    units: examination.Units,
    operator: Operator,
    before: Mapping[tuple[int, int], bytes],
) -> FirstMotion:
    distance = options.distance / choices.counts
    pushes = not choices.fixed_mapping and _has_torque(bus, choices.node)
    how = f"by a torque that rises to {options.torque} ‰ at most"
    if not pushes:
        how = "by its velocity loop" if choices.mode == "csv" else "by its position loop"
    if not operator.agree(
        f"switch the power on and move {choices.axis} by {options.distance} counts ({distance:.3g} {choices.unit}) and "
        f"back, {how}; the axis must be free, and a hand on the emergency stop"
    ):
        raise Declined
    limit = [(0x6072, 0, options.torque)] if (0x6072, 0) in before else []
    writes = [entry for entry in choices.write if entry[0] != 0x6072] + limit
    trial = replace(
        choices, mode="cst" if pushes else choices.mode, write=writes, torque_limit=options.torque if pushes else 1000
    )
    with _machine(trial) as machine:
        motion = first_motion(
            machine,
            choices.axis,
            bus,
            cia402_table(trial, write=[*map(list, writes)]),
            choices.period,
            options.distance,
            options.torque,
        )
    if motion.torque is not None:
        operator.say(f"{choices.axis} moved by {motion.moved} counts, at a torque of {motion.torque:.0f} ‰")
    else:
        operator.say(f"{choices.axis} moved by {motion.moved} counts")
    if not motion.agrees:
        raise MachineError(
            "a positive torque moves the position downwards: closed loops would run away. Swap two phases of the motor "
            "or the encoder's tracks, or correct the drive's motor direction (see its manual, and 0x607E)"
        )
    if options.counts is None and motion.increments is not None:
        finding = examination.gear_finding(units, motion.increments, motion.moved)
        if finding is not None:
            raise MachineError(finding.text)
    return motion


# --- helpers


def _bare(network: canopen.Network, number_: int) -> canopen.RemoteNode:
    """A node without any EDS: objects are asked for by their numbers."""
    node = network.add_node(number_, canopen.ObjectDictionary())
    node.sdo.RESPONSE_TIMEOUT = 1.0
    return node


def _has_torque(bus: can.BusABC, number_: int) -> bool:
    with library(bus) as network:
        node = _bare(network, number_)
        modes = identify(node).modes
        listed = _accepts(node, Command.CST.mode) if modes is None else bool(modes & Command.CST.mode.supported_bit)
        return listed and number(node, Command.CST.target) is not None


def _accepts(node: canopen.RemoteNode, mode: Mode) -> bool:
    """Whether the mode can be chosen; the one before is written back. Without power it changes nothing else."""
    before = upload(node, 0x6060)
    try:
        node.sdo.download(0x6060, 0, int(mode).to_bytes(1, "little", signed=True))
    except SdoAbortedError:
        return False
    if before is not None:
        with suppress(SdoAbortedError):  # 0 is no mode, and some drives take none
            node.sdo.download(0x6060, 0, before)
    return True


class _machine:
    """The machine of these choices, as a file for as long as it is needed."""

    def __init__(self, choices: Choices):
        self._text, self._folder = machine_text(choices, "a trial"), tempfile.TemporaryDirectory(prefix="rds-drive-")

    def __enter__(self) -> Machine:
        path = Path(self._folder.name) / "machine.toml"
        write_private(path, self._text.encode())
        return load_machine(str(path))

    def __exit__(self, *_: object) -> None:
        self._folder.cleanup()


def _settings(machine: Machine, choices: Choices) -> DriveSettings:
    return read_settings(cia402_table(choices), machine).drives[0]


def _set(bus: can.BusABC, node: int, values: Mapping[tuple[int, int], bytes]) -> None:
    if not values:
        return
    with library(bus) as network:
        bare = _bare(network, node)
        for key, data in values.items():
            try:
                bare.sdo.download(*key, data)
            except (SdoAbortedError, canopen.SdoCommunicationError):
                continue  # it has been switched off, or refuses its own value
