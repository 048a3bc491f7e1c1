"""A unit that nobody knows is named with its column, beside those that are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rds.identification.logs.describe import Description, describe
from rds.identification.logs.units import dimension


def described(folder: Path, heading: str) -> Description:
    """A log of 200 rows of time, command and position under this heading."""
    t = np.arange(200) * 1e-3
    rows = (f"{a:.3f},{np.sin(30 * a):.4f},{np.cos(30 * a):.4f}" for a in t)
    path = folder / "log.csv"
    path.write_text("\n".join([heading, *rows]) + "\n", encoding="utf-8")
    return describe(path)


@pytest.mark.parametrize(
    ("heading", "column", "unit", "hint"),
    [
        ("time [s],u [V],x [furlong]", "x", "furlong", ""),
        ("time [s],u [V],x [MM]", "x", "MM", "did you mean 'mm'?"),
        ("time [s],u [V],position [Millimetre]", "position", "Millimetre", "did you mean 'mm'?"),
        ("time [s],u [Vdc],x [mm]", "u", "Vdc", ""),
        ("time [MSEC],u [V],x [mm]", "time", "MSEC", "did you mean 'ms'?"),
        ("time [s],u [V],angle [gon]", "angle", "gon", ""),
    ],
)
def test_an_unknown_unit_is_named(tmp_path: Path, heading: str, column: str, unit: str, hint: str) -> None:
    found = described(tmp_path, heading)
    (fault,) = [finding.what for finding in found.findings if finding.gravity == "fault"]
    assert repr(column) in fault and f"its unit {unit!r} is unknown (known units: " in fault
    assert hint in fault if hint else "did you mean" not in fault
    assert f"{unit!r} of {column!r}" in found.draft
    assert 'unit = "?"' in found.draft  # a draft that nobody corrects must not be taken for the truth


def test_a_column_that_is_not_used_for_its_unit_is_said(tmp_path: Path) -> None:
    t = np.arange(200) * 1e-3
    path = tmp_path / "log.csv"
    rows = (f"{a:.3f},{np.sin(30 * a):.4f},{np.cos(30 * a):.4f},1" for a in t)
    path.write_text("\n".join(["time [s],u [V],x [mm],speed [knots]", *rows]) + "\n", encoding="utf-8")
    assert any("'speed' is not used, as its unit 'knots' is unknown" in f.what for f in describe(path).findings)


def test_a_drive_s_torque_in_per_cent_may_be_the_command(tmp_path: Path) -> None:
    (fault,) = [f.what for f in described(tmp_path, "time [s],torque [%],x [mm]").findings if f.gravity == "fault"]
    assert "where torque [%] is the command, say so in a map" in fault


def test_spellings_that_mean_one_thing_are_known() -> None:
    for unit, of in {"mm/sec": "speed", "Sec": "time", "Mikrometer": "length", "millimeter": "length"}.items():
        assert dimension(unit) == of
    assert dimension("Grad") == "angle" and dimension("grad") is None
