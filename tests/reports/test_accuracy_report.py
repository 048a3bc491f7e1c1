"""Tables 15 to 17 of the thesis from its own counts; where it prints something else, what the counts say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from thesis_data import COUNTS_A, COUNTS_X, COUNTS_Z, save

from rds.core.errors import InputError
from rds.results.reports import Report, make_report
from rds.results.reports.accuracy import Moves, report_on

ABOUT = """
[x]
name = "X"
distance = 80
counts_per_unit = 169
accuracy = 1.0
repeatability = 0.5
[z]
name = "Z"
distance = 50
counts_per_unit = 169
accuracy = 1.0
repeatability = 0.5
[a]
name = "A"
unit = "deg"
distance = 345
counts_per_unit = 33
accuracy = 1.5
repeatability = 1.0
"""


@pytest.fixture
def report(tmp_path: Path) -> Report:
    about = tmp_path / "moves.toml"
    about.write_text(ABOUT)
    tables = {"x": COUNTS_X, "z": COUNTS_Z, "a": COUNTS_A}
    files = [save(tmp_path / f"{name}.csv", table) for name, table in tables.items()]
    return make_report("accuracy", files, {"about": str(about)})


def cell(report: Report, table: str, axis: str, way: str, heading: str) -> Any:
    found = report.table(table)
    row = next(row for row in found.rows if row[:2] == [axis, way])
    return row[list(found.columns).index(heading)]


@pytest.mark.parametrize(
    ("axis", "way", "smallest", "largest"),
    [
        ("X", "cw", 0.36, None),
        ("X", "ccw", 0.13, None),
        ("Z", "cw", None, 1.97),
        ("A", "cw", None, 0.21),
    ],
)
def test_variations_that_agree(report: Report, axis: str, way: str, smallest: Any, largest: Any) -> None:
    table = f"Repeatability [{'deg' if axis == 'A' else 'mm'}]"
    for printed, what in ((smallest, "smallest"), (largest, "largest")):
        if printed is not None:
            assert round(cell(report, table, axis, way, f"{what}: variation [%]"), 2) == printed


@pytest.mark.parametrize(
    ("axis", "way", "ours", "printed"),
    [
        ("X", "cw", 13532.0, 13533),
        ("X", "ccw", 13536.0, 13537),
        ("Z", "cw", 8438.6, 8438),
        ("Z", "ccw", 8456.8, 8456),
    ],
)
def test_averages_that_the_thesis_prints_otherwise(
    report: Report, axis: str, way: str, ours: float, printed: int
) -> None:
    mean = cell(report, "Repeatability [mm]", axis, way, "average [counts]")
    assert mean == pytest.approx(ours)
    assert round(mean) != printed


def test_averages_of_a_agree(report: Report) -> None:
    found = [cell(report, "Repeatability [deg]", "A", way, "average [counts]") for way in ("cw", "ccw")]
    assert [round(mean) for mean in found] == [11409, 11393]


@pytest.mark.parametrize(
    ("axis", "way", "what", "ours", "printed"),
    [
        ("X", "cw", "largest", 0.44, 0.42),
        ("X", "ccw", "largest", 0.22, 0.21),
        ("Z", "cw", "smallest", 2.13, 1.07),
        ("Z", "ccw", "smallest", 0.97, 0.82),
        ("A", "cw", "smallest", 0.42, 0.41),
        ("A", "ccw", "smallest", 0.30, 0.29),
        ("A", "ccw", "largest", 0.30, 0.31),
    ],
)
def test_variations_that_the_thesis_prints_otherwise(
    report: Report, axis: str, way: str, what: str, ours: float, printed: float
) -> None:
    table = f"Repeatability [{'deg' if axis == 'A' else 'mm'}]"
    found = round(cell(report, table, axis, way, f"{what}: variation [%]"), 2)
    assert found == ours != printed


@pytest.mark.parametrize(
    ("axis", "way", "low", "low_unit", "high", "high_unit"),
    [
        ("X", "cw", 37, "0.22", 71, "0.42"),
        ("X", "ccw", 1, "0.01", 46, "0.27"),
        ("Z", "cw", 191, "1.13", 155, "0.92"),
        ("Z", "ccw", 75, "0.44", 79, "0.47"),
        # printed: 22 and 0.69 for the 23 counts of cw, 0.78 for the 26 of ccw
        ("A", "cw", 23, "0.70", 48, "1.45"),
        ("A", "ccw", 26, "0.79", 43, "1.30"),
    ],
)
def test_differences_of_tables_16_and_17(
    report: Report, axis: str, way: str, low: int, low_unit: str, high: int, high_unit: str
) -> None:
    unit = "deg" if axis == "A" else "mm"
    found = [
        cell(report, f"Accuracy [{unit}]", axis, way, f"{what} − expected [{kind}]")
        for what in ("smallest", "largest")
        for kind in ("counts", unit)
    ]
    assert (-found[0], found[2]) == (low, high)
    assert (f"{-found[1]:.2f}", f"{found[3]:.2f}") == (low_unit, high_unit)


def test_the_expected_count_of_z_is_8450_where_table_16_prints_8540(report: Report) -> None:
    expected = {axis: cell(report, "Accuracy [mm]", axis, "cw", "expected [counts]") for axis in "XZ"}
    assert expected == {"X": 13520, "Z": 8450}
    assert cell(report, "Accuracy [deg]", "A", "cw", "expected [counts]") == 11385


def test_findings_judge_against_table_14(report: Report) -> None:
    said = " ".join(report.findings)
    assert "Z: 9 of 10 moves end within 1 mm of the command." in said
    assert "X: 12 of 12 moves" in said
    assert "Z cw: at most 1.06 mm from the average of 8438.6 counts (misses ±0.5 mm)" in said
    assert "A cw: at most 1.44 deg from the average of 11409.4 counts (misses ±1 deg)" in said


def test_a_misses_its_accuracy_with_the_counts_per_degree_of_its_resolution() -> None:
    """0.03 degrees per count are 33.3 counts per degree; rounded down to 33, every move passes, else none does."""
    ends = {"cw": COUNTS_A["cw_counts"], "ccw": COUNTS_A["ccw_counts"]}
    assert Moves("A", "deg", 345, 33, ends, accuracy=1.5).inaccurate() == 0
    assert Moves("A", "deg", 345, 1 / 0.03, ends, accuracy=1.5).inaccurate() == 10


def test_a_toml_file_beside_the_data_and_options_over_it(tmp_path: Path) -> None:
    data = save(tmp_path / "x.csv", COUNTS_X)
    (tmp_path / "x.toml").write_text("distance = 80.0\ncounts_per_unit = 169\n")
    assert make_report("accuracy", [data]).tables[1].column("expected [counts]") == [13520, 13520]
    made = make_report("accuracy", [data], {"counts_per_unit": "170", "unit": "deg"})
    assert made.tables[1].column("expected [counts]") == [13600, 13600]
    assert made.tables[1].title == "Accuracy [deg]"


def test_data_in_mm_and_moves_of_our_own_modules_give_the_same(tmp_path: Path) -> None:
    data = save(tmp_path / "y.csv", {"there_mm": [10.1, 9.9], "back_mm": [10.0, 10.2]})
    options = {"distance": 10, "counts_per_unit": 1000}
    read = make_report("accuracy", [data], options)
    made = report_on([Moves("y", "mm", 10, 1000, {"there": [10100, 9900], "back": [10000, 10200]})])
    for ours, theirs in zip(read.tables, made.tables, strict=True):
        for row, other in zip(ours.rows, theirs.rows, strict=True):
            assert row[:2] == other[:2]
            assert row[2:] == pytest.approx(other[2:])


def test_a_file_of_which_the_table_about_it_says_nothing_names_that_table(tmp_path: Path) -> None:
    about = tmp_path / "moves.toml"
    about.write_text("[z]\ndistance = 80.0\ncounts_per_unit = 169\n")
    with pytest.raises(InputError, match=r"give the options, or give .*moves\.toml a table \[x\] with lines such as"):
        make_report("accuracy", [save(tmp_path / "x.csv", COUNTS_X)], {"about": str(about)})
