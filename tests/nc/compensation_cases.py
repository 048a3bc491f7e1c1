"""Compensated stretches as data: run through our machine, written as programs, and run through LinuxCNC's rs274."""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import strategies as st

from rds.nc.compensation.compensation import LEFT, RIGHT, Compensation, Item
from rds.nc.compensation.moves import Stretch
from rds.nc.language.canon import ARC, FEED, TRAVERSE, Call

NAMES = {TRAVERSE: "STRAIGHT_TRAVERSE", FEED: "STRAIGHT_FEED", ARC: "ARC_FEED"}
COUNTS = {TRAVERSE: 6, FEED: 6, ARC: 9}
needs_rs274 = pytest.mark.skipif(shutil.which("rs274") is None, reason="rs274 (Debian's linuxcnc-uspace) is missing")

Triple = tuple[float, float, float]
Call_ = tuple[str, tuple[float, ...]]  # a move as rs274 prints it


class Straight(NamedTuple):
    rapid: bool
    end: Triple


class Round(NamedTuple):
    end: Triple
    centre: tuple[float, float]
    turn: int


STOP, OFF = "M0", "G40"
Op = Straight | Round | str


class Case(NamedTuple):
    """A stretch from G41.1 or G42.1 on; points in the plane's order (X Y Z, or Z X Y)."""

    plane: str
    side: int
    radius: float
    start: Triple
    ops: tuple[Op, ...]


def moves(items: list[Item]) -> list[Call_]:
    """Rows as rs274 names them."""
    rows = [item for item in items if not isinstance(item, Call)]
    return [(NAMES[row[0]], tuple(row[4][: COUNTS[row[0]]])) for row in rows]


def made(case: Case, record: list[Stretch] | None = None) -> list[Call_]:
    """What our machine makes of a case. Raises ProgramError."""
    machine = Compensation(case.side, case.radius, case.plane, case.start, record=record)
    items: list[Item] = [_plain(case, True, case.start)]
    off = False
    for line, op in enumerate(case.ops, start=4):
        if op == OFF:
            items += machine.off(line)
            off = True
        elif op == STOP:
            items += machine.stop(line)
        elif isinstance(op, Round):
            items += machine.arc(op.end, op.centre, op.turn, (0, 0, 0), line)
        elif isinstance(op, Straight) and off:
            machine.leave(op.rapid, machine.programmed, op.end, line)
            items.append(_plain(case, op.rapid, op.end))
        elif isinstance(op, Straight):
            items += machine.straight(op.rapid, op.end, (0, 0, 0), line)
    return moves(items + machine.stop())


def _plain(case: Case, rapid: bool, end: Triple) -> Item:
    u, v, w = end
    values = (u, v, w, 0.0, 0.0, 0.0) if case.plane == "XY" else (v, w, u, 0.0, 0.0, 0.0)
    return (TRAVERSE if rapid else FEED, 0, 0, 0, (*values, 0.0, 0.0, 0.0))


def program(case: Case) -> str:
    """The case as a part program, to 1e-6."""
    axes, centre = ("XYZ", "IJ") if case.plane == "XY" else ("ZXY", "KI")

    def words(letters: str, values: tuple[float, ...]) -> str:
        return " ".join(f"{letter}{value:.6f}" for letter, value in zip(letters, values, strict=True))

    plane = "G17" if case.plane == "XY" else "G18"
    side = "G41.1" if case.side == LEFT else "G42.1"
    lines = [
        f"G21 G90 G90.1 F100 {plane}",
        f"G0 {words(axes, case.start)}",
        f"{side} D{2 * case.radius:.6f}",
    ]
    for op in case.ops:
        if isinstance(op, Straight):
            lines.append(f"G{0 if op.rapid else 1} {words(axes, op.end)}")
        elif isinstance(op, Round):
            turns = f" P{abs(op.turn)}" if abs(op.turn) > 1 else ""
            lines.append(f"G{3 if op.turn > 0 else 2} {words(axes, op.end)} {words(centre, op.centre)}{turns}")
        else:
            lines.append(op)
    return "\n".join([*lines, "M2", ""])


