"""`rds nc canon` beside `rs274 -g`: processor time of whole processes, for each kind of program of a course."""

from __future__ import annotations

import os
import random
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from benchmarks.figures import Figure

HEAD = "G21 G90 G17 F500\n"
SHORT, LONG = 10_000, 100_000  # lines, rounds or moves
ASKED = {SHORT: 1.5, LONG: 1.0}  # of rs274's processor time
SLOWING = ("PYTHONDONTWRITEBYTECODE", "PYTHONUNBUFFERED")
_DEPTH = 8  # of the recursion, in which a call has a move of its own and one after the next


def _place(chance: random.Random) -> str:
    return f"X{chance.uniform(-30, 30):.3f} Y{chance.uniform(-30, 30):.3f}"


def _each(line: Callable[[random.Random, int], str], first: str = "") -> Callable[[int], str]:
    def text(lines: int) -> str:
        chance = random.Random(1)
        return HEAD + first + "".join(f"{line(chance, k)}\n" for k in range(lines)) + "M2\n"

    return text


def _loop(rounds: int) -> str:
    body = "G1 X[10*SIN[#1]] Y[10*COS[#1]]\n#1=[#1+1]\n"
    return f"{HEAD}#1=0\nO1 WHILE [#1 LT {rounds}]\n{body}O1 ENDWHILE\nM2\n"


def _recursion(moves: int) -> str:
    sub = "O1 sub\nO2 if [#1 GT 0]\nG1 X[#1] Y[#1*0.5]\nO1 call [#1-1]\nG1 X[#1*0.5]\nO2 endif\nO1 endsub\n"
    return (
        f"{sub}{HEAD}#2=0\nO3 while [#2 LT {moves // (2 * _DEPTH)}]\nO1 call [{_DEPTH}]\n#2=[#2+1]\nO3 endwhile\nM2\n"
    )


PROGRAMS: dict[str, Callable[[int], str]] = {
    "G1 X Y": _each(lambda chance, k: f"G1 {_place(chance)}"),
    "the same with S": _each(lambda chance, k: f"G1 {_place(chance)} S{chance.randint(0, 1000)}"),
    "the same with comments": _each(lambda chance, k: f"G1 {_place(chance)} (move {k})"),
    "M3 S, G1, M5 by turns": _each(lambda chance, k: (f"M3 S{k % 255}", f"G1 {_place(chance)}", "M5")[k % 3]),
    "G81 with comments": _each(lambda chance, k: f"G81 {_place(chance)} Z-3 R1 (hole {k})"),
    "holes of G83": _each(lambda chance, k: _place(chance), "G0 Z5\nG98 G83 X0 Y0 Z-3 R1 Q1\n"),
    "rounds of a loop with sines": _loop,
    "moves of a recursion": _recursion,
}


def whole(place: Path, rounds: int) -> list[Figure]:
    """Each program, short and long: the ratio of each round, in turn; the least times are in the note."""
    ours = [sys.executable, "-m", "rds", "nc", "canon"]
    figures = []
    for size, limit in ASKED.items():
        for name, text in PROGRAMS.items():
            file = place / "whole.ngc"
            file.write_text(text(size))
            both = [*ours, str(file)], ["rs274", "-g", str(file)]
            try:
                times = [(_seconds(both[0]), _seconds(both[1])) for _ in range(rounds)]
            except FileNotFoundError:
                return [Figure("whole process / rs274", note="skipped: rs274 (Debian: linuxcnc-uspace) is missing")]
            note = "{:.3f} s, rs274 {:.3f} s".format(*map(min, zip(*times, strict=True)))
            ratios = tuple(own / other for own, other in times)
            figures.append(Figure(f"{name}, {size:,}: processor time / rs274's", "×", ratios, limit, note))
    return figures


def floor(rounds: int) -> Figure:
    """Python's own start and end, which no program can do without."""
    return Figure("python -c pass", "s", tuple(_seconds([sys.executable, "-c", "pass"]) for _ in range(rounds)))


def _seconds(words: list[str]) -> float:
    """Processor time of a process, system and user."""
    settings = {name: value for name, value in os.environ.items() if name not in SLOWING}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(words, env=settings, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
