"""Flatness of a face: hand calculations, and a tilt that is not counted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rds.results.reports import make_report


def face(tmp_path: Path, z: np.ndarray) -> Path:
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(5) * 10.0, np.arange(4) * 10.0))
    rows = [f"{a},{b},{c!r}" for a, b, c in zip(x, y, z.ravel().tolist(), strict=True)]
    path = tmp_path / "face.csv"
    path.write_text("\n".join(["x_mm,y_mm,z_mm", *rows]) + "\n")
    return path


def test_a_tilted_plane_is_flat(tmp_path: Path) -> None:
    x, y = np.meshgrid(np.arange(5) * 10.0, np.arange(4) * 10.0)
    table = make_report("flatness", [face(tmp_path, 16.5 + 0.002 * x - 0.001 * y)]).table("Flatness")
    assert table.column("flatness [mm]") == pytest.approx([0.0], abs=1e-12)
    assert table.column("largest relative error [mm]") == pytest.approx([0.11])
    assert table.column("slope in x [mm/m]") == pytest.approx([2.0])


def test_waves_are_counted_whole(tmp_path: Path) -> None:
    waves = np.array([[0.0, 0.1, 0.0, 0.1, 0.0]] * 4)
    report = make_report("flatness", [face(tmp_path, waves)], {"tolerance": 0.05})
    assert report.table("Flatness").column("flatness [mm]") == pytest.approx([0.1])
    assert report.table("Flatness").column("std [mm]") == pytest.approx([float(waves.std(ddof=1))])
    assert report.findings == [
        "face: largest relative error 0.100 mm, flatness 0.100 mm, more than the 0.05 mm allowed."
    ]
