"""Cells and lines that are no rows of numbers: the column and the row are named, and none is lost without a word."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.identification.logs.describe import describe
from rds.identification.logs.read_log import read_log
from rds.identification.logs.table import remedy
from tests.logs.data_files import axis, headed, write


@pytest.mark.parametrize(("row", "column"), [(0, 2), (150, 2), (150, 0), (199, 1)])
def test_a_word_among_the_numbers_is_named_with_its_column_and_row(tmp_path: Path, row: int, column: int) -> None:
    path = write(tmp_path / "log.csv", headed(axis(200)))
    lines = path.read_text().splitlines()
    cells = lines[row + 1].split(",")
    cells[column] = "mean"
    lines[row + 1] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n")
    what = ("time is 'time'", "command is 'voltage'", "position is 'position'")[column]
    with pytest.raises(InputError, match=f"{what}, as it seems, and holds 'mean' in data row {row + 1}"):
        read_log(path)


def test_cells_with_their_units_are_refused_with_where_units_belong(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("Time,u,pos\n" + "2024-03-01 12:00:00.000,2.0 V,0.5 mm\n" * 30)
    with pytest.raises(InputError, match=r"each cell has its unit in it: .* in the heading"):
        describe(tmp_path / "log.csv")


def test_the_end_mark_of_dos_is_no_cut_row(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", headed(axis(200)))
    path.write_bytes(path.read_bytes() + b"\x1a")
    (log,) = read_log(path)
    assert len(log) == 200 and not any(finding.kind == "cut" for finding in log.findings)


def test_quoted_decimal_commas_between_commas_are_numbers_where_the_map_says_so(tmp_path: Path) -> None:
    made = axis(400)
    path = tmp_path / "log.csv"
    rows = [",".join(f'"{v:.4f}"'.replace(".", ",") for v in row) for row in zip(*made.values(), strict=True)]
    path.write_text("\n".join([",".join(headed(made)), *rows]) + "\n")
    with pytest.raises(InputError, match='decimal = "comma" under'):
        read_log(path)  # "1,234" is also how many write 1234
    (tmp_path / "log.csv.map.toml").write_text(
        '[table]\ndecimal = "comma"\n[time]\ncolumn = "time"\n[axis.X]\ncommand = "voltage"\nposition = "position"\n'
    )
    (log,) = read_log(path)
    assert np.allclose(log.position, made["position"], atol=1e-9) and np.allclose(log.time, made["time"], atol=1e-9)


def test_a_form_feed_above_the_table_costs_no_row(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", headed(axis(200)))
    path.write_text("page 1\x0cof the recorder\n" + path.read_text())
    (log,) = read_log(path)
    assert len(log) == 200 and log.time[0] == 0.0


def test_lines_of_old_macs_are_refused_with_a_remedy(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", headed(axis(200)))
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r"))
    with pytest.raises(InputError, match="carriage return alone, as on old Macs; save it with line feeds"):
        describe(path)


def test_a_heading_that_would_command_the_terminal_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", headed(axis(200)))
    path.write_text(path.read_text().replace("voltage", "\x1b[31mvoltage"))
    with pytest.raises(InputError, match=r"column '\\x1b\[31mvoltage' has characters in its name"):
        describe(path)


@pytest.mark.parametrize(
    ("cell", "words"),
    [
        ("01.05.2024 12:00:00.000", "write dates as 2024-05-01 12:00:00.001"),
        ("05/01/2024 12:00:00 PM", "write dates as 2024-05-01 12:00:00.001"),
        ("-1,002", "if this comma parts the thousands, export the file without it"),
        ("1,5", 'if this is a decimal comma, say decimal = "comma"'),
        ("overflow", "repair it or choose another column"),
        ("20.0%", "a unit in each cell"),
        ("-1.5 mm/s", "a unit in each cell"),
        ("\u22122.0", "U+2212"),
        ("0x1F", "repair it or choose"),
    ],
)
def test_what_to_do_about_a_cell(cell: str, words: str) -> None:
    """A file of which a thousands separator were read as a decimal comma would be wrong by a factor of 1000."""
    assert words in remedy(cell)


@pytest.mark.parametrize(
    ("cell", "words"),
    [
        ("11:59:58.000 AM", "write times of day as 13:00:00.001"),
        ("11:59:58,000", "a point before the fraction"),
        ("0 days 00:00:01.5", "spans as s"),
        ("1.002,5", "export the file without a sign that parts the thousands"),
        ("1 002,5", "export the file without a sign that parts the thousands"),
        ("0.1995", "with the same decimal sign in every cell"),
        ("1'002.5", "export the file without a sign that parts the thousands"),
    ],
)
def test_times_of_day_and_thousands_of_other_countries_are_told_apart_from_words(cell: str, words: str) -> None:
    assert words in remedy(cell)


@pytest.mark.parametrize("cell", ["∞", "OVER", "OL", "ERR", "Bad", "--", "-1.#IND", "#DIV/0!", "-nan"])
def test_what_a_recorder_writes_beyond_its_range_is_a_blank_that_a_map_can_drop(tmp_path: Path, cell: str) -> None:
    path = write(tmp_path / "log.csv", headed(axis(400)))
    lines = path.read_text().splitlines()
    lines[400] = f"{lines[400].rpartition(',')[0]},{cell}"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match="position has no number in 1 of 400 samples, first in sample 399"):
        read_log(path)
    (tmp_path / "log.csv.map.toml").write_text(
        'blanks = "drop"\n[time]\ncolumn = "time"\n[axis.X]\ncommand = "voltage"\nposition = "position"\n'
    )
    assert len(read_log(path)[0]) == 399


def test_rows_of_one_message_each_hold_the_last_values_beside_a_position(tmp_path: Path) -> None:
    """As PlotJuggler writes a recording of ROS: no row has a command and a position."""
    path = tmp_path / "log.csv"
    rows = [f"{0.002 * k:.3f},,{k % 7}" for k in range(60)]
    rows[10::10] = [f"{row}\n{row.partition(',')[0]},{k},".replace(" ", "") for k, row in enumerate(rows[10::10], 1)]
    path.write_text("t,u,x\n" + "\n".join(rows) + "\n")
    text = '[time]\ncolumn = "t"\nunit = "s"\n[axis.X]\ncommand = { column = "u", unit = "V" }\n'
    text += 'position = { column = "x", unit = "mm" }\n'
    where = tmp_path / "log.csv.map.toml"
    for blanks in ("refuse", "drop"):
        where.write_text(f'blanks = "{blanks}"\n{text}')
        with pytest.raises(InputError, match='blanks = "hold" in the map holds the last values'):
            read_log(path)
    where.write_text(f'blanks = "hold"\n{text}')
    (log,) = read_log(path)
    assert log.time[0] == 0.022 and np.array_equal(log.position, np.arange(11, 60) % 7)
    assert np.array_equal(log.command, np.arange(10, 59) // 10)
    said = " ".join(finding.what for finding in log.findings)
    assert (
        "11 samples before the first command were left out" in said and "5 rows above" in said and "10 at most" in said
    )


def test_decimal_commas_between_commas_are_told(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows = (f"{t:.3f},{u:.1f},{x:.3f}".replace(".", "!") for t, u, x in zip(*axis(50).values(), strict=True))
    path.write_text("time [s],u [V],x [mm]\n" + "\n".join(rows).replace("!", ",") + "\n")
    with pytest.raises(InputError, match=r"3 names, and its rows have 6 cells: decimal commas .* semicolons between"):
        read_log(path)


@pytest.mark.parametrize("mark", [".", " "])
def test_thousands_between_semicolons_are_named_and_split_no_cell(tmp_path: Path, mark: str) -> None:
    path = tmp_path / "log.csv"
    rows = (f"{2 * k:,};3!0;{7 * k:,}!25".replace(",", mark).replace("!", ",") for k in range(1500))
    path.write_text("time [ms];voltage [V];position [mm]\n" + "\n".join(rows) + "\n")
    with pytest.raises(InputError, match="without a sign that parts the thousands"):
        read_log(path)


@pytest.mark.parametrize("row", [0, 100])
def test_a_heading_among_the_rows_is_where_another_table_begins(tmp_path: Path, row: int) -> None:
    path = write(tmp_path / "log.csv", headed(axis(200)))
    head, *rows = path.read_text().splitlines()
    path.write_text("\n".join([head, *rows[: row + 1], head, *rows[row + 1 :]]) + "\n")
    with pytest.raises(InputError, match=rf"data row {row + 2} holds words in every column .* file of its own"):
        read_log(path)