def rs274(text: str, tools: str = "") -> tuple[str, str]:
    """What rs274 prints of a program, and its complaint ("" without)."""
    with tempfile.TemporaryDirectory() as home:  # it truncates a file in its HOME
        folder = Path(home)
        for name, content in (("p.ngc", text), ("t.tbl", tools or "T1 P1 D0.25\n"), ("v.var", "")):
            (folder / name).write_text(content)
        arguments = ["rs274", "-t", "t.tbl", "-v", "v.var", "-n", "2", "-g", "p.ngc"]
        environment = {**os.environ, "HOME": home}
        done = subprocess.run(arguments, cwd=home, env=environment, capture_output=True, text=True, timeout=20)
    complaint = " ".join(line for line in done.stderr.splitlines() if line and line != "executing")
    return done.stdout, complaint


def moves_of(text: str) -> list[Call_]:
    """The moves in what rs274 prints."""
    found = re.findall(r"(STRAIGHT_TRAVERSE|STRAIGHT_FEED|ARC_FEED)\((.*)\)", text)
    return [(name, tuple(float(value) for value in values.split(","))) for name, values in found]


def same(ours: list[Call_], theirs: list[Call_]) -> bool:
    """Move for move, to the four decimals that rs274 prints."""
    return len(ours) == len(theirs) and all(
        a[0] == b[0] and max(abs(x - y) for x, y in zip(a[1], b[1], strict=True)) < 1.01e-4
        for a, b in zip(ours, theirs, strict=True)
    )


_TURNS = (0.0, 0.0, math.pi / 2, -math.pi / 2, math.pi)


@st.composite
def cases(draw: st.DrawFn) -> Case:
    """Stretches of lines and arcs whose corners are tangent, square, nearly flat or anything."""

    def number(low: float, high: float, digits: int = 2) -> float:
        return round(draw(st.floats(low, high)), digits)

    def corner() -> float:
        return draw(st.one_of(st.sampled_from(_TURNS), st.floats(-3.1, 3.1), st.floats(-0.06, 0.06)))

    u, v, w = start = (number(-20, 20), number(-20, 20), number(-3, 3))
    heading = draw(st.floats(0, 6.28))
    ops: list[Op] = []
    for count in range(draw(st.integers(1, 7))):
        kind = draw(st.sampled_from(("straight", "round", "straight", "round", "level", "rapid", "stop")))
        if kind in ("level", "stop") and count:
            if kind == "stop":
                ops.append(STOP)
                continue
            w = number(-3, 3)
            ops.append(Straight(draw(st.booleans()), (u, v, w)))
            continue
        heading += corner()
        length = draw(st.floats(1, 40))
        if kind != "round":
            end = (round(u + length * math.cos(heading), 3), round(v + length * math.sin(heading), 3))
            ops.append(Straight(kind == "rapid", (*end, w)))
            heading = math.atan2(end[1] - v, end[0] - u)
        else:
            turn = draw(st.sampled_from((1, -1)))
            centre = (
                round(u - turn * length * math.sin(heading), 4),
                round(v + turn * length * math.cos(heading), 4),
            )
            radius = math.dist((u, v), centre)
            swept = draw(st.one_of(st.sampled_from((math.pi / 2, math.pi, 2 * math.pi)), st.floats(0.05, 6.2)))
            angle = math.atan2(v - centre[1], u - centre[0]) + turn * swept
            end = (round(centre[0] + radius * math.cos(angle), 6), round(centre[1] + radius * math.sin(angle), 6))
            if swept == 2 * math.pi:
                end = (u, v)
                turn *= draw(st.sampled_from((1, 2)))
            w = draw(st.one_of(st.just(w), st.floats(-3, 3).map(lambda x: round(x, 2))))
            ops.append(Round((*end, w), centre, turn))
            heading = angle + math.copysign(math.pi / 2, turn)
        u, v = end
    if draw(st.booleans()):
        ops += [OFF, Straight(False, (round(u + 20.0, 6), round(v + 5.0, 6), w))]
    radius = draw(st.sampled_from((0.5, 1.0, 2.0, 3.0, 5.0)))
    return Case(draw(st.sampled_from(("XY", "XZ"))), draw(st.sampled_from((LEFT, RIGHT))), radius, start, tuple(ops))
