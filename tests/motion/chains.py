"""Random chains of segments, for properties of planned motion; and the plan of one, as one array."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import cos, inf, pi, sin
from typing import Any

import numpy as np
from hypothesis import strategies as st

from rds.interpolators.motion import Limits, SampleBlock, plan
from rds.interpolators.motion.certificate import Certificate, certified
from rds.interpolators.motion.segments import BLEND, EXACT_PATH, EXACT_STOP, arc, chain, in_plane, line

MODES = (EXACT_PATH, EXACT_STOP, BLEND)
MACHINES = (
    Limits.from_axes({"X": (13, 200, 1e4), "Y": (13, 200, 1e4), "Z": (11, 150, 7500), "A": (30, 400, 2e4)}),
    Limits.from_axes({"X": (1.4, 2, 20), "Y": (100, 1000, 5e4), "Z": (1.1, 1.5, 15), "A": (3, 6, 60)}),
    Limits.from_axes({"X": (500, 5000, 1e6), "Y": (500, 5000, 1e5), "Z": (200, 2000, 1e5), "A": (100, 1000, 1e5)}),
)


@dataclass
class Event:
    after: int
    kind: str
    value: float = 0.0
    line: int = 0


@dataclass
class PathBlock:
    segments: np.ndarray
    events: list[Event]


def sizes(low: float = -5.0, high: float = 1.0) -> st.SearchStrategy[float]:
    """Lengths of all orders of magnitude."""
    return st.floats(low, high).map(lambda power: 10.0**power)


angles = st.floats(0.0, 2 * pi)


@st.composite
def chains(draw: Any, modes: tuple[int, ...] = MODES, most: int = 12, low: float = -5.0) -> np.ndarray:
    """Lines, tiny ones, reversals, arcs and helices in three planes, circles, pure rotary moves, rapids; each mode."""
    segments: list[np.ndarray] = []
    here = np.zeros(6)
    for number in range(1, draw(st.integers(1, most)) + 1):
        words = {
            "mode": draw(st.sampled_from(modes)),
            "tolerance": draw(st.sampled_from((inf, 0.001, 0.01, 0.1, 0.5))),
            "program_line": number,
        }
        rate, size = draw(sizes(-0.5, 2.0)), draw(sizes(low))
        kind = draw(st.sampled_from(("line", "line", "rapid", "back", "rotary", "both", "arc", "helix", "circle")))
        there = here.copy()
        if kind in ("line", "rapid", "both"):
            turn, rise = draw(angles), draw(st.sampled_from((0.0, 0.3)))
            there[:3] += size * np.array([cos(turn), sin(turn), rise])
            there[3] += 3.0 * size * (kind == "both")
            words["collinear"] = draw(st.sampled_from((0.0, 0.01)))
        elif kind == "rotary":
            there[3] += draw(st.sampled_from((-10.0, 10.0))) * size
        elif kind == "back":
            last = segments[-1] if segments else line(here, here + np.eye(6)[0], 1.0)
            share = draw(st.sampled_from((-1.0, -0.5, 0.3, 1.0)))
            there += (last["end"][0] - last["start"][0]) * share
            there[:2] += size * 1e-3
        else:
            plane = draw(st.sampled_from((0, 1, 2)))
            first, second, normal = in_plane(plane)
            begin, end = draw(angles), draw(angles)
            centre = here[:3].copy()
            centre[[first, second]] += size * np.array([cos(begin), sin(begin)])
            if kind != "circle":
                off = 1.0 + draw(st.sampled_from((0.0, 1e-4, -1e-4)))
                there[first] = centre[first] + size * off * cos(end)
                there[second] = centre[second] + size * off * sin(end)
            there[normal] += 0.3 * size * (kind == "helix")
            turned = {"clockwise": draw(st.booleans()), "plane": plane, "turns": draw(st.sampled_from((0, 0, 2)))}
            segments.append(arc(here, there, centre, rate, **turned, **words))
            here = segments[-1]["end"][0].copy()
            continue
        if (there == here).all():
            continue
        segments.append(line(here, there, rate, rapid=kind == "rapid", **words))
        here = there
    return chain(*segments)


def polygon(points: Any, rate: float, **words: Any) -> np.ndarray:
    """Straight lines through `points`, numbered from line 1."""
    return chain(*(line(a, b, rate, program_line=k, **words) for k, (a, b) in enumerate(pairwise(points), 1)))


def planned(
    segments: Any, limits: Limits = MACHINES[0], T: float = 1e-3, **words: Any
) -> tuple[SampleBlock, Certificate, list[tuple[int, Any]]]:
    """The plan as one block, its certificate, and all events."""
    certificate = Certificate(limits, words.get("tolerance", 0.05))
    blocks = list(
        certified(plan(segments if isinstance(segments, list) else [segments], limits, T, **words), certificate)
    )
    columns = ("position", "velocity", "acceleration", "line", "segment", "distance")
    joined = {name: np.concatenate([getattr(block, name) for block in blocks]) for name in columns}
    assert [block.first for block in blocks] == list(np.cumsum([0, *map(len, blocks)]))[:-1]
    whole = SampleBlock(0, T, **joined, path=blocks[0].path, path_first=0, path_at=0.0)
    return whole, certificate, [event for block in blocks for event in block.events]
