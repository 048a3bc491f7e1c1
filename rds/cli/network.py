"""`rds network`: delay in loops, measured and computed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from rds.cli.buses import Channel, Experiment, Interface, bus_table_of
from rds.cli.cluster_options import ClusterOptions
from rds.cli.common import Json, print_json, refusals, stdout_kept, writes_files

app = typer.Typer(no_args_is_help=True, help="Delay in loops over a network: measured, and what it costs.")


@app.command()
@writes_files
def measure(
    machine: Annotated[str, typer.Argument(help="A machine's name, or the path of its TOML file.")] = "mini-cnc",
    interface: Interface = None,
    channel: Channel = None,
    experiment: Experiment = None,
    seconds: Annotated[float, typer.Option(help="How long to measure, s.")] = 5.0,
    sample_period: Annotated[float | None, typer.Option(help="Sample period, s; by default the machine's.")] = None,
    bitrate: Annotated[
        int | None, typer.Option(help="Bit rate, bit/s; on the built-in bus frames take their time on the wire.", min=1)
    ] = None,
    dialect: Annotated[str | None, typer.Option(help="What the modules speak; by default rds.")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Write the delays as a trace for \\[network], FILE.csv.")
    ] = None,
    plot: Annotated[Path | None, typer.Option(help="Write histograms and the host's load as a PNG.")] = None,
    json: Json = False,
) -> None:
    """Measure the delay of a machine's loop in each direction, the bus's load and the host's. Nothing moves."""
    with refusals(), stdout_kept(json):
        from rds.network.loops.measure import measure as measured_on

        given = {"bitrate": bitrate, "dialect": dialect}
        bus = bus_table_of(experiment, interface, channel) | {k: v for k, v in given.items() if v is not None}
        measured = measured_on(machine, seconds=seconds, sample_period=sample_period, bus=bus, real_time=True)
        if out is not None:
            measured.save(out)
        if plot is not None:
            from rds.core.atomic import write_whole
            from rds.network.loops.measure_plot import plot as draw

            write_whole(plot, draw(measured).png())
    if json:
        print_json(measured.to_json() | {"trace": None if out is None else str(out)})
        return
    typer.echo(str(measured))
    for path in (out, plot):
        if path is not None:
            typer.echo(f"wrote {path}")


@app.command()
def clocks(
    machine: Annotated[str, typer.Argument(help="A machine's name, or the path of its TOML file.")] = "mini-cnc",
    interface: Interface = None,
    channel: Channel = None,
    experiment: Experiment = None,
    seconds: Annotated[float, typer.Option(help="How long to ask, s.")] = 5.0,
    period: Annotated[float, typer.Option(help="Time between two calls, s.")] = 0.05,
    drift: Annotated[
        str | None, typer.Option(help="Of a machine that is started for this: clocks too fast by ppm, X=50,Y=-30.")
    ] = None,
    radius: Annotated[float, typer.Option(help="Of the circle, mm.")] = 20.0,
    feed: Annotated[float, typer.Option(help="Along the circle, mm/s.")] = 20.0,
    json: Json = False,
) -> None:
    """Estimate offset and drift of the modules' clocks by messages, and what they leave of a circle. Nothing moves."""
    with refusals(), stdout_kept(json):
        from rds.bus.tools.link import BUILTIN, bus_options
        from rds.core.errors import InputError
        from rds.network.loops.bus_clocks import measure_clocks

        table = bus_table_of(experiment, interface, channel)
        if table.get("dialect", "rds") != "rds":
            raise InputError(f"modules of dialect {table['dialect']} do not tell their clocks; those of rds do")
        where = str(table.get("interface", BUILTIN))
        options = bus_options(table)
        measured = measure_clocks(
            machine,
            seconds=seconds,
            period=period,
            interface=where,
            channel=table.get("channel"),
            drift=drift,
            radius=radius,
            feed=feed,
            **options,
        )
    if json:
        print_json(measured.to_json())
    else:
        typer.echo(str(measured))


