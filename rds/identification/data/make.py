"""Makes the logs of this folder anew: `python -m rds.identification.data.make [FOLDER]`, some 25 s in real time.

Two runs of the mini CNC's axes and spindle in system test mode, 10 s at 1 kHz: "steps" of random height and length, to
fit, and "sines", to validate with. The machine is the one behind the bus, with friction, play and delay, so nobody's
model is exact. The voltages are the same every time; what the machine answers depends on when its frames came.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import rds
from rds.core.atomic import write_whole
from rds.modes import SYSTEM_TEST
from rds.results.files import save_result
from rds.results.result import Result

SUMS = "SHA256SUMS"
DURATION = 10.0  # s
AXES = {"X": (6.0, 1), "Y": (6.0, 2), "Z": (6.0, 3), "spindle": (9.0, 4)}  # largest voltage, seed
FREQUENCIES = (0.4, 1.1, 2.9, 7.3)  # Hz
KEPT = (
    *("mode", "machine", "axes", "sample_period", "duration", "voltage_range"),
    *("ending", "verdict", "started", "versions"),
)
TRIES = 20  # for a run without a late sample


def make(folder: Path) -> list[Path]:
    """Run the machine and write a file for each axis and run, and their SHA-256. Returns the files."""
    results = {
        signal.__name__: _run({axis: {"signal": rds.user(function=signal(*of))} for axis, of in AXES.items()})
        for signal in (steps, sines)
    }
    written = []
    for name, result in results.items():
        written += [_saved(result, axis, folder / f"mini-cnc-{axis}-{name}.parquet") for axis in AXES]
    sums = "".join(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in written)
    write_whole(folder / SUMS, sums.encode())
    return written


def _run(overrides: dict[str, Any]) -> Result:
    """A system test in which every sample was taken in time."""
    experiment = rds.Experiment(axis=tuple(AXES), mode=SYSTEM_TEST, duration=DURATION, overrides=overrides)
    for _ in range(TRIES):
        result = experiment.run()
        if result.meta["ending"] == "done" and result.verdict == "met":
            return result
    raise rds.MachineError(f"of {TRIES} runs, none was in time; repeat it on a quieter computer")


def steps(largest: float, seed: int) -> Callable[[float], float]:
    """Voltages up to ±`largest`, each held for 0.05 to 0.4 s; the last half second is 0 V."""
    generator = np.random.default_rng(seed)
    ends = np.cumsum(generator.uniform(0.05, 0.4, 400))
    levels = np.round(generator.uniform(-largest, largest, 400), 2)
    return lambda t: float(levels[np.searchsorted(ends, t, side="right")]) if t < DURATION - 0.5 else 0.0


def sines(largest: float, seed: int) -> Callable[[float], float]:
    """A sum of sines of random phase that stays within ±`largest` V."""
    phases = np.random.default_rng(100 + seed).uniform(0.0, 2.0 * np.pi, len(FREQUENCIES))
    share = largest / len(FREQUENCIES)
    return lambda t: float(share * np.sin(2.0 * np.pi * np.array(FREQUENCIES) * t + phases).sum())


def _saved(result: Result, axis: str, path: Path) -> Path:
    from pyarrow import parquet

    names = ["time", f"{axis}_voltage", f"{axis}_measured"]
    meta = {key: result.meta[key] for key in KEPT if key in result.meta} | {"axes": [axis]}
    columns = {name: np.asarray(result[name]) for name in names}
    save_result(Result(columns, {name: result.units[name] for name in names}, meta), path)
    table = parquet.read_table(path)  # smaller, as it travels with the package
    parquet.write_table(
        table, path, compression="zstd", compression_level=19, use_dictionary=False, use_byte_stream_split=True
    )
    return path


if __name__ == "__main__":
    make(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
