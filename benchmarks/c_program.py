"""axis.c, compiled and run: the same arithmetic in C."""

from __future__ import annotations

import subprocess
from pathlib import Path
from statistics import median

import numpy as np

from benchmarks.axis import constants
from rds.modes.loop.plan import Plan

# Without -ffp-contract=off some processors fuse a·b + c into one rounding: no longer the same arithmetic.
FLAGS = ("-O2", "-ffp-contract=off")
SOURCE = Path(__file__).with_name("axis.c")


class CProgram:
    """The simulation of a plan's first axis in C, built in `folder`; OSError or CalledProcessError without gcc."""

    def __init__(self, plan: Plan, folder: Path):
        self._program = folder / "axis"
        subprocess.run(["gcc", *FLAGS, str(SOURCE), "-o", str(self._program), "-lm"], check=True)
        reference = plan.axes[0].reference
        assert reference is not None
        parts = (constants(plan), reference.position, reference.velocity, reference.acceleration)
        self._input = b"".join(np.asarray(part, dtype=float).tobytes() for part in parts)
        self._samples = plan.samples

    def run(self, repeats: int) -> tuple[float, np.ndarray]:
        """The median time in s, and the table: the columns of our own simulation."""
        command = [str(self._program), str(self._samples), str(repeats)]
        output = subprocess.run(command, input=self._input, stdout=subprocess.PIPE, check=True).stdout
        numbers = np.frombuffer(output)
        return median(numbers[:repeats]) * 1e-9, numbers[repeats:].reshape(self._samples, -1)


def version() -> str:
    """The compiler and its flags."""
    first = subprocess.run(["gcc", "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
    return f"{first} {' '.join(FLAGS)}"
