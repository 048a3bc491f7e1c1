"""Dates and times since 1970: counted from the first row, with the digits that the file has."""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rds.core.errors import InputError
from rds.identification.logs.csv_layout import HEAD
from rds.identification.logs.csv_stamps import is_stamp, uniform_cell
from rds.identification.logs.read_log import read_log
from tests.logs.data_files import axis, headed

BEGIN = np.datetime64("2024-10-27T00:59:59.900", "ns")


def stamps(samples: int) -> np.ndarray:
    return BEGIN + np.arange(samples) * np.timedelta64(1, "ms")


@pytest.mark.parametrize("zone", ["", "Z", "+02:00"])
def test_dates_in_text_keep_every_digit(tmp_path: Path, zone: str) -> None:
    made = headed(axis(300))
    rows = [f"{at}{zone},{u:g},{y:.9g}" for at, u, y in zip(stamps(300), *list(made.values())[1:], strict=True)]
    (tmp_path / "log.csv").write_text("\n".join(["time,voltage [V],position [mm]", *rows]) + "\n")
    (log,) = read_log(tmp_path / "log.csv")
    assert np.allclose(log.time, made["time [s]"], atol=1e-12, rtol=0.0)


@pytest.mark.parametrize(("unit", "per_second", "worst"), [("s", 1.0, 3e-7), ("us", 1e6, 1e-12), ("ns", 1e9, 3e-7)])
def test_seconds_since_1970_in_any_unit(tmp_path: Path, unit: str, per_second: float, worst: float) -> None:
    made = axis(300)
    time = np.rint((1.7e9 + made["time"]) * per_second) if unit != "s" else 1.7e9 + made["time"]
    rows = [f"{t!r},{u:g},{y:.9g}" for t, u, y in zip(time.tolist(), made["voltage"], made["position"], strict=True)]
    (tmp_path / "log.csv").write_text("\n".join([f"time [{unit}],voltage [V],position [mm]", *rows]) + "\n")
    (log,) = read_log(tmp_path / "log.csv")
    assert np.allclose(log.time, made["time"], atol=worst, rtol=0.0)


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_the_time_index_of_pandas_is_the_time(tmp_path: Path, unit: str) -> None:
    made = headed(axis(300))
    frame = pd.DataFrame({name: values for name, values in made.items() if name != "time [s]"})
    for index in (stamps(300), stamps(300) - BEGIN):
        frame.index = pd.Index(index.astype(f"{index.dtype.str[1:3]}[{unit}]"))
        frame.to_parquet(tmp_path / "log.parquet")
        (log,) = read_log(tmp_path / "log.parquet")
        assert np.allclose(log.time, made["time [s]"], atol=1e-12, rtol=0.0)


def test_a_missing_date_is_a_blank_and_one_out_of_reach_is_refused(tmp_path: Path) -> None:
    made = headed(axis(300))
    del made["time [s]"]
    time = stamps(300)
    time[7] = np.datetime64("NaT")
    pd.DataFrame(made | {"time": time}).to_parquet(tmp_path / "log.parquet")
    with pytest.raises(InputError, match="time has no number in sample 7"):
        read_log(tmp_path / "log.parquet")
    far = np.full(300, "9999-01-01", dtype="datetime64[ms]")
    pd.DataFrame(made | {"time": far}).to_parquet(tmp_path / "log.parquet")
    with pytest.raises(InputError, match="its dates cannot be read"):
        read_log(tmp_path / "log.parquet")


def test_times_of_day_go_on_through_midnight(tmp_path: Path) -> None:
    made = axis(300)
    rows = [
        f"{str(at)[11:23]},{u:g},{y:.9g}"
        for at, u, y in zip(
            np.datetime64("2024-05-01T23:59:59.900", "ns") + np.arange(300) * np.timedelta64(1, "ms"),
            made["voltage"],
            made["position"],
            strict=True,
        )
    ]
    (tmp_path / "log.csv").write_text("\n".join(["time,voltage [V],position [mm]", *rows]) + "\n")
    (log,) = read_log(tmp_path / "log.csv")
    assert np.allclose(log.time, made["time"], atol=1e-9, rtol=0.0)


def test_a_clock_that_is_set_back_an_hour_is_told(tmp_path: Path) -> None:
    rows = [f"2024-10-27 02:59:59.{k:03d},{k % 7},{k}" for k in range(900, 1000)]
    rows += [f"2024-10-27 02:00:00.{k:03d},{k % 7},{1000 + k}" for k in range(100)]
    path = tmp_path / "log.csv"
    path.write_text("time,voltage [V],position [mm]\n" + "\n".join(rows) + "\n")
    with pytest.raises(InputError, match=r"set back by an hour .* summer time ends: log UTC"):
        read_log(path)


