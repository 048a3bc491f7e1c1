"""Which bus a command is for: what its options say, over the `[bus]` table of an experiment."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

BUILTIN = "rds"  # as in rds.bus.tools.link, which takes long to import
SERIAL = "serial"  # as in rds.bus.hub.bus_settings: a line of units (dialect dcs) where no other dialect is named
SERIAL_MACHINE = "starmill"
MACHINE = "mini-cnc"  # whose channel of the built-in bus is meant where nothing is said

Interface = Annotated[
    str | None, typer.Option(help="python-can interface; by default the experiment's, else rds, the built-in.")
]
Channel = Annotated[
    str | None,
    typer.Option(
        "--channel", "-c", help=f"By default the experiment's; on the built-in bus its machine's name, else {MACHINE}."
    ),
]
Baud = Annotated[int | None, typer.Option(help="With --interface serial: bit/s; by default the experiment's.")]
Bitrate = Annotated[
    int | None, typer.Option(help="Bit rate of CAN, bit/s, for interfaces that have to be told.", min=1)
]
Experiment = Annotated[
    Path | None,
    typer.Option(help="An experiment's TOML file, for its \\[bus]: interface, channel, options of the adapter."),
]
Machine = Annotated[
    str | None, typer.Option(help=f"Its name, or its TOML file; by default the experiment's, else {MACHINE}.")
]


@dataclass(frozen=True)
class ChosenBus:
    """An interface of python-can, its channel, and what else goes to can.Bus, such as the bit rate."""

    interface: str
    channel: Any
    options: dict[str, Any] = field(default_factory=dict)
    dialect: str | None = None  # what its modules speak, where that is said

    @property
    def name(self) -> str:
        """As messages call it."""
        from rds.bus.tools.link import bus_name

        return bus_name(self.interface, self.channel)

    @property
    def is_line(self) -> bool:
        """Whether it is a serial line of units, and no CAN bus."""
        return self.interface == SERIAL and self.dialect in (None, "dcs")

    def baud(self, given: int | None) -> float:
        """The baud rate of a line: `given`, else the experiment's. InputError for one that none has."""
        from rds.bus.hub.bus_settings import BAUD, DEFAULT_BAUD

        asked = self.options.get("baud", DEFAULT_BAUD) if given is None else given
        return BAUD.check(asked, "baud")

    @contextmanager
    def opened(self) -> Iterator[Any]:
        """The bus, shut down at the end. MachineError where it cannot be opened."""
        from rds.bus.tools.link import open_bus

        bus = open_bus(self.interface, self.channel, **self.options)
        try:
            yield bus
        finally:
            bus.shutdown()


class BusOptions(NamedTuple):
    """The options by which most commands are told their bus."""

    interface: Interface = None
    channel: Channel = None
    bitrate: Bitrate = None
    experiment: Experiment = None

    def chosen(self) -> ChosenBus:
        """See `chosen_bus`."""
        return chosen_bus(self.interface, self.channel, self.experiment, self.bitrate)


def bus_table_of(
    experiment: Path | None, interface: str | None = None, channel: str | None = None, bitrate: int | None = None
) -> dict[str, Any]:
    """The [bus] table of an experiment, `channel`, `interface` and `bitrate` over it; empty where nothing is said.

    InputError for a table that will not do, and for an interface other than the table's, whose options are not its own.
    """
    table: dict[str, Any] = {}
    if experiment is not None:
        from rds.core.toml_table import TomlTable
        from rds.modes.experiment.bus_table import bus_table
        from rds.modes.experiment.experiment_file import EXPERIMENT

        table = bus_table(TomlTable.open(experiment, EXPERIMENT), experiment.parent)
        said = str(table.get("interface", BUILTIN))
        if interface not in (None, said) and table:
            from rds.core.errors import InputError

            raise InputError(
                f"--interface {interface}, and [bus] of {experiment} is for {said}: its channel and options are no "
                "other interface's; leave one of the two out"
            )
    given = {"interface": interface, "channel": channel, "bitrate": bitrate}
    return table | {key: value for key, value in given.items() if value is not None}


def machine_of(experiment: Path | None) -> str:
    """The machine that an experiment is for: a name, or the path of its file."""
    if experiment is None:
        return MACHINE
    from rds.core.toml_table import TomlTable
    from rds.modes.experiment.experiment_file import EXPERIMENT
    from rds.modes.experiment.resolve import machine_name

    return machine_name(TomlTable.open(experiment, EXPERIMENT), experiment.parent)


def chosen_bus(
    interface: str | None, channel: str | None, experiment: Path | None, bitrate: int | None = None
) -> ChosenBus:
    """The bus that a command is for. InputError as `bus_table_of`, and for a bit rate of a serial line.

    The built-in bus is joined as it is: its timing is that of whoever serves the machine. One with another `bitrate`
    is refused when it is opened.
    """
    table = bus_table_of(experiment, interface, channel, bitrate)
    where, place, dialect = str(table.get("interface", BUILTIN)), table.get("channel"), table.get("dialect")
    if bitrate is not None and where == SERIAL and dialect in (None, "dcs"):
        from rds.core.errors import InputError

        raise InputError("--bitrate is for CAN, and this is a serial line; give --baud instead, or leave it out")
    if where == SERIAL and place is None and dialect in (None, "dcs"):
        place = SERIAL_MACHINE if experiment is None else _channel_of(experiment)
    if where != BUILTIN:
        from rds.bus.tools.link import bus_options

        return ChosenBus(where, place, bus_options(table), dialect)
    asked = {} if bitrate is None else {"bitrate": bitrate}
    return ChosenBus(where, str(place) if place is not None else _channel_of(experiment), asked, dialect)


def refuse_baud(place: ChosenBus, baud: int | None) -> None:
    """InputError for --baud of what is no serial line."""
    if baud is not None and not place.is_line:
        from rds.core.errors import InputError

        raise InputError(
            f"--baud is for serial lines, and this is {place.name}; add --interface serial, or leave it out"
        )


def _channel_of(experiment: Path | None) -> str:
    """The channel of the built-in bus on which the machine of an experiment is by default."""
    if experiment is None:
        return MACHINE
    from rds.machines import load_machine

    return load_machine(machine_of(experiment)).name
