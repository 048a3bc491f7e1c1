"""A long part program of lines and arcs, like what a milling program is made of: short moves on a table of 100 mm."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from pathlib import Path

import numpy as np

TABLE = 100.0  # mm
BODY = 20_000  # lines that are written again and again for longer programs


def body(count: int = BODY, seed: int = 1) -> Iterator[str]:
    """Blocks: four lines and an arc (20° to 150°, either way, centre by I J) in turn; F in every tenth.

    Lengths of lines are 0.2 to 3 mm, radii 0.5 to 5 mm.
    """
    rng = random.Random(seed)
    x, y, heading = 50.0, 50.0, 0.0
    for k in range(count):
        feed = f" F{rng.randint(300, 900)}" if k % 10 == 0 else ""
        if k % 5 == 4:
            side, radius, angle = rng.choice((-1, 1)), rng.uniform(0.5, 5.0), rng.uniform(0.35, 2.6)
            i = round(-radius * math.sin(heading) * side, 4)
            j = round(radius * math.cos(heading) * side, 4)
            at = math.atan2(-j, -i) + side * angle
            x, y = round(x + i + math.hypot(i, j) * math.cos(at), 4), round(y + j + math.hypot(i, j) * math.sin(at), 4)
            heading += side * angle
            yield f"G{3 if side > 0 else 2} X{x:.4f} Y{y:.4f} I{i:.4f} J{j:.4f}{feed}"
        else:
            outside = not (10.0 < x < TABLE - 10.0 and 10.0 < y < TABLE - 10.0)
            heading = math.atan2(50.0 - y, 50.0 - x) if outside else heading + rng.uniform(-0.4, 0.4)
            length = rng.uniform(0.2, 3.0)
            x, y = round(x + length * math.cos(heading), 4), round(y + length * math.sin(heading), 4)
            z = f" Z{rng.uniform(-1.0, 0.0):.4f}" if k % 5 == 0 else ""
            yield f"G1 X{x:.4f} Y{y:.4f}{z}{feed}"


def write_program(path: Path, lines: int) -> Path:
    """A program of so many lines, a multiple of BODY or less, after the line that sets its modes."""
    text = "".join(f"{line}\n" for line in body(min(lines - 1, BODY)))
    with path.open("w", encoding="ascii") as file:
        file.write("G21 G17 G90 G94 G64 P0.02 F600\n")
        file.writelines(text for _ in range(max(1, lines // BODY)))
        file.write("M2\n")
    return path


def write_ball(path: Path, lines: int) -> Path:
    """A spiral on a ball with the tool square to it, for xyzac: lines of X Y Z A C under G43.4."""
    turn = np.linspace(0.0, 21600.0, lines)
    back_and_forth = np.mod(turn, 1440.0)
    c = np.where(back_and_forth < 720.0, back_and_forth, 1440.0 - back_and_forth) - 360.0
    a = np.linspace(20.0, 60.0, lines)
    flat = 40.0 * np.sin(np.radians(a))
    x, y, z = flat * np.sin(np.radians(c)), -flat * np.cos(np.radians(c)), 40.0 * (np.cos(np.radians(a)) - 1.0)
    rows = zip(x.tolist(), y.tolist(), z.tolist(), a.tolist(), c.tolist(), strict=True)
    with path.open("w") as stream:
        stream.write("G21 G90 G64 P0.02\nG43.4 H0\nG0 X0 Y0 Z20\nG1 F600\n")
        stream.writelines(f"X{x:.4f} Y{y:.4f} Z{z:.4f} A{a:.3f} C{c:.3f}\n" for x, y, z, a, c in rows)
        stream.write("G49\nG0 X0 Y0 Z100\nM2\n")
    return path
