"""Logs of tools that python-can does not know: written by hand as the tools write them, read frame by frame."""

from __future__ import annotations

from pathlib import Path

import pytest

from rds.bus import LogFile
from rds.core.errors import InputError

GVRET = """Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8
166064000,0000021A,false,Rx,0,8,FE,36,12,FE,69,05,07,AD,
166065500,18FEF1FE,true,Tx,0,2,01,FF,
166066000,00000900,false,Rx,0,1,00,
"""
OLD_GVRET = "Time Stamp,ID,Extended,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n1000,0000021A,false,0,1,FE,\n"
BUSMASTER = """***BUSMASTER Ver 2.4.0***
***PROTOCOL CAN***
***[START LOGGING SESSION]***
***START DATE AND TIME 8:8:2014 10:18:59:187***
***HEX***
***SYSTEM MODE***
***<Time><Tx/Rx><Channel><CAN ID><Type><DLC><DataBytes>***
10:18:59:2050 Rx 1 0x21A s 8 FE 36 12 FE 69 05 07 AD
10:18:59:2065 Tx 1 0x18FEF1FE x 2 01 FF
10:18:59:2070 Rx 1 0x7FF sr 4
***END DATE AND TIME 8:8:2014 10:19:00:187***
***[STOP LOGGING SESSION]***
"""
CRTD = """1320745424.000 CXX OVMS Tesla Roadster cando2crtd converted log
1320745424.002 R11 21A FE 36 12 FE 69 05 07 AD
1320745424.0035 2T29 18FEF1FE 01 FF
1320745424.100 CEV Drive begin
"""
MICROCHIP = """//---------------------------------
Microchip Technology Inc.
CAN BUS Analyzer
SavvyCAN Exporter
Logging Started: 6/3/2016 13:24:56
//---------------------------------
6224;RX;0x0000021A;8;0xFE;0x36;0x12;0xFE;0x69;0x05;0x07;0xAD;
6225.5;TX;0x18FEF1FE;2;0x01;0xFF;;;;;;;
"""
CANDUMP = """ (1436509052.249713)  can0  RX - -  21A   [8]  FE 36 12 FE 69 05 07 AD
 (1436509052.251213)  can0  TX - -  18FEF1FE   [2]  01 FF
 (1436509052.300000)  can0  RX - -  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME
"""
FIRST = (0x21A, False, bytes.fromhex("FE3612FE690507AD"), True)
SECOND = (0x18FEF1FE, True, b"\x01\xff", False)


@pytest.mark.parametrize(
    "name, text, skipped, impossible",
    [
        ("a.csv", GVRET, 1, 1),
        ("b.log", BUSMASTER, 9, 0),
        ("c.txt", CRTD, 2, 0),
        ("c.crtd", CRTD, 2, 0),
        ("d.can", MICROCHIP, 6, 0),
        ("e.log", CANDUMP, 0, 0),
        ("e.txt", CANDUMP, 0, 0),
    ],
)
def test_frames_are_what_the_tool_wrote(name: str, text: str, skipped: int, impossible: int, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text.replace("\n", "\r\n"))
    log = LogFile(tmp_path / name)
    frames = list(log)
    assert [(m.arbitration_id, m.is_extended_id, bytes(m.data), m.is_rx) for m in frames[:2]] == [FIRST, SECOND]
    assert frames[1].timestamp - frames[0].timestamp == pytest.approx(0.0015, abs=1e-6)
    assert (log.skipped, log.impossible) == (skipped, impossible)
    assert len(frames) == (3 if text in (BUSMASTER, CANDUMP) else 2)
    assert all(m.is_error_frame if text == CANDUMP else m.is_remote_frame for m in frames[2:])


