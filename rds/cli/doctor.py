"""`rds doctor --bus`: the adapter's own test."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from rds.cli.buses import BUILTIN, BusOptions
from rds.cli.common import Json, print_json, progress_bars, refusals
from rds.cli.option_groups import grouped_options

if TYPE_CHECKING:
    from rds.bus.tools.adapter_test import AdapterReport


@grouped_options
def doctor(
    *,
    bus: Annotated[bool, typer.Option("--bus", help="Examine a bus and the adapter to it.")] = False,
    count: Annotated[int, typer.Option(help="Questions that are asked.", min=10, max=1_000_000)] = 1000,
    on_bus: BusOptions,
    json: Json = False,
) -> None:
    """Examine a bus and its adapter: round trips, losses, errors, and what sample period it would carry.

    It needs one device on the bus that answers; nothing moves. Exit code 1 if something was lost or disturbed.
    """
    with refusals():
        from rds.bus.tools.adapter_test import examine
        from rds.core.errors import InputError, MachineError

        if not bus:
            raise InputError("say what to examine: rds doctor --bus")
        place = on_bus.chosen()
        if place.is_line:
            raise InputError("a serial line of units has a scan of its own: rds scan --interface serial")
        if place.interface == BUILTIN:
            place.options["error_frames"] = True
        import can

        with progress_bars() as bar, place.opened() as opened:
            known = place.options.get("bitrate") or getattr(opened, "bitrate", None) or None
            try:
                report = examine(opened, place.name, known, count, place.channel, bar("asking"))
            except (can.CanError, OSError) as error:
                raise MachineError(f"bus {place.name}: {error}") from error
    if json:
        print_json(report.to_json())
    else:
        _show(report)
    raise typer.Exit(0 if report.ok else 1)


def _show(report: AdapterReport) -> None:
    from rds.bus.tools.adapter_test import EDGES

    typer.echo(
        f"{report.bus}: controller {report.state}, load {report.load:.1f} % of {report.bitrate / 1e3:g} kbit/s "
        "before anything was asked"
    )
    if report.errors:
        typer.echo("errors: " + ", ".join(f"{count} × {kind}" for kind, count in report.errors.items()))
    if report.latency_timer is not None:
        typer.echo(f"latency timer of the USB chip: {report.latency_timer * 1e3:g} ms")
    if report.round_trips:
        times = " · ".join(
            f"{name} {value * 1e3:.2f} ms"
            for name, value in (
                ("p50", report.percentile(50.0)),
                ("p99", report.percentile(99.0)),
                ("p99.9", report.percentile(99.9)),
                ("most", report.percentile(100.0)),
            )
            if value is not None
        )
        typer.echo(f"{report.asked} round trips with {report.answerer}: {times}")
        typer.echo(f"lost {report.lost} · late {report.late} · twice {report.doubled} · echo {_yes(report.echo)}")
        counts = report.histogram()
        most = max(counts)
        bounds = [0.0, *EDGES]
        for low, high, number in zip(bounds, [*EDGES, None], counts, strict=True):
            if number:
                what = f"{low:g} to {high:g} ms" if high is not None else f"above {low:g} ms"
                typer.echo(f"  {what:>14}  {number:7d}  {'█' * max(1, round(40 * number / most))}")
        periods = ", ".join(
            f"{period * 1e3:g} ms with {axes} {'axis' if axes == 1 else 'axes'}"
            for axes in (1, 3, 6)
            if (period := report.sample_period(axes)) is not None
        )
        typer.echo(f"sample periods that it would carry: {periods}")
    for hint in report.hints:
        typer.echo(f"- {hint}")
    if report.ok and not report.hints:
        typer.echo("nothing is wrong with it")


def _yes(value: bool) -> str:
    return "yes" if value else "no"
