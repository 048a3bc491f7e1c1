"""A plant of many nodes on bridged segments: how much of each thing that can break is used, on paper and simulated.

Segments of CAN hang on a chain of bridges, whose backbone ends at the host. In each period T a segment carries a
command for every four of its n nodes and an answer of each (the frames of `rds.bus.modules.rds`), a bridge packs each
frame into one of the backbone, and the host handles one after the other:

    bandwidth   the segment:  (⌈n/4⌉ + n) C / T + (C₁ + n C₂) / T_s,    the backbone: frames · b / T
    host        frames · t_h / T
    clocks      4 √λ √((C² + S b²) / 12) / limit

with C the longest frame of 8 bytes, C₁ and C₂ the call for the clocks every T_s and its answers, b a frame on the
backbone, S segments. A call waits at each bridge for the frame that is under way (uniform from 0 to b), and on its
segment (0 to C); the regression's weight λ = 1/30 of a new answer averages that. Four standard deviations count. Each
share is of what there is: above 1 it breaks, and what has the largest share breaks first.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import product
from math import ceil, sqrt
from typing import Any

import numpy as np

from rds.bus.medium.bits import INTERFRAME, frame_bits, longest
from rds.bus.modules.rds import frames
from rds.core.errors import InputError, RdsError
from rds.core.parallel import Scheduler, spread
from rds.core.quantities import Quantity
from rds.core.shared_quantities import SAMPLE_PERIOD
from rds.network.clocks import DECAY, ClockEstimate

NODES = Quantity("nodes of the plant", "", 1, 10**7, whole=True)
PER_SEGMENT = Quantity("nodes on a segment", "", 1, 95, whole=True)
BITRATE = Quantity("bit rate of the segments", "bit/s", 10_000, 1_000_000, whole=True)
BACKBONE = Quantity("bit rate of the backbone", "bit/s", 1e6, 1e11, default=100e6)
HANDLING = Quantity("of the host for one frame", "s", 1e-9, 1.0, default=5e-6)
LIMIT = Quantity("error of a clock that the plant can bear", "s", 1e-9, 1.0, default=50e-6)
MOST_SIMULATED = 10_000  # nodes; beyond, on paper
PARTS = ("bandwidth", "clocks", "host")
_PACKED = 84 * 8  # bits of the shortest Ethernet frame with preamble and gap
_SYNC = 1.0  # s between two calls for the clocks
_CALLS, _LEARNING = 240, 60
_CYCLES = 5


@dataclass(frozen=True)
class Plant:
    """What is asked about: numbers, bit/s, s. InputError for values that no plant has."""

    nodes: int
    per_segment: int
    bitrate: int
    period: float
    backbone: float = 100e6
    handling: float = 5e-6
    limit: float = 50e-6

    def __post_init__(self) -> None:
        NODES.check(self.nodes, "nodes")
        PER_SEGMENT.check(self.per_segment, "per_segment")
        BITRATE.check(self.bitrate, "bitrate")
        SAMPLE_PERIOD.check(self.period, "period")
        BACKBONE.check(self.backbone, "backbone")
        HANDLING.check(self.handling, "handling")
        LIMIT.check(self.limit, "limit")

    @property
    def segments(self) -> int:
        """How many segments there are."""
        return ceil(self.nodes / self.per_segment)

    @property
    def on_segment(self) -> int:
        """Nodes on the fullest segment."""
        return min(self.nodes, self.per_segment)

    @property
    def frames(self) -> int:
        """Commands and answers of all nodes in a period."""
        return self.nodes + self.segments * ceil(self.on_segment / frames.SLOTS)

    @property
    def packed(self) -> float:
        """A frame on the backbone, s."""
        return _PACKED / self.backbone


@dataclass(frozen=True)
class Shares:
    """How much is used of each of `PARTS`; `simulated` the same by simulation (None: on paper only)."""

    plant: Plant
    paper: tuple[float, ...]
    simulated: tuple[float, ...] | None

    @property
    def used(self) -> tuple[float, ...]:
        """The larger of both: paper bounds bandwidth and host, and estimates the clocks."""
        return self.paper if self.simulated is None else tuple(map(max, self.paper, self.simulated))

    @property
    def first(self) -> str:
        """What breaks first, or has."""
        return PARTS[int(np.argmax(self.used))]

    @property
    def holds(self) -> bool:
        """Whether nothing breaks."""
        return max(self.used) <= 1.0

    def to_json(self) -> dict[str, Any]:
        """Plain values for json.dumps."""
        plant = self.plant
        return {
            "nodes": plant.nodes,
            "per_segment": plant.per_segment,
            "bitrate": plant.bitrate,
            "period_s": plant.period,
            "paper": dict(zip(PARTS, self.paper, strict=True)),
            "simulated": None if self.simulated is None else dict(zip(PARTS, self.simulated, strict=True)),
            "first": self.first,
            "holds": self.holds,
        }


def on_paper(plant: Plant) -> tuple[float, ...]:
    """The shares of `PARTS` by the formulas above."""
    n, C = plant.on_segment, longest(8) / plant.bitrate
    clocks = (longest(1) + n * longest(8, extended=True)) / plant.bitrate / _SYNC
    segment = (ceil(n / frames.SLOTS) + n) * C / plant.period + clocks
    backbone = plant.frames * plant.packed / plant.period
    error = 4.0 * sqrt(DECAY * (C**2 + plant.segments * plant.packed**2) / 12.0)
    return max(segment, backbone), error / plant.limit, plant.frames * plant.handling / plant.period


def simulated(plant: Plant, seed: int = 0) -> tuple[float, ...]:
    """The shares of `PARTS`, of every segment with frames of random data, and of a clock; the worst of some cycles."""
    random = np.random.default_rng(seed)
    bits = np.array([frame_bits(0x123, random.bytes(8)).nominal + INTERFRAME for _ in range(500)])
    sizes = [plant.per_segment] * (plant.segments - 1)
    sizes.append(plant.nodes - sum(sizes))
    carried = [n + ceil(n / frames.SLOTS) for n in sizes]
    busy = max(float(random.choice(bits, count).sum()) for _ in range(_CYCLES) for count in carried) / plant.bitrate
    backbone = sum(carried) * plant.packed
    host = sum(carried) * plant.handling / plant.period
    return max(busy, backbone) / plant.period, _clocks(plant, random) / plant.limit, host


def _clocks(plant: Plant, random: np.random.Generator) -> float:
    """The largest error of the clock at the end of the chain, s, once it is learned; the constant way is known."""
    waits = random.uniform(0.0, longest(8) / plant.bitrate, (_CALLS, 2))
    hops = random.uniform(0.0, plant.packed, (_CALLS, 2, plant.segments)).sum(axis=2)
    estimate, worst, drift = ClockEstimate(), 0.0, 1.0 + 50e-6
    for k, (there, back) in enumerate((waits + hops).tolist()):
        sent = k * _SYNC
        estimate.take(sent, (sent + there) * drift, sent + there + back)
        if k >= _LEARNING:
            now = sent + 0.5 * _SYNC
            worst = max(worst, abs(estimate.at(now) - now * drift))
    return worst


def shares(plant: Plant) -> Shares:
    """Both, as far as the plant is small enough to be simulated."""
    return Shares(plant, on_paper(plant), simulated(plant) if plant.nodes <= MOST_SIMULATED else None)


def sweep(
    nodes: Iterable[int],
    per_segment: Iterable[int],
    bitrates: Iterable[int],
    periods: Iterable[float],
    *,
    jobs: int | None = None,
    scheduler: str | Scheduler | None = None,
    backbone: float = 100e6,
    handling: float = 5e-6,
    limit: float = 50e-6,
) -> Iterator[Shares]:
    """Every combination, on local processes or the workers of a dask scheduler; InputError for words that won't do."""
    kinds = product(nodes, per_segment, bitrates, periods)
    plants = [Plant(*each, backbone, handling, limit) for each in kinds]
    if not plants:
        raise InputError("there is nothing to sweep: give one number at least of each")
    for outcome in spread(shares, plants, jobs=jobs, scheduler=scheduler):
        if not outcome.ok:
            raise RdsError(f"{plants[outcome.index]}: {outcome.reason}")
        yield outcome.value


def most_nodes(plant: Plant) -> int:
    """The most nodes of such a plant that hold on paper; 0 if none does."""
    low, high = 0, int(NODES.high)
    while low < high:
        middle = (low + high + 1) // 2
        made = Plant(
            middle, plant.per_segment, plant.bitrate, plant.period, plant.backbone, plant.handling, plant.limit
        )
        low, high = (middle, high) if max(on_paper(made)) <= 1.0 else (low, middle - 1)
    return low
