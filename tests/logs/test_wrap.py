"""Positions of a counter that begins again: found, and made to go on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.identification.logs.log import Gravity, Log
from rds.identification.logs.read_log import read_log
from tests.logs.data_files import axis, write

MAP = """
[time]
column = "time"
unit = "s"
[axis.X]
command = {{ column = "voltage", unit = "V" }}
{which} = {{ column = "counts", unit = "counts"{wrap} }}
resolution = 1e-4
"""


def counted(tmp_path: Path, period: float, wrap: str) -> tuple[Log, np.ndarray]:
    """The log of an axis behind a counter of this period, and its true position in mm."""
    made = axis()
    counts = np.round(made["position"] * 1e4) - 700.0
    path = write(tmp_path / "log.csv", {"time": made["time"], "voltage": made["voltage"], "counts": counts % period})
    (tmp_path / "log.csv.map.toml").write_text(MAP.format(which="position", wrap=wrap))
    (log,) = read_log(path)
    return log, counts * 1e-4


def test_a_wrap_is_a_fault_that_names_the_remedy(tmp_path: Path) -> None:
    log, true = counted(tmp_path, 4096.0, "")
    leaps = np.flatnonzero(np.diff(np.floor(true / 0.4096)))
    (fault,) = [finding for finding in log.findings if finding.gravity is Gravity.FAULT]
    assert fault.kind == "wrap" and fault.sample == leaps[0] + 1
    assert "the position leaps by 0.4" in fault.what and f"{len(leaps)} times" in fault.what
    assert "wrap = 65536" in fault.what


def test_with_wrap_it_goes_on(tmp_path: Path) -> None:
    log, true = counted(tmp_path, 4096.0, ", wrap = 4096")
    assert np.allclose(np.diff(log.position), np.diff(true), atol=1e-9)
    assert not [finding for finding in log.findings if finding.kind == "wrap"]


def test_steps_that_may_be_of_either_way_are_a_fault(tmp_path: Path) -> None:
    log, _ = counted(tmp_path, 120.0, ", wrap = 120")
    (fault,) = [finding for finding in log.findings if finding.kind == "wrap"]
    assert fault.gravity is Gravity.FAULT and "which way it went is a guess" in fault.what


def test_wrap_is_for_what_a_counter_counts(tmp_path: Path) -> None:
    made = axis()
    path = write(tmp_path / "log.csv", {"time": made["time"], "voltage": made["voltage"], "counts": made["position"]})
    text = MAP.format(which="position", wrap="").replace('unit = "V"', 'unit = "V", wrap = 10')
    (tmp_path / "log.csv.map.toml").write_text(text)
    with pytest.raises(InputError, match="wrap = 10 is for position and reference"):
        read_log(path)


def test_a_time_that_begins_again_goes_on(tmp_path: Path) -> None:
    made = axis()
    ticks = np.arange(len(made["time"])) + 65_000
    path = write(tmp_path / "log.csv", made | {"time": ticks % 65_536})
    text = MAP.format(which="position", wrap="").replace('"s"', '"ms"{time}')
    text = text.replace('"counts", unit = "counts"', '"position", unit = "mm"').replace("resolution = 1e-4\n", "")
    (tmp_path / "log.csv.map.toml").write_text(text.replace("{time}", ""))
    with pytest.raises(InputError, match=r"time goes back at sample 536.*wrap = 65536 under \[time\]"):
        read_log(path)
    (tmp_path / "log.csv.map.toml").write_text(text.replace("{time}", "\nwrap = 65536"))
    (log,) = read_log(path)
    assert np.allclose(log.time, ticks * 1e-3) and log.sample_period == pytest.approx(1e-3)
