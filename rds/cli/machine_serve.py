"""`rds machine list` and `rds machine serve`: the machines that there are, and their modules as nodes on a bus."""

from __future__ import annotations

import queue
from pathlib import Path
from typing import Annotated

import typer

from rds.cli.buses import Channel, Experiment, Interface, bus_table_of
from rds.cli.common import Json, print_json, refusals


def list_machines(json: Json = False) -> None:
    """The machines that come with the package."""
    from rds.machines import load_machine, machine_names

    machines = [load_machine(name) for name in machine_names()]
    if json:
        print_json({m.name: {"title": m.title, "axes": list(m.axes), "file": m.path} for m in machines})
        return
    for machine in machines:
        typer.echo(f"{machine.name}: {machine.title}")
        for axis in machine.axes.values():
            low, high = axis.travel
            typer.echo(f"  {axis.name:8} node {axis.node}, {low:g} to {high:g} {axis.unit}")


def serve(
    name: Annotated[str, typer.Argument(help="A machine's name, or the path of its TOML file.")],
    interface: Interface = None,
    channel: Channel = None,
    experiment: Experiment = None,
    dialect: Annotated[
        str | None,
        typer.Option(help="What the modules speak: {dialect}; by default as in \\[bus], or rds."),
    ] = None,
    bitrate: Annotated[
        int | None, typer.Option(min=1, help="Bit rate, bit/s; without it the built-in bus has no bit timing.")
    ] = None,
    faults: Annotated[Path | None, typer.Option(help="TOML file of faults to inject (built-in bus).")] = None,
    drift: Annotated[
        str | None, typer.Option(help="How much too fast clocks of modules go, ppm: X=50,Y=-30 (dialects rds, dcs).")
    ] = None,
    quirks: Annotated[
        str | None,
        typer.Option(
            help="What is wrong with simulated drives: wrong-sign, wrong-gear, zero-limits, closed-brake, "
            "fixed-mapping, no-node-id."
        ),
    ] = None,
    eds: Annotated[
        Path | None,
        typer.Option(help="EDS of another drive: the simulated ones have its objects and identity (dialect cia402)."),
    ] = None,
    axes: Annotated[
        str | None,
        typer.Option(help="Only these modules, as in X,Z: end this command and they are unplugged. By default all."),
    ] = None,
    cut: Annotated[
        Path | None, typer.Option(help="What the machine cuts (TOML): its load cell measures the force (dialect rds).")
    ] = None,
) -> None:
    """Run the machine's axis modules as CAN nodes, or as units on a serial line (--dialect dcs), until Ctrl-C.

    Lines on stdin are hands at the machine: 2 emergency on, 2 emergency off.
    """
    with refusals():
        from rds.bus.hub.bus_settings import SERIAL
        from rds.bus.modules.dialects import DEFAULT, check_served_with, interface_of, serve_machine
        from rds.bus.modules.server_program import hear_hands
        from rds.bus.tools.link import BUILTIN, bus_name, bus_options, default_channel
        from rds.machines import load_machine

        machine = load_machine(name)
        table = bus_table_of(experiment, interface, channel)
        spoken = dialect or table.get("dialect", DEFAULT)
        where = interface_of(spoken, str(table.get("interface", BUILTIN)))
        place = default_channel(machine, where, table.get("channel"))

        names = None if axes is None else [machine.axis(name.strip()).name for name in axes.split(",")]

        def ready() -> None:
            typer.echo(
                f"{machine.name}: {', '.join(names or machine.axes)} on {bus_name(where, place)}; Ctrl-C ends", err=True
            )

        options = bus_options(table)  # its faults are the run's, and [bus.cia402] tells a host of its drives
        if bitrate is not None:
            options["bitrate"] = bitrate
        own = {"drift": drift, "quirks": quirks, "eds": eds, "cut": None if cut is None else str(cut)}
        for option, value in own.items():
            if value is not None:
                check_served_with(spoken, option, value)
                options[option] = value
        if faults is not None:
            from rds.bus.medium.fault_file import read_faults

            options["faults"] = read_faults(faults)
        if where in (BUILTIN, SERIAL, "socketcan"):  # others would be asked for frames every 2 ms, to look for lines
            options["lines"] = queue.SimpleQueue[str]()
            hear_hands(options["lines"])
        serve_machine(machine, spoken, where, place, ready, axes=names, **options)
