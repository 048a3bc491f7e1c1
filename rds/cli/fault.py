"""`rds bus fault`: a fault on demand, on a bus that is running; and `rds bus nodes`, who is on it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from rds.cli.common import Json, print_json, refusals

Channel = Annotated[str, typer.Option("--channel", "-c", help="Channel of the built-in bus: a machine's name.")]

AT = ("at", 0.0)  # when nothing else is said
TIMES = ("at", "for", "by")  # s
_OPTIONS = {"duration": "for", "identifier": "id"}  # as the command line calls them
NODE_TITLES = ("node", "state", "TEC", "REC", "frames", "bits", "errors", "lost", "waiting", "remark")


def fault(
    kind: Annotated[
        str | None,
        typer.Argument(
            help="lose, corrupt, delay, duplicate frames; die, hang, babble, unplug, plug, restart a node; or clear."
        ),
    ] = None,
    node: Annotated[str | None, typer.Argument(help="Name of the node, as `rds bus nodes` shows it.")] = None,
    channel: Channel = "mini-cnc",
    file: Annotated[
        Path | None, typer.Option("--file", "-f", help="A schedule, TOML; it goes on without this command.")
    ] = None,
    at: Annotated[float, typer.Option(help="s from now.")] = 0.0,
    duration: Annotated[float | None, typer.Option("--for", help="How long it lasts, s.")] = None,
    count: Annotated[int | None, typer.Option(help="How many frames it strikes (default 1).")] = None,
    identifier: Annotated[
        str | None, typer.Option("--id", help="Only frames with this identifier, as in 0x10.")
    ] = None,
    by: Annotated[float | None, typer.Option(help="The delay, s.")] = None,
    bit: Annotated[int | None, typer.Option(help="The disturbed bit, counted on the wire from 0.")] = None,
    receiver: Annotated[str | None, typer.Option(help="The one node that does not get the frame.")] = None,
    probability: Annotated[float | None, typer.Option(help="Strike each frame with this chance; needs --seed.")] = None,
    seed: Annotated[int | None, typer.Option(help="Of the chance.")] = None,
    json: Json = False,
) -> None:
    """Inject a fault into a running bus, or end all of them (clear)."""
    with refusals():
        from rds.bus.hub.faults import Faults
        from rds.bus.medium.fault_file import read_faults
        from rds.bus.medium.fault_kinds import Fault
        from rds.core.errors import InputError

        if (kind is None) == (file is None):
            raise InputError("give a kind of fault or --file with a schedule, one of the two", "rds bus fault")
        words: dict[str, Any] = {"node": node, "at": at, "duration": duration, "count": count, "by": by}
        words |= {"bit": bit, "receiver": receiver, "probability": probability, "seed": seed}
        words |= {"identifier": _identifier(identifier)}
        given = [_OPTIONS.get(name, name) for name, value in words.items() if value is not None and (name, value) != AT]
        if given and (kind == "clear" or file is not None):
            what = "clear ends all faults of all nodes" if kind == "clear" else "the schedule says what happens when"
            raise InputError(f"{what}; leave {', '.join(given)} away", "rds bus fault")
        faults: tuple[Fault, ...] = ()
        if file is not None:
            faults = read_faults(file)
        elif kind != "clear":
            faults = (Fault(kind or "", **words),)
        with Faults(channel) as line:
            if kind == "clear":
                line.clear()
            else:
                line.check_names(faults)
                line.play(faults, own=False)
    if json:
        print_json({"channel": channel, "injected": [one.to_table() for one in faults]})
    else:
        said = "all faults are ended" if kind == "clear" else ", ".join(_words(one.to_table()) for one in faults)
        typer.echo(f"{channel}: {said}")


def nodes(channel: Channel = "mini-cnc", json: Json = False) -> None:
    """Who is on a bus: names, error states and counters, frames, bits."""
    with refusals():
        from rds.bus.hub.faults import Faults

        with Faults(channel) as line:
            found, statistics = line.nodes(), line.statistics()
    if json:
        print_json({"channel": channel, "nodes": found, "statistics": statistics})
        return
    from rds.cli.console import show_table

    rate = f"{statistics['bitrate']:,} bit/s" if statistics["bitrate"] else "untimed"
    show_table(f"Bus {channel}, {rate}", NODE_TITLES, [_row(node) for node in found])


def _row(node: dict[str, Any]) -> list[str]:
    numbers = [str(node[key]) for key in ("tec", "rec", "frames", "bits", "errors", "lost", "waiting")]
    remarks = [word for word in ("dead", "hung", "babbling", "recovering") if node[word]]
    if not node["plugged"]:
        remarks.append("unplugged")
    return [node["name"], node["state"], *numbers, ", ".join(remarks)]


def _identifier(text: str | None) -> int | None:
    from rds.core.errors import InputError

    try:
        return None if text is None else int(text, 0)
    except ValueError:
        raise InputError(f"--id {text!r} is no number; write it as 0x10 or 16") from None


def _words(table: dict[str, Any]) -> str:
    said = {key: value for key, value in table.items() if key != "kind" and (key, value) != AT}
    if "identifier" in said:
        said["identifier"] = f"{said['identifier']:#05x}"
    rest = ", ".join(f"{key} {value}{' s' if key in TIMES else ''}" for key, value in said.items())
    return f"{table['kind']} ({rest})" if rest else str(table["kind"])
