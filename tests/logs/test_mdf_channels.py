"""Measurement files (MDF) without bus frames: channels as columns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rds.core import limits
from rds.core.errors import InputError
from rds.identification.logs import mf4_channels, tables
from rds.identification.logs.mf4_channels import rasters_here
from rds.identification.logs.read_log import read_log
from tests.logs.data_files import axis

asammdf = pytest.importorskip("asammdf")


@pytest.fixture(autouse=True)
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """The files are good or merely cut, and asammdf is imported once for all tests, not for each in a process apart."""
    monkeypatch.setattr(mf4_channels, "read_apart", lambda read, path: read(path))


def save(path: Path, *rasters: dict[str, tuple[np.ndarray, np.ndarray, str]], version: str = "4.10") -> Path:
    """An MDF file of these rasters: name to times (s), samples, unit."""
    with asammdf.MDF(version=version) as file:
        for raster in rasters:
            file.append([asammdf.Signal(y, t, name=name, unit=unit) for name, (t, y, unit) in raster.items()])
        return Path(file.save(path, overwrite=True))


@pytest.mark.parametrize(("ending", "version"), [(".mf4", "4.10"), (".mdf", "3.30"), (".dat", "3.30")])
def test_one_raster_is_a_table_that_explains_itself(tmp_path: Path, ending: str, version: str) -> None:
    made = axis()
    t = made["time"]
    raster = {"voltage": (t, made["voltage"], "V"), "position": (t, made["position"], "mm")}
    path = save(tmp_path / f"bench{'.mf4' if version > '4' else '.mdf'}", raster, version=version)
    (log,) = read_log(path.rename(path.with_suffix(ending)))
    assert np.array_equal(log.position, made["position"]) and np.array_equal(log.command, made["voltage"])
    assert np.allclose(log.time, t, atol=1e-12) and log.units["position"] == "mm"


def test_rasters_of_their_own_are_signals_with_times_of_their_own(tmp_path: Path) -> None:
    made = axis()
    t = made["time"]
    fast = {"position": (t, made["position"], "mm"), "temp": (t, t, "K")}
    slow = {"voltage": (t[::5], made["voltage"][::5], "V"), "temp": (t[::5], t[::5], "K")}
    path = save(tmp_path / "bench.mf4", fast, slow)
    assert set(tables.read_table(path).columns) == {"position", "voltage", "temp", "temp (2)"}
    (log,) = read_log(path)
    assert np.array_equal(log.command, made["voltage"][np.arange(len(log)) // 5 * 5])  # held from raster to raster
    assert any("of command the last received value is held" in f.what for f in log.findings)


def test_invalid_samples_are_blanks_and_texts_are_left_out(tmp_path: Path) -> None:
    t = np.arange(100) * 0.01
    bad = np.zeros(100, dtype=bool)
    bad[5] = True
    signals = [
        asammdf.Signal(np.arange(100), t, name="counts", unit="", invalidation_bits=bad),
        asammdf.Signal(np.array([b"on"] * 100), t, name="state", encoding="utf-8"),
    ]
    with asammdf.MDF(version="4.10") as file:
        file.append(signals)
        path = Path(file.save(tmp_path / "bench.mf4"))
    table = tables.read_table(path)
    assert np.flatnonzero(np.isnan(table.columns["counts"].values)).tolist() == [5]
    assert [f.what for f in table.findings] == ["left out, as they hold no real numbers: state"]


def test_cut_and_hollow_files_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    t = np.arange(2000) * 1e-3
    path = save(tmp_path / "bench.mf4", {"u": (t, np.sin(t), "V")})
    with monkeypatch.context() as small:
        small.setattr(limits, "UNPACKED", 800)
        with pytest.raises(InputError, match=r"takes 32000 bytes .* the limit is 800: .*LIMITS=40"):
            rasters_here(path)
    other = tmp_path / "other.mdf"
    other.write_bytes(b"something else")
    with pytest.raises(InputError, match=r"other\.mdf: it is no MDF file"):
        tables.read_table(other)
    whole = path.read_bytes()
    for end in (8, 64, 200, len(whole) // 2):
        path.write_bytes(whole[:end])
        with pytest.raises(InputError, match=r"bench\.mf4|cannot be read as MDF"):
            tables.read_table(path)