@app.command()
@writes_files
def sweep(
    *,
    nodes: Annotated[str, typer.Option(help="Nodes of the plant.")] = "100,1000,10000,100000",
    per_segment: Annotated[str, typer.Option(help="Nodes on a segment, 1 to 95.")] = "10,40",
    bitrate: Annotated[str, typer.Option(help="Of the segments, bit/s.")] = "500000,1000000",
    period: Annotated[str, typer.Option(help="Of the loops, s.")] = "0.01,0.1",
    backbone: Annotated[float, typer.Option(help="Bit rate of the backbone, bit/s.")] = 100e6,
    handling: Annotated[float, typer.Option(help="What the host takes for a frame, s.")] = 5e-6,
    limit: Annotated[float, typer.Option(help="Error of a clock that the plant can bear, s.")] = 50e-6,
    jobs: Annotated[int | None, typer.Option("--jobs", "-j", help="Local processes; default: all.")] = None,
    on_cluster: ClusterOptions,
    plot: Annotated[Path | None, typer.Option(help="Write a picture as a PNG.")] = None,
    json: Json = False,
) -> None:
    """What breaks first in a plant of many nodes on bridged segments: bandwidth, clocks or host. Lists: 10,20,40."""
    with refusals(), stdout_kept(json):
        from rds.network.loops.plant import PARTS, most_nodes
        from rds.network.loops.plant import sweep as swept

        cluster = on_cluster.chosen()
        found = list(
            swept(
                _numbers(nodes, "--nodes"),
                _numbers(per_segment, "--per-segment"),
                _numbers(bitrate, "--bitrate"),
                _numbers(period, "--period"),
                jobs=jobs,
                scheduler=cluster,
                backbone=backbone,
                handling=handling,
                limit=limit,
            )
        )
        if plot is not None:
            from rds.core.atomic import write_whole
            from rds.network.loops.plant_plot import plot as draw

            write_whole(plot, draw(found).png())
    if json:
        rows = [each.to_json() | {"most_nodes": most_nodes(each.plant)} for each in found]
        print_json({"plants": rows, "plot": None if plot is None else str(plot)})
        return
    from rds.cli.console import show_table

    shown = []
    for each in found:
        plant = each.plant
        used = [
            f"{paper:.0%}" + (f" ({each.simulated[i]:.0%})" if each.simulated else "")
            for i, paper in enumerate(each.paper)
        ]
        how = [str(plant.nodes), str(plant.per_segment), f"{plant.bitrate / 1e3:g}", f"{plant.period * 1e3:g}"]
        shown.append([*how, *used, each.first if not each.holds else "holds", str(most_nodes(plant))])
    columns = ["nodes", "a segment", "kbit/s", "ms", *PARTS, "breaks first", "most nodes"]
    show_table("Used of what there is: on paper (simulated)", columns, shown)
    if plot is not None:
        typer.echo(f"wrote {plot}")


def _numbers(text: str, option: str) -> list[Any]:
    """The numbers of a list with commas."""
    from rds.core.errors import InputError

    try:
        found = [float(word) for word in text.split(",") if word.strip()]
    except ValueError as error:
        raise InputError(f"{option} {text!r} must be numbers with commas, as in 10,20,40") from error
    return [int(each) if each.is_integer() else each for each in found]


@app.command()
def cost(
    experiment: Annotated[Path, typer.Argument(help="The experiment whose loop it is, a TOML file.")],
    delays: Annotated[
        Path | None, typer.Option(help="A trace of delays, as `rds network measure --out` writes it.")
    ] = None,
    delay: Annotated[
        str | None, typer.Option(help="In place of a trace: KIND:NAME=VALUE,..., as in uniform:low=0,high=0.001 (s).")
    ] = None,
    part: Annotated[
        str, typer.Option(help="Which delay of the trace: total, sensor, computing or actuator.")
    ] = "total",
    loss: Annotated[float, typer.Option(help="Share of the voltages that is lost, beside the trace's own.")] = 0.0,
    axis: Annotated[str | None, typer.Option(help="Which axis; by default the experiment's first.")] = None,
    disturbance: Annotated[float, typer.Option(help="White noise of the voltage, root of its intensity, V√s.")] = 0.01,
    noise: Annotated[float | None, typer.Option(help="Noise of the position, rms, mm; default: the encoder's.")] = None,
    effort: Annotated[float, typer.Option(help="Weight of u² in the cost, mm²/V².")] = 0.0,
    every: Annotated[int, typer.Option(help="The sensor is so many times slower than the law.")] = 1,
    bins: Annotated[int, typer.Option(help="Parts of the delay's distribution.")] = 40,
    json: Json = False,
) -> None:
    """What a delay's mean and its jitter cost the loop of an experiment, apart, and what losses cost; exactly."""
    with refusals(), stdout_kept(json):
        from rds.modes.experiment.experiment import Experiment as Loaded
        from rds.network.loops.experiment_cost import network_cost

        found = network_cost(
            Loaded.from_toml(experiment),
            _delay(delays, delay, part),
            axis=axis,
            disturbance=disturbance,
            noise=noise,
            effort=effort,
            loss=loss,
            bins=bins,
            every=every,
        )
    if json:
        print_json(found.to_json())
    else:
        typer.echo(str(found))
    raise typer.Exit(0 if found.lossy.stable else 1)


def _delay(trace: Path | None, text: str | None, part: str) -> Any:
    """The delay that a trace or the words of an option give."""
    from rds.core.errors import InputError
    from rds.network.delays import Delay
    from rds.network.trace import read_total

    if (trace is None) == (text is None):
        raise InputError("give one of --delays TRACE.csv and --delay KIND:NAME=VALUE,...")
    if trace is not None:
        return Delay.recorded(read_total(trace, part))
    kind, _, rest = str(text).partition(":")
    try:
        pairs = [word.split("=", 1) for word in rest.split(",") if word]
        return Delay.named(kind, **{name.strip(): float(value) for name, value in pairs})
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"--delay {text!r} must be KIND:NAME=VALUE,..., as in constant:delay=0.001 (s)") from error
