"""Which tool, and whether in a rapid: of the samples of a run, by their place in the planned motion."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.planner import plan
from rds.machines import Machine
from rds.nc.path_block import PathBlock


def of_samples(blocks: Iterable[PathBlock], machine: Machine, sample: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The tool's number, and whether the move is a rapid, of each planned sample (n) of a program's motion."""
    blocks = list(blocks)
    tool = np.concatenate([np.zeros(0, int), *(np.full(len(block), block.tool) for block in blocks)])
    rapid = np.concatenate([np.zeros(0, bool), *(block.segments["rapid"] for block in blocks)])
    if not len(tool):
        return np.zeros(len(sample), int), np.zeros(len(sample), bool)
    planned = plan(blocks, Limits.of(machine), machine.sample_period, start=np.zeros(6))
    segment = np.concatenate([np.zeros(0, int), *(block.segment for block in planned)])
    of = segment[np.clip(sample, 0, len(segment) - 1)].clip(0, len(tool) - 1)
    return tool[of], rapid[of]
