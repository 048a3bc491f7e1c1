"""LabVIEW measurement files: with and without columns of times, several recordings, all that their heads say."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.identification.logs.read_log import read_log
from rds.identification.logs.tables import read_table

FILE_HEAD = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nMulti_Headings\tYes\nDate\t2024/03/02\n"
FILE_HEAD += "***End_of_Header***\t\n\t\n"
K = np.arange(40)
U, X = np.sin(0.3 * K), 0.5 * K


def head(places: Sequence[str], step: str = "1.000000E-3", samples: int = 40, time: str = "09:00:00,5") -> str:
    """The head of a recording of two channels, whose cells stand where `places` has `{}`."""
    row = "\t".join(places)
    rows = [f"Channels\t2{chr(9) * len(places)}"]
    rows += [f"{label}\t{row.replace('{}', value)}\t" for label, value in (("Samples", str(samples)), ("Time", time))]
    rows += [f"Y_Unit_Label\t{row.replace('{}', 'Volts', 1).replace('{}', 'mm', 1)}\t"]
    for label, value in (("Date", "2024/03/02"), ("X_Dimension", "Time"), ("X0", "0,0E+0"), ("Delta_X", step)):
        rows.append(f"{label}\t{row.replace('{}', value)}\t")
    return "\n".join([*rows, "***End_of_Header***\t\t\t"]) + "\n"


def saved(folder: Path, text: str) -> Path:
    path = folder / "a.lvm"
    path.write_text(FILE_HEAD + text, encoding="cp1252")
    return path


def without_times(step: str = "1.000000E-3", samples: int = 40, comment: str = "") -> str:
    rows = "".join(f"\t{u:.6f}\t{x:.6f}{comment}\n" for u, x in zip(U, X, strict=True))
    heading = "X_Value\tVoltage\tPosition\tComment\n"
    return head(("{}", "{}"), step, samples) + heading + rows.replace(".", ",")


def test_without_a_column_of_times_they_follow_from_the_head(tmp_path: Path) -> None:
    (log,) = read_log(saved(tmp_path, without_times()))
    assert np.allclose(log.time, 1e-3 * K) and log.units["command"] == "V" and log.units["position"] == "mm"
    assert np.allclose(log.command, U, atol=1e-6) and np.allclose(log.position, X)


def test_each_channel_may_have_times_and_samples_of_its_own(tmp_path: Path) -> None:
    rows = [f"{k / 1e3:.6f}\t{U[k]:.6f}\t" + (f"{k / 500:.6f}\t{X[k]:.6f}" if k < 20 else "") for k in K]
    heading = "X_Value\tVoltage\tX_Value\tPosition\tComment\n"
    table = read_table(saved(tmp_path, head(("{}", "", "{}")) + heading + "\n".join(rows) + "\n\n"))
    voltage, position = table.columns["Voltage"], table.columns["Position"]
    assert voltage.time is not None and np.allclose(voltage.time, 1e-3 * K) and voltage.unit == "Volts"
    assert position.time is not None and np.allclose(position.time, 2e-3 * K[:20]) and position.unit == "mm"


def test_recordings_one_after_another_are_joined_by_their_times_of_day(tmp_path: Path) -> None:
    heading = "X_Value\tVoltage\tPosition\tComment\n"
    rows = "".join(f"{k / 1e3:.6f}\t{U[k]:.6f}\t{X[k]:.6f}\tlost\n" for k in K)
    text = "\n".join(head(("{}", "{}"), time=f"09:00:{second}") + heading + rows for second in ("00,5", "02,25"))
    table = read_table(saved(tmp_path, text))
    assert np.allclose(table.columns["time"].values, np.r_[1e-3 * K, 1.75 + 1e-3 * K])
    assert any("comments beside 80 rows" in finding.what for finding in table.findings)
    cut = text.splitlines(keepends=True)[:-5]
    assert any(
        "announce 80 samples, and there are 75" in f.what for f in read_table(saved(tmp_path, "".join(cut))).findings
    )
    with pytest.raises(InputError, match=r"unit of Position has changed \(mm before, m here\)"):
        read_table(saved(tmp_path, text + head(("{}", "{}")).replace("mm", "m") + heading + rows))
    with pytest.raises(InputError, match=r"other channels.*file of its own"):
        read_table(saved(tmp_path, text + text.replace("Position", "Speed")))


@pytest.mark.parametrize(("step", "warned"), [("0.000977", True), ("0.001000", False), ("9.765625E-4", False)])
def test_a_rounded_step_is_warned_of(step: str, warned: bool, tmp_path: Path) -> None:
    table = read_table(saved(tmp_path, without_times(step)))
    assert any("0.051 % off" in f.what and "1024 Hz" in f.what for f in table.findings) == warned


def test_what_is_cut_or_damaged_is_told(tmp_path: Path) -> None:
    table = read_table(saved(tmp_path, without_times(samples=80)))
    assert any("announces 80 samples, and there are 40" in finding.what for finding in table.findings)
    for wrong in ("0,5?", "1_5"):
        with pytest.raises(InputError, match=re.escape(f"{wrong!r} is no number")):
            read_table(saved(tmp_path, without_times() + f"\t{wrong}\t1\n"))
    table = read_table(saved(tmp_path, without_times()[:-5]))  # of 19,500000
    assert any("its last line has no end" in f.what for f in table.findings)
    assert len(table.columns["Position"].values) == 39 and table.columns["Position"].values[-1] == 19.0
    with pytest.raises(InputError, match="no line of Channels"):
        read_table(saved(tmp_path, without_times().replace("Channels", "Channel")))
    with pytest.raises(InputError, match="no samples"):
        read_table(saved(tmp_path, head(("{}", "{}"))))


def test_decimal_commas_between_commas_are_refused_and_no_comments(tmp_path: Path) -> None:
    text = (FILE_HEAD.replace("Tab", "Comma") + without_times(comment="\t")).replace(",", ".").replace("\t", ",")
    path = tmp_path / "a.lvm"
    path.write_text("\n".join(text.splitlines()[:-1]) + "\n,1,2,7\n")
    assert np.allclose(read_table(path).columns["Position"].values, [*X[:-1], 2.0])
    rows = text.index("Comment\n") + len("Comment\n")
    path.write_text(text[:rows] + text[rows:].replace(".", ","))
    with pytest.raises(InputError, match="record it with Tab between cells"):
        read_table(path)
