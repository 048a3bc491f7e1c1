"""`rds bus monitor | record | replay | serve-socketcand`: what goes over a bus, seen, kept and offered to others."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from rds.bus.tools.log_formats import in_words
from rds.cli.buses import BUILTIN, BusOptions, Channel, ChosenBus, Experiment, Interface, chosen_bus
from rds.cli.common import Json, print_json, refusals, stdout_kept, until_ctrl_c, writes_files
from rds.cli.option_groups import grouped_options

app = typer.Typer(no_args_is_help=True, help="The bus: monitor, record and replay it, offer it to other tools.")

Seconds = Annotated[float | None, typer.Option(help="End after so many seconds instead of at Ctrl-C.", min=0.0)]
Identifiers = Annotated[
    list[str] | None,
    typer.Option("--id", help="Only this identifier or range, as in 0x020-0x07F; may be given more than once."),
]
WithCommands = Annotated[
    bool, typer.Option("--with-commands", help="Let all frames through, those that move a machine on this bus, too.")
]


@app.command()
def monitor(
    interface: Interface = None,
    channel: Channel = None,
    experiment: Experiment = None,
    seconds: Seconds = None,
    bitrate: Annotated[
        int | None, typer.Option(help="Bit rate, bit/s, that the load is of; by default the bus's, or 1000000.", min=1)
    ] = None,
    data_bitrate: Annotated[int | None, typer.Option(help="Of the fast part of CAN FD frames, bit/s.", min=1)] = None,
    dbc: Annotated[list[Path] | None, typer.Option(help="DBC file to decode frames by; may be given again.")] = None,
    json: Json = False,
) -> None:
    """Show identifiers, rates, periods, decoded signals, load and errors.

    Live on a terminal; in a pipe, and with --json, once at the end.
    """
    with refusals(), stdout_kept(json):
        from rds.bus.tools.decode import decoder
        from rds.bus.tools.monitor import monitor as watch
        from rds.bus.tools.monitor import to_json
        from rds.bus.tools.statistics import BITRATE, Statistics

        place = chosen_bus(interface, channel, experiment)
        builtin = place.interface == BUILTIN
        rate = {} if builtin or bitrate is None else {"bitrate": bitrate}
        opener = _opener(place, "monitor", errors=True, **rate)
        its_own = _timing(opener) if builtin else _bits(place.options.get("bitrate"))
        data_bitrate = data_bitrate or _bits(place.options.get("data_bitrate")) or None
        statistics = Statistics(bitrate or its_own or BITRATE, data_bitrate)
        decode = decoder(dbc or ())
        with _quiet_log(live := _is_live(json)), _live(decode, live) as refresh, until_ctrl_c() as stop:
            view = watch(
                opener,
                statistics,
                name=place.name,
                seconds=seconds,
                stop=stop,
                refresh=refresh,
            )
    if json:
        print_json(to_json(view, decode))
    else:
        from rds.bus.tools.monitor_view import picture
        from rds.cli.console import console

        console().print(picture(view, decode))
    raise typer.Exit(0 if view.healthy else 1)


@app.command()
@writes_files
def record(
    file: Annotated[Path, typer.Argument(help=f"The log; its ending is its format: {in_words()}.")],
    on_bus: BusOptions,
    seconds: Seconds = None,
    count: Annotated[int | None, typer.Option(help="End after so many frames.", min=1)] = None,
    identifiers: Identifiers = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
    json: Json = False,
) -> None:
    """Record what goes over a bus, until Ctrl-C. Exit code 1 if the log is not complete; stderr says why."""
    with refusals(), stdout_kept(json):
        from rds.bus.tools.record import record as record_bus
        from rds.bus.tools.selection import Selection

        place = on_bus.chosen()
        selection = Selection(identifiers or ())
        with _quiet_log(False), until_ctrl_c() as stop, _counter("frames recorded") as show:
            result = record_bus(
                file,
                _opener(place, "recorder", errors=True),
                name=place.name,
                seconds=seconds,
                count=count,
                selection=selection,
                force=force,
                stop=stop,
                progress=lambda recording: show(recording.frames),
                ready=lambda: _say(f"recording {place.name} to {file}; Ctrl-C ends"),
            )
    if json:
        print_json({**vars(result), "complete": result.complete})
    else:
        typer.echo(f"{result.frames} frames in {result.seconds:.1f} s: {result.path}")
    for kind, number in result.unkept.items():
        _say(f"{number} {kind} are not in the log: {file.suffix} can't hold them; record to .blf or .asc")
    if result.lost:
        _say(f"{result.lost} frames are not in the log: the disk, or this computer, was too slow")
    raise typer.Exit(0 if result.complete else 1)


@app.command()
@grouped_options
def replay(
    file: Annotated[Path, typer.Argument(help="A log of any of python-can's formats.")],
    on_bus: BusOptions,
    speed: Annotated[
        float, typer.Option(help="2: twice as fast as recorded; inf: as fast as the bus takes them.")
    ] = 1.0,
    begin: Annotated[float, typer.Option("--from", help="Begin so many seconds after the log's first frame.")] = 0.0,
    end: Annotated[float | None, typer.Option("--to", help="End so many seconds after the log's first frame.")] = None,
    identifiers: Identifiers = None,
    loop: Annotated[int, typer.Option(help="Play it so many times.")] = 1,
    with_commands: WithCommands = False,
    json: Json = False,
) -> None:
    """Send the frames of a log onto a bus, at the times at which they were recorded."""
    with refusals(), stdout_kept(json):
        from rds.bus.tools.logs import LogFile
        from rds.bus.tools.replay import replay as replay_log
        from rds.bus.tools.selection import Selection

        place = on_bus.chosen()
        log = LogFile(file)
        selection = Selection(identifiers or ())
        with (
            _command_of(place, with_commands),
            _opener(place, "replay")() as bus,
            _quiet_log(False),
            until_ctrl_c() as stop,
            _counter("frames sent") as show,
        ):
            result = replay_log(
                log,
                bus,
                speed=speed,
                begin=begin,
                end=end,
                selection=selection,
                loops=loop,
                with_commands=with_commands,
                stop=stop,
                progress=lambda so_far: show(so_far.sent),
            )
    if json:
        print_json({**vars(result), "path": str(file), "skipped_lines": log.skipped, "impossible": log.impossible})
    else:
        typer.echo(f"{result.sent} frames in {result.seconds:.1f} s, at most {result.latest * 1e3:.1f} ms late")
    for reason, number in result.skipped.items():
        _say(f"{number} frame{' was' if number == 1 else 's were'} left out: {reason}")
    if len(result.channels) > 1:
        _say(f"frames of {len(result.channels)} channels ({', '.join(result.channels)}) went onto this one bus")
    if log.impossible:
        _say(f"{log.impossible} frames of the log were left out: no bus could carry them (identifier, or length)")
    if log.skipped:
        _say(f"{log.skipped} lines of the log describe no frame and were passed over")
    raise typer.Exit(0)


@app.command("serve-socketcand")
@grouped_options
def serve_socketcand(
    on_bus: BusOptions,
    host: Annotated[str, typer.Option(help="Loopback address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="TCP port; 0 takes a free one.")] = 29536,
    with_commands: WithCommands = False,
) -> None:
    """Offer a bus to your other programs on this computer by socketcand's protocol, until Ctrl-C.

    They open the bus by the name that is written here, which ends in a word that is new with each start: whoever knows
    it sees the bus, and with --with-commands moves the machine. Without that, only frames pass that no machine heeds.
    """
    with refusals():
        from rds.bus.tools.socketcand import Server

        place = on_bus.chosen()
        opener = _opener(place, "socketcand", errors=True)
        name = place.interface if place.channel in (None, "") else str(place.channel)  # what clients open
        with (
            _quiet_log(False),
            until_ctrl_c() as stop,
            _command_of(place, with_commands),
            Server(opener, name, host=host, port=port, with_commands=with_commands) as server,
        ):
            _say(f"{place.name} on {server.address[0]} port {server.address[1]}; Ctrl-C ends")
            power = "moves the machine" if with_commands else "sees the bus"
            _say(f"programs open it as {server.opens} (keep it to yourself: whoever knows this name {power})")
            while server.alive() and not stop.wait(0.2):
                pass
            alive = server.alive()
    raise typer.Exit(0 if alive else 1)


@app.command("serve-slcan")
@grouped_options
def serve_slcan(
    on_bus: BusOptions,
    latency: Annotated[
        float,
        typer.Option(help="Frames wait up to so many ms, as in USB chips that collect bytes.", min=0.0, max=100.0),
    ] = 0.0,
    garble: Annotated[
        float, typer.Option(help="Share of frames in which one character is wrong.", min=0.0, max=1.0)
    ] = 0.0,
) -> None:
    """Emulate a serial CAN adapter (slcan) in front of a bus, until Ctrl-C: to try everything without one."""
    with refusals():
        from rds.bus.tools.slcan_adapter import SlcanAdapter

        place = on_bus.chosen()
        builtin = place.interface == BUILTIN
        options = {"receive_own_messages": True} if builtin else {}
        with (
            _opener(place, "adapter")(**options) as bus,
            until_ctrl_c() as stop,
            SlcanAdapter(bus, latency * 1e-3, garble, bus_bitrate=_timed(bus), gives_back=builtin) as adapter,
        ):
            _say(f"{place.name} behind an emulated adapter; Ctrl-C ends")
            its_own = _timed(bus) or 1_000_000
            _say(f"programs open it with --interface slcan --channel {adapter.path} --bitrate {its_own}")
            while adapter.alive() and not stop.wait(0.2):
                pass


def _opener(place: ChosenBus, node: str, errors: bool = False, **more: Any) -> Any:
    """Opens the bus; on the built-in one as `node`, and with `errors` hearing of its controller's errors."""
    from rds.bus.tools.link import open_bus

    options = place.options | more
    if place.interface == BUILTIN and errors:
        options["error_frames"] = True
    return partial(open_bus, place.interface, place.channel, node=node, **options)