def test_the_older_form_of_gvret_has_no_direction(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(OLD_GVRET)
    assert [(m.arbitration_id, bytes(m.data), m.is_rx) for m in LogFile(tmp_path / "a.csv")] == [(0x21A, b"\xfe", True)]


@pytest.mark.parametrize(
    "name, text, line",
    [
        ("a.csv", GVRET + "x,0000021A,false,Rx,0,1,FE,\n", 5),
        ("a.csv", GVRET + "5,0000021A,false,Rx,0,2,FE\n", 5),
        ("a.log", BUSMASTER + "10:18:59:2065 Tx 1 0x18FEF1FE x 2 01\n", 13),
        ("a.txt", CRTD + "1320745425.0 R11 XYZ FF", 5),
        ("a.log", CANDUMP + " (1436509052.400000)  can0  21A   [8]  FE 36\n", 4),
        ("a.can", MICROCHIP + "6226;RX;0x21A;2;0x01;\n", 9),
    ],
)
def test_a_damaged_line_is_named(name: str, text: str, line: int, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError) as caught:
        list(LogFile(tmp_path / name))
    assert str(caught.value).startswith(f"{tmp_path / name}:{line}: ")


def test_a_text_that_is_no_log_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("Dear diary\n")
    with pytest.raises(InputError, match="no log of candump, CRTD"):
        list(LogFile(tmp_path / "a.txt"))


def test_what_candump_shows_without_directions(tmp_path: Path) -> None:
    shown = " (1.5)  vcan0  123   [2]  01 02\n (1.6)  vcan0  7DF   [0]  remote request\n"
    (tmp_path / "a.log").write_text(shown)
    frames = list(LogFile(tmp_path / "a.log"))
    assert [(m.arbitration_id, bytes(m.data), m.is_remote_frame) for m in frames] == [
        (0x123, b"\x01\x02", False),
        (0x7DF, b"", True),
    ]


def test_can_fd_that_candump_shows_is_read_with_its_flags(tmp_path: Path) -> None:
    data = " ".join(f"{byte:02X}" for byte in range(12))
    (tmp_path / "a.txt").write_text(
        f" (1.5)  can0  RX B -  123  [12]  {data}\n (1.6)  can0  TX - E  124  [08]  00 01 02 03 04 05 06 07\n"
    )
    log = LogFile(tmp_path / "a.txt")
    first, second = log
    assert first.is_fd and first.bitrate_switch and not first.error_state_indicator and first.is_rx
    assert bytes(first.data) == bytes(range(12))
    assert second.is_fd and not second.bitrate_switch and second.error_state_indicator and not second.is_rx
    assert log.skipped == 0


def test_candump_may_show_dates_and_texts(tmp_path: Path) -> None:
    (tmp_path / "a.log").write_text(
        " (2020-12-19 12:04:45.485261)  can1  123   [8]  31 30 30 2E 35 20 46 4D   '100.5 FM'\n"
        " (2020-12-19 12:04:46.485261)  can1  123   [1]  31   '1'\n"
    )
    first, second = LogFile(tmp_path / "a.log")
    assert bytes(first.data) == b"100.5 FM" and second.timestamp - first.timestamp == pytest.approx(1.0, abs=1e-6)


def test_what_candump_logs_may_be_called_txt(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("(1700000000.000000) can0 123#11223344\n(1700000000.100000) can0 124##155\n")
    assert [(m.arbitration_id, bytes(m.data), m.is_fd) for m in LogFile(tmp_path / "a.txt")] == [
        (0x123, b"\x11\x22\x33\x44", False),
        (0x124, b"\x55", True),
    ]
    (tmp_path / "a.txt").write_text("(1700000000.000000) can0 123#11223344\n(1700000000.100000) can0 124#5\n")
    with pytest.raises(InputError, match=r"a\.txt:2: .*candump -L"):
        list(LogFile(tmp_path / "a.txt"))


def test_distances_between_frames_are_not_taken_for_times(tmp_path: Path) -> None:
    lines = [f" (000.{time:06})  can0  123   [1]  31\n" for time in (0, 10000, 9000)]
    (tmp_path / "a.log").write_text("".join(lines))  # as `candump -t d` shows them
    with pytest.raises(InputError, match=r"a\.log:3: .*candump -t d"):
        list(LogFile(tmp_path / "a.log"))


@pytest.mark.parametrize("name", ["a.log", "a.txt"])
def test_candump_without_times_is_told_how_to_record_them(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("  vcan0  0C8   [8]  F0 00 00 00 00 00 00 00\n")
    with pytest.raises(InputError, match="no times; record with `candump -L`"):
        list(LogFile(tmp_path / name))


def test_can_xl_that_candump_shows_is_counted(tmp_path: Path) -> None:
    """Two digits of a length are those of CAN FD, four of CAN XL."""
    shown = " (1.7)  can0  RX - -  124   [1]  FF\n (1.8)  can0  RX - -  125 [0002] (00|80:00:00000000) 01 02\n"
    (tmp_path / "a.log").write_text(shown)
    log = LogFile(tmp_path / "a.log")
    (classic,) = list(log)
    assert not classic.is_fd and log.skipped == 1


def test_a_can_fd_frame_that_is_cut_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.log").write_text(" (1.5)  can0  123  [12]  01 02 03\n")
    with pytest.raises(InputError, match="3 bytes of data, and its length says 12"):
        list(LogFile(tmp_path / "a.log"))


@pytest.mark.parametrize("kind", ["absolute", "relative"])
def test_distances_between_the_frames_of_an_asc_are_not_taken_for_times(tmp_path: Path, kind: str) -> None:
    """Read as times, all frames of a log would stand within one sample."""
    path = tmp_path / "log.asc"
    rows = (f"   {(0.002 * k if kind == 'absolute' else 0.002):.6f} 1  181  Rx   d 2 01 0{k}" for k in range(1, 6))
    head = f"date Fri Mar 1 11:59:58.000 am 2024\nbase hex  timestamps {kind}\ninternal events logged\n"
    path.write_text(head + "\n".join(rows) + "\n")
    if kind == "absolute":
        times = [message.timestamp for message in LogFile(path)]
        assert times[-1] - times[0] == pytest.approx(0.008, abs=1e-6)
    else:
        with pytest.raises(InputError, match="distances to the line before"):
            list(LogFile(path))


def test_a_log_of_busmaster_goes_on_past_midnight(tmp_path: Path) -> None:
    (tmp_path / "a.log").write_text(
        BUSMASTER.replace("10:18:59:2065", "23:59:59:9999").replace("10:18:59:2070", "0:0:0:0009")
    )
    first, second, third = (message.timestamp for message in LogFile(tmp_path / "a.log"))
    assert third - second == pytest.approx(0.001, abs=1e-6)
    assert second - first == pytest.approx(13 * 3600 + 41 * 60 + 0.7949, abs=1e-6)


def test_distances_between_the_frames_of_busmaster_are_not_taken_for_times(tmp_path: Path) -> None:
    (tmp_path / "a.log").write_text(BUSMASTER.replace("SYSTEM MODE", "RELATIVE MODE"))
    with pytest.raises(InputError, match=r"a\.log:6: its head says RELATIVE MODE"):
        list(LogFile(tmp_path / "a.log"))


@pytest.mark.parametrize(
    "head", ["", "date Fri Mar 1 11:59:58.000 am 2024\nbase hex  timestamps absolute\n// version 8.0.0\n"]
)
@pytest.mark.parametrize("first", ["   0.001000 1  ErrorFrame\n", "   0.001000 1  181             Rx   d 2 01 00\n"])
def test_no_line_is_lost_below_a_head_of_asc_that_does_not_end(head: str, first: str, tmp_path: Path) -> None:
    """Converters leave out `internal events logged`; python-can's reader (4.6) then passes over one line more."""
    rows = "".join(f"   0.00{k}000 1  181             Rx   d 2 01 0{k}\n" for k in range(2, 6))
    (tmp_path / "log.asc").write_text(head + first + rows)
    log = LogFile(tmp_path / "log.asc")
    frames = list(log)
    assert (len(frames), log.skipped) == (5, 0)
    assert [bytes(m.data) for m in frames[1:]] == [bytes([1, k]) for k in range(2, 6)]
    assert frames[0].is_error_frame == ("ErrorFrame" in first)


def test_distances_of_candump_are_refused_where_the_first_line_is_not_there(tmp_path: Path) -> None:
    """`candump -t d` begins with a zero, which `grep` leaves out."""
    rows = "".join(f" (000.01{k % 3:04d})  can0  123   [2]  01 0{k}\n" for k in range(9))
    (tmp_path / "a.log").write_text(rows)
    with pytest.raises(InputError, match=r"a\.log:4: .*goes back"):
        list(LogFile(tmp_path / "a.log"))


def test_a_clock_that_is_set_back_is_no_distance(tmp_path: Path) -> None:
    (tmp_path / "a.log").write_text(CANDUMP.replace("1436509052.25", "1436509050.25"))
    assert len(list(LogFile(tmp_path / "a.log"))) == 3
