"""The thesis's readings as they come with the package: whole, as printed, and with the numbers of the document."""

from __future__ import annotations

import csv
import json

import pytest
from thesis_data import (
    COUNTS_A,
    COUNTS_X,
    COUNTS_Z,
    CURRENT_A,
    CURRENT_X,
    CURRENT_Z,
    DRILL_IDLE,
    DRILLING,
    MOVE_TIMES,
    RECONFIGURATION,
    VIBRATION_20MM,
)
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.results.reports import make_report
from rds.results.reports.oacs import TITLES, data_file

PRINTED = {
    "M28": {name: values for name, values in RECONFIGURATION.items() if name.startswith("familiar")},
    "M29": {name: values for name, values in RECONFIGURATION.items() if name.startswith("new")},
    "O32": COUNTS_X,
    "O33": COUNTS_Z,
    "O34": COUNTS_A,
    "O35": MOVE_TIMES,
    "P37": VIBRATION_20MM,
    "Q39": CURRENT_A,
    "Q40": CURRENT_X,
    "Q41": CURRENT_Z,
    "Q42": DRILL_IDLE,
    "Q43": DRILLING,
}


def columns(table: str) -> dict[str, list[float]]:
    with data_file(f"oacs:{table}").open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: [float(row[name]) for row in rows] for name in rows[0] if name not in ("reading", "iteration")}


@pytest.mark.parametrize("table", list(PRINTED))
def test_its_tables_are_as_printed(table: str) -> None:
    assert columns(table) == PRINTED[table]


@pytest.mark.parametrize(
    ("table", "readings", "rms", "peak"),
    [
        ("P36", 56, [0.036, 0.030, 0.051], [0.156, 0.156, 0.381]),
        ("P37", 162, [0.097, 0.075, 0.163], [0.752, 0.557, 1.133]),
        ("P38", 255, [0.155, 0.198, 0.195], [1.006, 1.367, 1.328]),
    ],
)
def test_vibration_in_numbers(table: str, readings: int, rms: list[float], peak: list[float]) -> None:
    found = make_report("vibration", [f"oacs:{table}"]).table("Acceleration")
    assert all(len(values) == readings for values in columns(table).values())
    assert found.column("RMS about mean [g]") == pytest.approx(rms, abs=5e-4)
    assert found.column("peak to peak [g]") == pytest.approx(peak, abs=5e-4)


def test_extremes_of_table_19_are_those_of_p38() -> None:
    readings = columns("P38")
    assert [max(readings[f"{axis}_adc"]) for axis in "xyz"] == [481, 566, 558]
    assert [min(readings[f"{axis}_adc"]) for axis in "xyz"] == [378, 426, 422]


def test_accuracy_needs_no_options_for_them() -> None:
    ran = CliRunner().invoke(app, ["report", "accuracy", "oacs:O32", "oacs:O33", "oacs:O34", "--json"])
    assert ran.exit_code == 0, ran.output
    said = " ".join(json.loads(ran.stdout)["findings"])
    assert json.loads(ran.stdout)["sources"] == ["O32.csv", "O33.csv", "O34.csv"]
    tables = json.loads(ran.stdout)["tables"]
    expected = [row[list(t["columns"]).index("expected [counts]")] for t in tables for row in t["rows"]
                if "expected [counts]" in t["columns"]]  # fmt: skip
    assert sorted(set(expected)) == [8450, 11385, 13520], said


def test_a_table_that_is_none_is_refused_with_those_there_are() -> None:
    with pytest.raises(
        InputError, match=r"oacs:Q44 is no table .* there are oacs:M28, .*oacs:Q43; did you mean 'oacs:Q4"
    ):
        make_report("current", ["oacs:Q44"])
    assert all(data_file(f"oacs:{table}").is_file() for table in TITLES)
