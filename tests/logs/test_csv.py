"""Text tables: every layout gives the same numbers, and every damage its sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.identification.logs.csv_table import read_csv
from rds.identification.logs.read_log import read_log
from tests.logs.data_files import axis, headed, write

LAYOUTS = [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), ("|", "."), (" ", ".")]


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    values=st.lists(st.tuples(*[st.floats(-1e6, 1e6)] * 3), min_size=3, max_size=30),
    layout=st.sampled_from(LAYOUTS),
    mark=st.booleans(),
    remark=st.booleans(),
    units=st.booleans(),
    end=st.sampled_from(["\n", "\r\n"]),
)
def test_every_layout_gives_the_numbers_back(
    tmp_path: Path,
    values: list[tuple[float, ...]],
    layout: tuple[str, str],
    mark: bool,
    remark: bool,
    units: bool,
    end: str,
) -> None:
    delimiter, decimal = layout
    lines = ["# recorder: A", "# channel 1; 2, 3"] if remark else []
    lines.append(delimiter.join(("time", "command", "position")))
    if units:
        lines.append(delimiter.join(("[ms]", "[V]", "[mm]")))
    lines += [delimiter.join(repr(v).replace(".", decimal) for v in row) for row in values]
    path = tmp_path / "log.csv"
    path.write_bytes((b"\xef\xbb\xbf" if mark else b"") + (end.join(lines) + end).encode())
    table = read_csv(path)
    assert list(table.columns) == ["time", "command", "position"]
    assert [column.unit for column in table.columns.values()] == (["ms", "V", "mm"] if units else [None] * 3)
    got = np.column_stack([column.values for column in table.columns.values()])
    assert np.array_equal(got, np.array(values))


@pytest.mark.parametrize(
    ("heading", "name", "unit"),
    [
        ("pos [mm]", "pos", "mm"),
        ("pos (µm)", "pos", "µm"),
        ("pos_mm", "pos_mm", "mm"),
        ("Weg [mm]", "Weg", "mm"),
        ("plain", "plain", None),
        ("x_in", "x_in", None),
    ],
)
def test_headings(tmp_path: Path, heading: str, name: str, unit: str | None) -> None:
    path = tmp_path / "log.csv"
    path.write_text(f"time [s],{heading}\n0,1.5\n1,2.5\n", encoding="utf-8")
    column = list(read_csv(path).columns.values())[1]
    assert (column.name, column.unit, column.values.tolist()) == (name, unit, [1.5, 2.5])


def test_a_preamble_and_remarks_between_rows_and_a_windows_code_page(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    text = "Gerät;7\nVerstärkung;2,5\n\nZeit [s];Weg [µm];\n0,0;1,0;\n# Pause\n0,1;2,0;\n0,2;3,0;\n"
    path.write_bytes(text.encode("cp1252"))
    table = read_csv(path)
    assert {c.name: (c.unit, c.values.tolist()) for c in table.columns.values()} == {
        "Zeit": ("s", [0.0, 0.1, 0.2]),
        "Weg": ("µm", [1.0, 2.0, 3.0]),
    }
    assert [f.kind for f in table.findings] == ["encoding", "comments"]


@pytest.mark.parametrize(("heading", "gravity"), [("位置 [mm]", "note"), ("モーター [mm]", "warning")])
def test_a_heading_of_another_code_page_gets_the_remedy(tmp_path: Path, heading: str, gravity: str) -> None:
    """Code page 1252 leaves five bytes undefined: where a heading has one, the file is surely of another code page."""
    path = tmp_path / "log.csv"
    path.write_bytes(f"t [s],{heading}\n0,1\n1,2\n".encode("shift-jis"))
    (finding,) = read_csv(path).findings
    assert finding.gravity == gravity and "another code page: save it as UTF-8" in finding.what


LONG = "".join(f"{i / 1e3:.6f},1.000000,{i / 1e2:.6f}\n" for i in range(4000)).encode()  # beyond what is looked at


@pytest.mark.parametrize("word", ["Störung".encode("cp1252"), "警告".encode("shift-jis"), b"\x81\x8d"])
@pytest.mark.parametrize("late", [False, True])
def test_words_of_other_code_pages_are_read_wherever_they_stand(tmp_path: Path, word: bytes, late: bool) -> None:
    """Bytes that are no UTF-8, and none of code page 1252 either, among the first rows and far below."""
    path = tmp_path / "log.csv"
    rows = LONG.replace(b"\n", b",ok\n")
    path.write_bytes(b"t [s],u [V],x [mm],state\n" + rows * late + b"5,1,2," + word + b"\n6,1,3,ok\n")
    table = read_csv(path)
    assert len(table.columns["x"].values) == 4000 * late + 2 and table.columns["x"].values[-1] == 3.0
    assert [f.kind for f in table.findings] == ["encoding"]


@pytest.mark.parametrize("row", [b"4.0,1,\xb0\xff7,9", b"\0" * 40 + b"\xff" * 40])
def test_damaged_bytes_far_below_are_named_with_their_line(
    tmp_path: Path, row: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(b"t [s],u [V],x [mm]\n" + LONG + row + b"\n5.0,1,2\n")
    with pytest.raises(InputError, match=r"log\.csv, line 4002: it has \d cells .* repair or remove"):
        read_csv(path)
    assert not capfd.readouterr().err
    path.write_bytes("t [s],u [V],x [µm]\n".encode() + LONG + row + b"\n5.0,1,2\n")
    with pytest.raises(InputError, match=r"log\.csv, line 4002: it begins in UTF-8"):
        read_csv(path)


@pytest.mark.parametrize(
    "stamp",
    [
        "16:20:01.{k:03d} -> ",
        "[2024-01-01 16:20:01.{k:03d}] ",
        "2024-01-01 16:20:01 ",
        "[Mon Jan  1 16:20:01.{k:03d} 2024] ",
    ],
)
def test_the_time_stamps_of_a_terminal_are_refused_with_how_to_take_them_out(tmp_path: Path, stamp: str) -> None:
    """Else the first column, often the time of the microcontroller, would be words."""
    path, rows = tmp_path / "log.txt", [f"{10 * k},{k % 2},{k / 10}" for k in range(50)]
    path.write_text("".join(f"{stamp.format(k=k)}{row}\n" for k, row in enumerate(rows)))
    with pytest.raises(InputError, match="a terminal's time stamp stands before each line") as caught:
        read_csv(path)
    first = int(str(caught.value).rpartition("cut -c")[2].partition("-")[0]) - 1
    path.write_text("".join(f"{line[first:]}\n" for line in path.read_text().splitlines()))
    assert [column.values[49] for column in read_csv(path).columns.values()] == [490.0, 1.0, 4.9]


def test_words_are_kept_apart_and_named_where_a_number_should_be(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(
        "time [s],state,u [V],y [mm]\n" + "".join(f"{i},RUN,1,{'oops' if i == 700 else i}\n" for i in range(900))
    )
    table = read_csv(path)
    assert table.columns["state"].text == (0, "RUN")
    assert table.columns["y"].text == (700, "oops")
    assert table.columns["u"].values.sum() == 900.0


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "it is empty"),
        ("  \n\n", "it is empty"),
        ("just,words\nno,numbers\n", "no lines of numbers"),
        ("a,b\n1,2\n3\n5,6\n", r"line 3: it has 1 cells"),
        ("a,b\n1,2\n3,4\n5,6,7\n8,9\n", r"line 4: it has 3 cells"),
        ("a,b\0\n1,2\n", "null bytes"),
        ('"1,2,3"\n"3,4,5"\n', "each line as a whole stands in quotation marks"),
        (" a  b\n\n[  0  0.5;\n   1  0.5;\n   2  0.5]\n", "as a matrix is typed in MATLAB"),
    ],
)
def test_what_is_no_table_is_refused(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=sentence):
        read_csv(path)


@pytest.mark.parametrize("cell", ["RUN", "\u22122", "\u0660.\u0661", "1_0"])
def test_a_cell_that_is_no_number_makes_words_of_its_column_alone(tmp_path: Path, cell: str) -> None:
    """Arrow names the row as well in its error since some version, and the whole file was refused."""
    path = tmp_path / "log.csv"
    path.write_text("t,u\n" + "".join(f"{k},{cell if k == 100 else 1}\n" for k in range(200)), encoding="utf-8")
    table = read_csv(path)
    assert table.columns["u"].text == (100, cell) and len(table.columns["t"].values) == 200


def test_utf_16_as_spreadsheets_save_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "wide.txt"
    path.write_text("time [s]\tx [µm]\n" + "".join(f"{k}\t{k / 2}\n" for k in range(50)), encoding="utf-16")
    table = read_csv(path)
    assert table.path == path and table.columns["x"].unit == "µm" and table.columns["x"].values[-1] == 24.5
    assert "read as utf-16" in table.findings[0].what
    path.write_text("a\tb\n1\t2\n3\n5\t6\n", encoding="utf-16")
    with pytest.raises(InputError, match=r"^\S*wide.txt, line 3: it has 1 cells"):
        read_csv(path)


def test_columns_with_the_same_heading_are_numbered(tmp_path: Path) -> None:
    path = tmp_path / "twice.csv"
    path.write_text("a,x [mm],x [mm],x [V]\n1,2,3,4\n3,4,5,6\n")
    table = read_csv(path)
    assert list(table.columns) == ["a", "x", "x (2)", "x (3)"] and table.columns["x (2)"].values[1] == 5.0
    (said,) = [finding.what for finding in table.findings if finding.kind == "headings"]
    assert "'x (2)'" in said


def test_half_a_file_loses_its_cut_line_and_says_so(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", headed(axis()))
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2 - (whole[: len(whole) // 2][::-1].index(b"\n")) + 3])  # 3 bytes of a line
    (log,) = read_log(path)
    cut = next(f for f in log.findings if f.kind == "cut")
    assert "ends in the middle of a line" in cut.what and cut.gravity == "warning"
    assert len(log) == whole[: len(whole) // 2].count(b"\n") - 1


@pytest.mark.parametrize("tail", ["\t\t\n", "\n  \n\t\n", "\r\n\t", "\t\t\n" * 9999])
def test_lines_of_blanks_at_the_end_are_no_rows(tmp_path: Path, tail: str) -> None:
    path = tmp_path / "log.dat"
    path.write_bytes(("t [s]\tu [V]\tx [mm]\tv\n" + "0.5\t1\t2\t\n" * 3 + tail).encode())
    table = read_csv(path)
    assert len(table.columns["x"].values) == 3 and not table.findings


@pytest.mark.parametrize("heading", ["# samples: 8000", "# 1 kHz, samples = 8000"])
def test_fewer_samples_than_announced(tmp_path: Path, heading: str) -> None:
    path = write(tmp_path / "log.csv", headed(axis()))
    path.write_text(heading + "\n" + path.read_text())
    (log,) = read_log(path)
    cut = next(f for f in log.findings if f.kind == "cut")
    assert cut.what.startswith("the file announces 8000 samples, and there are 4000: 50 % are missing")
    assert cut.gravity == "fault"


@settings(max_examples=80, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.binary(max_size=400) | st.text(alphabet='0123456789.,;\t \n#ab-"[]', max_size=200).map(str.encode))
def test_no_bytes_make_a_traceback(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(data)
    try:
        table = read_csv(path)
    except InputError as error:
        assert str(error)
    else:
        assert all(len(column.values) == table.rows for column in table.columns.values())
