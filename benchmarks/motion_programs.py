"""Programs whose planned motion is compared: lines and arcs as a student writes them, and dense lines as CAM does."""

from __future__ import annotations

import random
from collections.abc import Callable
from math import cos, exp, pi, sin

HEAD = ["G21 G90 G17 G64 P0.02", "G0 Z5", "F600"]


def pocket() -> list[str]:
    """Squares from the middle outwards, 2 mm apart."""
    lines = [*HEAD, "G0 X-2 Y-2", "G1 Z-0.5"]
    for ring in range(1, 9):
        a = 2.0 * ring
        lines += [f"G1 X{-a} Y{-a}", f"X{a}", f"Y{a}", f"X{-a}", f"Y{-a}"]
    return lines


def rounded() -> list[str]:
    """Three squares with round corners, one in the other."""
    lines = [*HEAD, "G0 X0 Y-20", "G1 Z-1"]
    for a, r in ((20, 4), (15, 4), (10, 4)):
        lines += [f"G1 Y{-a}", f"X{a - r}", f"G3 X{a} Y{r - a} J{r}", f"G1 Y{a - r}", f"G3 X{a - r} Y{a} I{-r}"]
        lines += [f"G1 X{r - a}", f"G3 X{-a} Y{a - r} J{-r}", f"G1 Y{r - a}", f"G3 X{r - a} Y{-a} I{r}", "G1 X0"]
    return lines


def holes() -> list[str]:
    """24 holes on a circle."""
    circle = (pi * k / 12 for k in range(24))
    places = [f"X{20 * cos(angle):.4f} Y{20 * sin(angle):.4f}" for angle in circle]
    return [*HEAD, f"G99 G81 {places[0]} Z-3 R1", *places[1:], "G80"]


def face() -> list[str]:
    """To and fro, 4 mm apart."""
    lines = [*HEAD, "G0 X-20 Y-20", "G1 Z-0.5"]
    for y in range(-20, 20, 8):
        lines += ["X20", f"Y{y + 4}", "X-20", f"Y{y + 8}"]
    return lines


def strokes() -> list[str]:
    """Twelve letters' worth of strokes of some mm with sharp corners."""
    chance = random.Random(3)
    lines = list(HEAD)
    for x in range(-30, 30, 5):
        lines += [f"G0 X{x} Y0", "G1 Z-0.2"]
        lines += [f"G1 X{x + chance.uniform(0, 4):.3f} Y{chance.uniform(0, 6):.3f}" for _ in range(6)]
        lines += ["G0 Z2"]
    return lines


def surface(step: float = 0.2) -> list[str]:
    """A hill with ripples, scanned in lines of `step` mm."""
    lines = [*HEAD, "G0 X-15 Y-15"]
    for row, y in enumerate(range(-15, 16, 3)):
        for k in range(round(30 / step) + 1):
            x = (-1) ** row * (k * step - 15)
            z = 4 * exp(-(x * x + y * y) / 60) + 0.5 * sin(x) * cos(y)
            lines.append(f"G1 X{x:.4f} Y{y:.4f} Z{z:.4f}")
    return lines


def outline(step: float = 0.1) -> list[str]:
    """A closed wavy outline in lines of about `step` mm."""
    lines, count = [*HEAD, "G0 X20.8 Y0", "G1 Z-1"], round(40 * pi / step)
    for k in range(count + 1):
        t = 2 * pi * k / count
        r = 20 + 2 * sin(5 * t) + 0.8 * cos(13 * t)
        lines.append(f"G1 X{r * cos(t):.4f} Y{r * sin(t):.4f}")
    return lines


def spiral(step: float = 0.5) -> list[str]:
    """A flat spiral in lines of `step` mm."""
    lines, t = [*HEAD, "G0 X2 Y0", "G1 Z-1"], 0.0
    while (r := 2 + 1.5 * t / (2 * pi)) < 12:
        lines.append(f"G1 X{r * cos(t):.4f} Y{r * sin(t):.4f}")
        t += step / r
    return lines


LINES_AND_ARCS: dict[str, Callable[[], list[str]]] = {
    "pocket of squares": pocket,
    "round corners": rounded,
    "24 holes": holes,
    "face, to and fro": face,
    "letters of short strokes": strokes,
}
DENSE: dict[str, Callable[[], list[str]]] = {
    "surface, 0.2 mm": surface,
    "outline, 0.1 mm": outline,
    "outline, 0.03 mm": lambda: outline(0.03),
    "spiral, 0.5 mm": spiral,
}


def program(lines: list[str]) -> str:
    """As text, with its end."""
    return "\n".join([*lines, "G0 Z5", "M2", ""])
