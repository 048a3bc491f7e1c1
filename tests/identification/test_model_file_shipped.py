"""The logs that come with the package: whole, checked, and good to identify from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.identification.data.make import AXES, DURATION, sines, steps
from rds.identification.logs import shipped


def test_there_are_two_of_each_axis_and_they_are_small() -> None:
    assert shipped.names() == sorted(f"mini-cnc-{axis}-{kind}" for axis in AXES for kind in ("steps", "sines"))
    assert sum(shipped.path(name).stat().st_size for name in shipped.names()) < 1_000_000


@pytest.mark.parametrize("name", shipped.names())
def test_each_is_ten_seconds_of_an_axis_that_moves(name: str) -> None:
    log = shipped.log(name)
    assert len(log) == round(DURATION / 0.001) and log.sample_period == pytest.approx(0.001)
    assert log.closed_loop is False and log.voltage_range == (-10.0, 10.0)
    assert log.resolution == (1.0 if "spindle" in name else 0.001)
    assert np.ptp(log.position) > 1000.0 * log.resolution and 4.0 < np.abs(log.command).max() < 9.1
    assert log.sha256 and not [f.what for f in log.findings if f.kind == "gap"]


@pytest.mark.parametrize("kind", [steps, sines])
def test_the_voltages_are_those_that_the_script_says(kind: object) -> None:
    largest, seed = AXES["X"]
    signal = kind(largest, seed)  # type: ignore[operator]
    log = shipped.log(f"mini-cnc-X-{kind.__name__}")  # type: ignore[attr-defined]
    given = np.array([signal(t) for t in log.time])
    later = log.command[1:] - given[:-1]  # what acts in a sample was commanded in the one before
    assert np.abs(later).max() <= 0.5 * 20.0 / 2**12 + 1e-9  # half a level of the converter


def test_damage_and_unknown_names_are_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no shipped log 'lathe'"):
        shipped.log("lathe")
    for file in shipped.path("mini-cnc-X-steps").parent.glob("*[mM]*"):
        if file.is_file():
            (tmp_path / file.name).write_bytes(file.read_bytes() + b"!" * file.name.endswith("X-steps.parquet"))
    (tmp_path / "SHA256SUMS").write_bytes((shipped.path("mini-cnc-X-sines").parent / "SHA256SUMS").read_bytes())
    monkeypatch.setattr(shipped, "files", lambda package: tmp_path)
    assert len(shipped.log("mini-cnc-X-sines")) == 10_000
    with pytest.raises(InputError, match="is not what was shipped"):
        shipped.log("mini-cnc-X-steps")
