"""What interpolates, as blocks: who hands out the segments, what takes lines and arcs, and what comes out."""

from __future__ import annotations

from rds.core.errors import InputError
from rds.panels.equipment.diagram import Block, Diagram, Link
from rds.panels.interpolator.fields import ARC, BUNDLED, LINE, NONE, PROGRAM, SINGLE, USER
from rds.panels.interpolator.state import Interpolating

_TITLES = {LINE: "Linear", ARC: "Circular"}


def diagram(work: Interpolating) -> Diagram:
    """The diagram of what is chosen now (mini-cnc-rds, figure 7). InputError where a path or a file is not named."""
    path = Block("path", "Path", _path(work), 0)
    executive = Block("executive", "Executive", ("hands out segment", "after segment"), 1)
    blocks, links = [path, executive], [Link("path", "executive", "")]
    takes = [
        Block(role, _TITLES[role], ("interpolator", *_method(work, role)), 2, row)
        for row, role in enumerate(work.roles)
    ]
    last = Block("samples", "Samples", ("position, velocity", "and acceleration", f"every {_period(work):g} ms"), 3)
    if work.choices["acceleration"] != NONE:
        seconds = f"{work.choices['acceleration_time']:g} s"
        at_ends = ("rests after each",) if work.choices["exact_stop"] else ()
        blocks.append(Block("filter", "Acceleration", (str(work.choices["acceleration"]), seconds, *at_ends), 3))
        links.append(Link("filter", "samples", ""))
        last = Block(last.name, last.title, last.lines, 4)
    joins = blocks[-1].name if blocks[-1].name == "filter" else last.name
    for block in takes:
        links += [Link("executive", block.name, f"{block.name}s"), Link(block.name, joins, "mm")]
    blocks += [*takes, last]
    in_order = sorted(blocks, key=lambda each: each.column)
    said = "; ".join(f"{each.title} ({', '.join(each.lines)})" for each in in_order)
    return Diagram(tuple(blocks), tuple(links), said)


def _period(work: Interpolating) -> float:
    return 1e3 * float(work.choices["period"])


def _path(work: Interpolating) -> tuple[str, ...]:
    chosen = work.choices
    if chosen["given"] in (BUNDLED, PROGRAM):
        name = str(chosen[chosen["given"]]).strip()
        if not name:
            raise InputError("name the part program first")
        return (name.rpartition("/")[2], "with its feed rates")
    count = 1 if chosen["given"] == SINGLE else len(chosen["rows"])
    return (f"{count} segment{'s' * (count > 1)}", f"{chosen['feed']:g} {chosen['feed_unit']}")


def _method(work: Interpolating, role: str) -> tuple[str, ...]:
    chosen = work.choices
    if chosen[f"{role}_method"] == USER:
        name = str(chosen[f"{role}_file"]).strip()
        if not name:
            raise InputError(f"name the file of your interpolator for {role}s first")
        return (name.rpartition("/")[2], "yours")
    options = {name.partition(".")[2]: chosen[name] for name in chosen.fields if name.startswith(f"{role}.")}
    return (str(chosen[f"{role}_method"]), *(f"{name} {value:g}" for name, value in options.items() if value))