@pytest.mark.parametrize(("unit", "refused"), [("ns", False), ("us", True), ("ms", True)])
def test_a_date_of_another_age_is_told(tmp_path: Path, unit: str, refused: bool) -> None:
    """ROS counts ns since 1970; taken for µs the log would be 1000 times as long."""
    path = tmp_path / "log.csv"
    rows = (f"{1700000000000000000 + 1000000 * k},{k % 7},{k}" for k in range(300))
    path.write_text("%time,voltage [V],position [mm]\n" + "\n".join(rows) + "\n")
    (tmp_path / "log.csv.map.toml").write_text(
        f'[time]\ncolumn = "time"\nunit = "{unit}"\n[axis.X]\ncommand = "voltage"\nposition = "position"\n'
    )
    if refused:
        with pytest.raises(InputError, match=r"time .* begins after \d+ years, counted in"):
            read_log(path)
    else:
        assert read_log(path)[0].sample_period == pytest.approx(1e-3, rel=1e-3)


@pytest.mark.parametrize(
    "form",
    ["%Y/%m/%d %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S,%f", "%Y-%m-%d %H:%M:%S,%f", "%H:%M:%S,%f", "%d.%m.%Y %H:%M:%S.%f"],
)
def test_dates_of_german_recorders_and_of_logging_are_times(tmp_path: Path, form: str) -> None:
    """`05.04.2024` is never the fourth of May, as a day between points comes first."""
    begin = datetime(2024, 4, 5, 11, 59, 59, 900000)
    stamps = [(begin + timedelta(milliseconds=k)).strftime(form) for k in range(300)]
    path = tmp_path / "log.csv"
    rows = (f"{stamp};{k % 7},5;{k},25" for k, stamp in enumerate(stamps))
    path.write_text("Zeit;Spannung [V];Position [mm]\n" + "\n".join(rows) + "\n")
    (log,) = read_log(path)
    assert np.allclose(log.time, 1e-3 * np.arange(300), atol=1e-9) and log.position[1] == 1.25


