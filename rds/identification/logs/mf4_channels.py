"""The channels of an MDF file that holds measurements and no bus frames, as recorders of test benches write them.

Channels that share one raster are columns beside a column `time`. With more rasters than one each column has times of
its own. Needs asammdf, which opens the file in a process of its own (`apart.py`).
"""

from __future__ import annotations

import logging
import mmap
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rds.bus.tools.mf4 import asammdf_missing, close_unopened
from rds.core.errors import InputError
from rds.core.limits import allow_unpacked
from rds.core.parallel.reader_process import read_apart
from rds.identification.logs.log import Finding
from rds.identification.logs.table import Column, Table

_FRAMES = (b"CAN_DataFrame", b"CAN_RemoteFrame", b"CAN_ErrorFrame")  # channels of a bus log
_TIME = "time"


class Raster(NamedTuple):
    """Channels measured at the same instants: `time` in s; name, unit and values of each."""

    time: np.ndarray
    channels: list[tuple[str, str, np.ndarray]]


def is_measurement(path: Path) -> bool:
    """Whether it is an MDF file, of any version, without bus frames."""
    with open(path, "rb") as stream:
        if stream.read(8) not in (b"MDF     ", b"UnFinMF "):
            return False
        with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as content:
            return all(content.find(name) < 0 for name in _FRAMES)


def read_channels(path: Path) -> Table:
    """The numeric channels. InputError for a file without any, a damaged one, one that is too large, or no asammdf."""
    if find_spec("asammdf") is None:
        raise asammdf_missing(path)
    rasters, left_out = read_apart(rasters_here, path)
    if not rasters:
        raise InputError("it holds no channels of numbers; measure time, command and position", str(path))
    findings = []
    if left_out:
        findings.append(Finding("columns", f"left out, as they hold no real numbers: {', '.join(left_out)}"))
    taken: set[str] = {_TIME} if len(rasters) == 1 else set()
    columns: dict[str, Column] = {}
    if len(rasters) == 1:
        columns[_TIME] = Column(_TIME, "s", rasters[0].time)
    for number, raster in enumerate(rasters, 1):
        for name, unit, values in raster.channels:
            free = _free(name, number, taken)
            columns[free] = Column(free, unit or None, values, raster.time if len(rasters) > 1 else None)
    return Table(path, "mdf", columns, findings=tuple(findings))


def _free(name: str, raster: int, taken: set[str]) -> str:
    """The name, with the raster's number where another channel has it, and counted on where that has been taken."""
    free, more = name, 1
    while free in taken:
        free, more = f"{name} ({raster})" if more == 1 else f"{name} ({raster}, {more})", more + 1
    taken.add(free)
    return free


def rasters_here(path: Path) -> tuple[list[Raster], list[str]]:
    """The rasters, those of the same times as one, and the names of channels without numbers; in this process."""
    logging.disable(logging.CRITICAL)  # what asammdf says goes to nobody's log
    try:
        from asammdf import MDF

        with MDF(path) as file:
            groups = [group.channel_group.cycles_nr * max(len(group.channels), 1) for group in file.groups]
            allow_unpacked(8 * sum(groups), path.stat().st_size)
            return _rasters(file)
    except (InputError, MemoryError):
        raise
    except Exception as error:  # asammdf raises whatever its decoder trips over
        close_unopened(error)
        reason = str(error) or type(error).__name__
        raise InputError(f"it cannot be read as MDF, or is damaged ({reason:.200}); take another copy") from error
    finally:
        logging.disable(logging.NOTSET)


def _rasters(file: Any) -> tuple[list[Raster], list[str]]:
    rasters: list[Raster] = []
    left_out: list[str] = []
    for number, group in enumerate(file.groups):
        master = file.masters_db.get(number)
        for index, channel in enumerate(group.channels):
            if index == master:
                continue
            signal = file.get(group=number, index=index, ignore_invalidation_bits=True)
            values, time = np.asarray(signal.samples), np.asarray(signal.timestamps, dtype=np.float64)
            if values.ndim != 1 or values.dtype.kind not in "fiub" or len(values) < 2 or master is None:
                left_out.append(str(channel.name))
                continue
            numbers = values.astype(np.float64)
            if signal.invalidation_bits is not None:
                numbers[np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan
            entry = (str(channel.name), str(signal.unit or ""), numbers)
            same = next((raster for raster in rasters if np.array_equal(raster.time, time)), None)
            if same is None:
                rasters.append(Raster(time, [entry]))
            else:
                same.channels.append(entry)
    return rasters, left_out