def _timing(opener: Any) -> int:
    """The bit rate of a channel of the built-in bus, bit/s; 0 if it has no bit timing."""
    with opener() as bus:
        return int(bus.bitrate)


def _timed(bus: Any) -> int | None:
    """The bit rate that an opened bus of the built-in kind has, bit/s; None for others, and without bit timing."""
    return int(getattr(bus, "bitrate", 0)) or None


def _bits(said: Any) -> int:
    """A bit rate of a [bus] table, bit/s; 0 where it is none, which the interface refuses when it is opened."""
    try:
        return max(int(said), 0)
    except (TypeError, ValueError):
        return 0


def _command_of(place: ChosenBus, wanted: bool) -> Any:
    """Holds the command of a channel of the built-in bus, so that no run commands the machine at the same time."""
    if not wanted or place.interface != BUILTIN:
        return nullcontext()
    from rds.bus.hub.command import Command

    return Command(str(place.channel))


@contextmanager
def _quiet_log(silent: bool) -> Iterator[None]:
    """The package's warnings as sentences on stderr; none while a live view has the screen, which shows them itself."""
    import logging

    logger = logging.getLogger("rds")
    handler: logging.Handler = logging.NullHandler() if silent else logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("rds: %(message)s"))
    logger.addHandler(handler)
    propagate, logger.propagate = logger.propagate, False
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.propagate = propagate


def _is_live(json: bool) -> bool:
    return not json and sys.stdout.isatty()


@contextmanager
def _live(decode: Any, live: bool) -> Iterator[Any]:
    """What shows a monitor's views: a table that is redrawn, or nothing."""
    if not live:
        yield None
        return
    from rich.live import Live

    from rds.bus.tools.monitor_view import picture
    from rds.cli.console import console

    screen = console()
    with Live(console=screen, auto_refresh=False, transient=True) as display:
        yield lambda view: display.update(picture(view, decode, screen.height), refresh=True)


@contextmanager
def _counter(what: str) -> Iterator[Any]:
    """What shows a growing number: a line on a terminal, nothing in a pipe."""
    if not sys.stderr.isatty():
        yield lambda number: None
        return
    from rich.console import Console
    from rich.status import Status

    with Status(f"0 {what}", console=Console(stderr=True)) as status:

        def show(number: int) -> None:
            with contextlib.suppress(OSError):  # the terminal has been closed: what is done here is still finished
                status.update(f"{number} {what}")

        yield show


def _say(sentence: str) -> None:
    typer.echo(f"rds: {sentence}", err=True)


if __name__ == "__main__":
    app()