def test_a_time_of_day_before_a_comma_keeps_its_neighbour(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows = (f"12:00:{k // 10:02d}.{k % 10}00,{k % 7},{k}" for k in range(300))
    path.write_text("time,voltage [V],position [mm]\n" + "\n".join(rows) + "\n")
    assert read_log(path)[0].command[3] == 3.0
    path.write_text("time,voltage [V],position [mm]\n" + "".join(f"12:00:{k:02d},{k % 7},{k}\n" for k in range(60)))
    assert read_log(path)[0].command[3] == 3.0 and read_log(path)[0].sample_period == pytest.approx(1.0)


def clock(at: datetime, hours: str = "%H") -> str:
    """A time of day with its milliseconds; %I for half a day."""
    return at.strftime(f"{hours}:%M:%S.") + f"{at.microsecond // 1000:03d}"


FORMS = {
    "a colon before milliseconds": lambda at: clock(at).replace(".", ":"),
    "a date and a colon before milliseconds": lambda at: f"2024-03-01 {clock(at)}".replace(".", ":"),
    "halves of a day": lambda at: f"{clock(at, '%I').lstrip('0')} {at:%p}",
    "halves of a day, small": lambda at: clock(at, "%I") + at.strftime("%p").lower(),
    "no zero before the hour": lambda at: clock(at).lstrip("0"),
    "MATLAB": lambda at: f"01-Mar-2024 {clock(at)}",
    "the day before the month's name": lambda at: f"1 March 2024 {clock(at)}",
    "the month's name first": lambda at: f"Mar 1 2024 {clock(at)}",
    "a comma before the year": lambda at: f'"March 1, 2024 {clock(at)}"',
    "no zeros, the year first": lambda at: f"2024/3/1 {clock(at)}",
    "no zeros, the day first": lambda at: f"1.3.2024 {clock(at)}",
    "a point between date and time": lambda at: f"2024-03-01.{clock(at)}",
    "the day or the month first": lambda at: f"3/1/2024 {clock(at, '%I')} {at:%p}",
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("hour", [9, 11, 23])
@pytest.mark.parametrize("mark", [",", ";"])
def test_dates_and_times_that_can_mean_one_thing_are_read(tmp_path: Path, form: str, hour: int, mark: str) -> None:
    begin, path = datetime(2024, 3, 1, hour, 59, 59, 900000), tmp_path / "log.csv"
    samples = 100 if hour == 23 else 300  # the day is the same in all rows
    rows = (mark.join((FORMS[form](begin + timedelta(milliseconds=k)), f"{k % 7}", f"{k}.25")) for k in range(samples))
    path.write_text(f"time{mark}voltage [V]{mark}position [mm]\n" + "\n".join(rows) + "\n")
    (log,) = read_log(path)
    assert np.allclose(log.time, 1e-3 * np.arange(samples), atol=1e-9) and log.position[3] == 3.25


@pytest.mark.parametrize(
    "stamps",
    [
        ("11:59:59:90", "11:59:59:91"),  # frames of a film, or hundredths
        ("13:59:59.900 PM", "13:59:59.901 PM"),
        ("31/31/2024 11:59:59.900", "31/31/2024 11:59:59.901"),
        ("12/05/2024 23:59:59.999", "13/05/2024 00:00:00.000"),  # the second tells what the first is
        ("03/04/2024 23:59:59.999", "04/04/2024 00:00:00.000"),  # a day later, or a month
    ],
)
def test_dates_and_times_that_can_mean_two_things_are_refused(tmp_path: Path, stamps: tuple[str, str]) -> None:
    path = tmp_path / "log.csv"
    rows = "".join(f"{stamp},{k},{k}\n" for k, stamp in enumerate(stamps))
    path.write_text(f"time,voltage [V],position [mm]\n{rows}")
    with pytest.raises(InputError, match=r"write (dates|times of day) as"):
        read_log(path)


def test_an_american_log_goes_on_through_midnight(tmp_path: Path) -> None:
    begin, path = datetime(2024, 3, 1, 23, 59, 59, 900000), tmp_path / "log.csv"
    stamps = [begin + timedelta(milliseconds=k) for k in range(300)]
    rows = "".join(f"{at:%m/%d/%Y} {clock(at)},{k % 7},{k}\n" for k, at in enumerate(stamps))
    path.write_text(f"time,voltage [V],position [mm]\n{rows}")
    assert np.allclose(read_log(path)[0].time, 1e-3 * np.arange(300), atol=1e-9)


def test_the_exponents_of_fortran_are_numbers(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows = (f"{1e-3 * k:.9E},{k % 7:.3E},{1.5 * k:.6E}".replace("E", "D") for k in range(300))
    path.write_text("time [s],voltage [V],position [mm]\n" + "\n".join(rows) + "\n")
    (log,) = read_log(path)
    assert np.allclose(log.time, 1e-3 * np.arange(300)) and np.array_equal(log.position, 1.5 * np.arange(300))
    path.write_text(path.read_text().replace(",", ";").replace(".", ","))
    assert np.array_equal(read_log(path)[0].position, log.position)


@pytest.mark.parametrize(
    ("form", "mark"),
    [
        ("%m/%d/%Y, %H:%M:%S.%f", ", "),
        ("%d.%m.%Y, %H:%M:%S.%f", ", "),
        ("%d-%b-%Y, %H:%M:%S.%f", ", "),
        ("%d %b %Y %H:%M:%S.%f", " "),
        ("%H:%M:%S.%f PM", " "),
    ],
)
def test_a_date_in_a_column_of_its_own_stays_there(tmp_path: Path, form: str, mark: str) -> None:
    begin = datetime(2024, 5, 21, 12, 59, 58)
    stamps = [(begin + timedelta(milliseconds=10 * k)).strftime(form) for k in range(300)]
    names = mark.join("time" if "%H" in part else f"word{k}" for k, part in enumerate(form.split(mark)))
    rows = (mark.join([stamp, str(k % 7), str(k)]) for k, stamp in enumerate(stamps))
    path = tmp_path / "log.csv"
    path.write_text("\n".join([mark.join([names, "u_V", "y_mm"]), *rows]) + "\n")
    (log,) = read_log(path)
    assert np.allclose(log.time, 1e-2 * np.arange(300), atol=1e-9) and log.command[5] == 5.0


@pytest.mark.parametrize("day", [5, 13, 31])
def test_the_day_before_the_month_is_read_on_any_day(tmp_path: Path, day: int) -> None:
    begin = datetime(2024, 5, day, 12, 0, 0)
    rows = (f"{begin + timedelta(milliseconds=k):%d/%m/%Y %H:%M:%S.%f},{k % 7},{k}" for k in range(300))
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["time,u_V,y_mm", *rows]) + "\n")
    (log,) = read_log(path)
    assert np.allclose(log.time, 1e-3 * np.arange(300), atol=1e-9)


def test_hours_of_one_digit_may_begin_at_midnight(tmp_path: Path) -> None:
    """Far behind the rows by which the forms of a file are told."""
    begin, path = datetime(2024, 5, 1, 23, 59, 0), tmp_path / "log.csv"
    at = [begin + timedelta(milliseconds=20 * k) for k in range(4000)]
    rows = (f"{t.hour}:{t:%M:%S.%f},{k % 7},{k},a word of the recorder" for k, t in enumerate(at))
    path.write_text("\n".join(["time,u_V,y_mm,word", *rows]) + "\n")
    (log,) = read_log(path)
    assert path.stat().st_size > 2 * HEAD and np.allclose(log.time, 2e-2 * np.arange(4000), atol=1e-9)


@pytest.mark.parametrize(
    ("before_midnight", "after"),
    [
        ("30.11.2024 23:59:{0:06.3f}", "1.12.2024 00:00:{0:06.3f}"),
        ("11/30/2024 23:59:{0:06.3f}", "12/1/2024 0:00:{0:06.3f}"),
        ("2024/11/30 23:59:{0:06.3f}", "2024/12/1 0:00:{0:06.3f}"),
        ("2024-11-30 23:59:{0:06.3f}", "2024-12-1 0:00:{0:06.3f}"),
        ("23:59:{0:06.3f}", "0:00:{0:06.3f}"),
    ],
)
def test_days_and_hours_without_zeros_may_come_after_midnight(tmp_path: Path, before_midnight: str, after: str) -> None:
    """The head of the file, which the forms are looked for in, has none of them."""
    before = [before_midnight.format(k / 100) for k in range(6000)]
    rows = [f"{at},{k % 7},{k % 11}" for k, at in enumerate(before + [after.format(k / 100) for k in range(3000)])]
    (tmp_path / "log.csv").write_text("time,voltage [V],position [mm]\n" + "\n".join(rows) + "\n")
    assert len("\n".join(rows[:6000])) > 1 << 16
    (log,) = read_log(tmp_path / "log.csv")
    assert np.allclose(log.time, np.arange(9000) / 100, atol=1e-9, rtol=0.0)


def test_what_is_no_date_is_told_as_it_is_written(tmp_path: Path) -> None:
    rows = [f"31/31/2024 23:59:{k / 100:06.3f},{k % 7},{k % 11}" for k in range(900)]
    (tmp_path / "log.csv").write_text("time,voltage [V],position [mm]\n" + "\n".join(rows) + "\n")
    with pytest.raises(InputError, match=r"holds '31/31/2024 23:59:00\.000' in data row 1; write dates as"):
        read_log(tmp_path / "log.csv")


@pytest.mark.parametrize(
    ("cell", "same"),
    [
        ("12:00:00 AM", "00:00:00"),
        ("12:30:00 pm", "12:30:00"),
        ("1:05:09.5 p.m.", "13:05:09.5"),
        ("0:05:09 PM", "00:05:09 PM"),  # no hour of half a day
        ("12/13/2024 01:02:03", "2024-12-13 01:02:03"),
        ("13/12/2024 01:02:03", "2024-12-13 01:02:03"),
        ("12/12/2024 01:02:03", "2024-12-12 01:02:03"),
        ("13/13/2024 01:02:03", "13/13/2024 01:02:03"),
        ("31 Dec 2024 1:02:03", "2024-12-31 01:02:03"),
        ("1-jan-2024 1:02:03", "2024-01-01 01:02:03"),
        ("Sept. 9, 2024, 01:02:03", "2024-09-09 01:02:03"),
        ("2024-03-01_01:02:03", "2024-03-01 01:02:03"),
        ("1:02:03:004", "01:02:03.004"),
        ("12:00:00:12", "12:00:00:12"),
        ("1,5d-003", "1,5E-003"),
        ("1D5", "1D5"),
    ],
)
def test_each_form_means_one_thing(cell: str, same: str) -> None:
    assert uniform_cell(cell) == same


def test_a_stamp_has_a_time_of_day() -> None:
    yes = (
        "12:00:00",
        "1:02:03 PM",
        "12:00:00,5",
        "2024-03-01 12:00",
        "1.3.2024 1:02:03",
        "2024-03-01T12:00:00.5+01:00",
    )
    assert all(map(is_stamp, yes)) and not any(map(is_stamp, ("12:00", "2024-03-01", "1.5", "a:b", "12:00:00 V")))
