"""Logs: what is written comes back, what a format can't hold is counted, and every damage is named."""

from __future__ import annotations

import gzip
import os
import random
import sqlite3
import subprocess
import sys
from pathlib import Path

import can
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bus_tools.made_frames import START, frame, kept, of_every_kind
from rds.bus.tools.logs import LogFile, LogWriter
from rds.core.errors import InputError

WITHOUT_FD = ("trc", "csv", "db", "trc.gz", "csv.gz")
FORMATS = ("asc", "blf", "log", *WITHOUT_FD, "asc.gz", "log.gz")
RELATIVE = ("asc", "asc.gz")  # times begin at 0


def write(path: Path, messages: list[can.Message]) -> LogWriter:
    writer = LogWriter(path)
    for message in messages:
        writer.write(message)
    writer.close()
    return writer


def can_hold(ending: str, message: can.Message) -> bool:
    if ending.startswith("trc"):
        return not (message.is_fd or message.is_remote_frame or message.is_error_frame)
    return not (ending in WITHOUT_FD and message.is_fd)


@pytest.mark.parametrize("ending", FORMATS)
def test_what_is_written_comes_back(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"log.{ending}"
    messages = of_every_kind()
    writer = write(path, of_every_kind())
    expected = [message for message in messages if can_hold(ending, message)]
    found = list(LogFile(path))
    assert [kept(message) for message in found] == [kept(message) for message in expected]
    origin = START if ending in RELATIVE else 0.0
    for a, b in zip(found, expected, strict=True):
        assert a.timestamp == pytest.approx(b.timestamp - origin, abs=1.01e-6)
    assert sum(writer.unkept.values()) == len(messages) - len(expected)
    assert writer.frames == len(expected)


@pytest.mark.parametrize("ending", FORMATS)
def test_a_log_that_was_never_closed_is_read_to_the_last_flush(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"log.{ending}"
    program = (
        "import os, sys; from pathlib import Path; sys.path.insert(0, sys.argv[2])\n"
        "from bus_tools.made_frames import frame; from rds.bus.tools.logs import LogWriter\n"
        "log = LogWriter(Path(sys.argv[1]))\n"
        "for k in range(100):\n"
        "    log.write(frame(0x100, bytes([k]), k / 1000))\n"
        "    if k % 40 == 39: log.flush()\n"
        "os._exit(9)"
    )
    here = str(Path(__file__).resolve().parents[1])
    assert subprocess.run([sys.executable, "-c", program, str(path), here], check=False).returncode == 9
    if ending.endswith(".gz"):
        text = subprocess.run(["zcat", str(path)], capture_output=True, check=False).stdout
        path = tmp_path / f"unpacked.{ending.removesuffix('.gz')}"
        path.write_bytes(text)
    assert [message.data[0] for message in LogFile(path)] == list(range(80))


def test_flushing_often_changes_nothing(tmp_path: Path) -> None:
    messages = of_every_kind()
    for origin in (0.0, -START + 5.0):  # since the epoch, and since a device was switched on
        path = tmp_path / f"log{origin:.0f}.blf"
        log = LogWriter(path)
        for message in of_every_kind():
            message.timestamp += origin
            log.write(message)
            log.flush()
        log.close()
        found = list(LogFile(path))
        assert [kept(message) for message in found] == [kept(message) for message in messages]
        distances = [message.timestamp - found[0].timestamp for message in found]
        assert distances == pytest.approx([message.timestamp - START for message in messages], abs=1.01e-6)


def test_a_clock_that_was_set_back_stands_still(tmp_path: Path) -> None:
    write(tmp_path / "a.asc", [frame(1, at=1.0), frame(2, at=0.5), frame(3, at=2.0)])
    assert [message.timestamp for message in LogFile(tmp_path / "a.asc")] == [0.0, 0.0, 1.0]


@pytest.mark.parametrize("ending", FORMATS)
def test_an_existing_file_is_overwritten_only_when_told_so(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"log.{ending}"
    write(path, [frame(1), frame(2)])
    before = path.read_bytes()
    with pytest.raises(InputError, match="--force"):
        LogWriter(path)
    assert path.read_bytes() == before
    log = LogWriter(path, force=True)
    log.write(frame(3))
    log.close()
    assert [message.arbitration_id for message in LogFile(path)] == [3]


@pytest.mark.parametrize("name", ["a.txt", "a", "a.blf.gz", "a.gz", "a.db.gz"])
def test_an_unknown_format_is_refused(name: str, tmp_path: Path) -> None:
    for attempt in (LogWriter, LogFile):
        with pytest.raises(InputError, match=r"end the name in \.asc, \.blf"):
            attempt(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_mf4_without_its_package_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("can.io.mf4.asammdf", None)  # what python-can has where the package is missing
    monkeypatch.setitem(sys.modules, "asammdf", None)  # what Python has
    with pytest.raises(InputError, match=r"a\.mf4: an MDF file needs asammdf, .* install it with: .*; or use \.blf"):
        LogWriter(tmp_path / "a.mf4")
    assert not list(tmp_path.iterdir())
    (tmp_path / "b.mf4").write_bytes(b"MDF     4.10")
    with pytest.raises(InputError, match=r"b\.mf4: an MDF file needs asammdf"):
        list(LogFile(tmp_path / "b.mf4"))


def test_what_is_written_as_mf4_comes_back(tmp_path: Path) -> None:
    pytest.importorskip("asammdf", reason="MF4 needs the package asammdf: pip install asammdf")
    write(tmp_path / "a.mf4", of_every_kind())
    expected = sorted(kept(message) for message in of_every_kind() if not message.is_error_frame)
    found = [message for message in LogFile(tmp_path / "a.mf4") if not message.is_error_frame]
    assert sorted(kept(message) for message in found) == expected
    with can.LogReader(tmp_path / "a.mf4") as reader:  # python-can's own way
        assert sum(not message.is_error_frame for message in reader) == len(expected)


@pytest.mark.filterwarnings("error::pytest.PytestUnraisableExceptionWarning")
def test_a_damaged_mf4_is_refused_in_a_sentence(tmp_path: Path) -> None:
    """asammdf raises whatever its decoder trips over, and again in its `__del__`."""
    pytest.importorskip("asammdf")
    path = tmp_path / "a.mf4"
    write(path, of_every_kind())
    whole, drawn = path.read_bytes(), random.Random(7)
    damaged = [b"", drawn.randbytes(300), b"MDF     4.10    " + bytes(200), whole[:64], whole[: len(whole) // 2]]
    for _ in range(30):
        place = drawn.randrange(len(whole))
        damaged.append(whole[:place] + drawn.randbytes(8) + whole[place + 8 :])
    refused = 0
    for content in damaged:
        path.write_bytes(content)
        try:
            list(LogFile(path))
        except InputError as error:
            refused += 1
            assert str(path) in str(error)
    assert refused > 5


OWN_PROGRAM = """
import sys
from rds.bus.tools.mf4 import put_off_asammdf
put_off_asammdf()
from rds.bus.tools.logs import LogFile, LogWriter
import can
assert not {"asammdf", "pandas"} & set(sys.modules)
log = LogWriter(sys.argv[1])
log.write(can.Message(arbitration_id=0x12, is_extended_id=False, data=b"abc", timestamp=1.0))
log.close()
assert "asammdf" in sys.modules
assert [bytes(message.data) for message in LogFile(sys.argv[1])] == [b"abc"]
"""
USERS_INTERPRETER = """
import sys
finders = list(sys.meta_path)
from rds.bus.tools.logs import LogFile, LogWriter
import rds.bus.modules.rds.server, rds.bus.hub.builtin, rds.modes.process.target, rds.panels.jog.loop
import can
assert sys.meta_path == finders
assert "asammdf" in sys.modules and can.io.mf4.asammdf is not None
from asammdf.blocks.mdf_v3 import MDF3
from asammdf.blocks.mdf_v4 import MDF4
ends = [kind.__del__ for kind in (MDF3, MDF4)]
open(sys.argv[1], "wb").write(b"MDF     4.10    " + bytes(200))
try:
    list(LogFile(sys.argv[1]))
except rds.core.errors.InputError as error:
    assert "can't be read" in str(error)
else:
    raise AssertionError("a damaged file was read")
assert ends == [kind.__del__ for kind in (MDF3, MDF4)]
"""


@pytest.mark.parametrize("script", [OWN_PROGRAM, USERS_INTERPRETER])
def test_only_our_own_programs_put_off_the_package_of_mf4(tmp_path: Path, script: str) -> None:
    """Our programs do without it until such a log is opened; a user's interpreter is left as it is."""
    pytest.importorskip("asammdf", reason="MF4 needs the package asammdf: pip install asammdf")
    words = [sys.executable, "-c", script, str(tmp_path / "a.mf4")]
    as_a_user = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    done = subprocess.run(words, check=True, capture_output=True, text=True, env=as_a_user)
    assert not done.stderr, done.stderr


def test_there_is_no_such_log(tmp_path: Path) -> None:
    for ending in FORMATS:
        with pytest.raises(InputError, match="there is no such log"):
            LogFile(tmp_path / f"none.{ending}")
    assert not list(tmp_path.iterdir()), "SQLite makes what it doesn't find"


ASC_HEAD = "date Thu Jan 1 00:00:00.000 2026\nbase hex  timestamps absolute\ninternal events logged\n"
TRC_HEAD = ";$FILEVERSION=2.1\n;$STARTTIME=46000.5\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n"
CSV_HEAD = "timestamp,arbitration_id,extended,remote,error,dlc,data\n"


@pytest.mark.parametrize(
    "name, text, line",
    [
        ("a.log", "(1.5) can0 123#11\n(2.5) can0 123#1\n", 2),
        ("a.log", "(1.5) can0 123#11\n(2.5) can0 12", 2),
        ("a.log", "  can0  123   [2]  11 22\n", 1),
        ("a.log", "(1.5) can0 12345678#1G\n", 1),
        ("a.log", "\x89PNG\x00\xff", 1),
        ("a.csv", CSV_HEAD + "1.5,0x123,0,0,0,1,EQ==\n1.6,0x123,0,0,0\n", 3),
        ("a.csv", CSV_HEAD + "1.5,0x123,0,0,0,5,EQ==\n", 2),
        ("a.csv", CSV_HEAD + "nan,0x123,0,0,0,1,EQ==\n", 2),
        ("a.csv", "1.5,0x123,0,0,0,1,EQ==\n", 1),
        ("a.asc", ASC_HEAD + "0.5 1  123  Rx   d 1 11\n0.6 1  123  Rx   d 2 11\n", 5),
        ("a.asc", ASC_HEAD + "0.5 1  123  Rx   d\n", 4),
        ("a.asc", ASC_HEAD + "0.5 1  123  R", 4),
        ("a.asc", ASC_HEAD + "0.5 1  123", 4),
        ("a.asc", ASC_HEAD + "0.5 1", 4),
        ("a.asc", ASC_HEAD + "0.", 4),
        ("a.asc", ASC_HEAD + "0.5 1  XYZ  Rx   d 1 11\n", 4),
        ("a.trc", TRC_HEAD + "1 0.0 DT 1 0123 Rx - 2 11 22\n2 1.0 DT 1 0123 Rx - 2 11\n", 5),
        ("a.trc", TRC_HEAD + "1 0.0 DT 1 0123 Rx - 2 11 2", 4),
        ("a.trc", TRC_HEAD + "1 0.0 DT 1 0123 R", 4),
        ("a.trc", TRC_HEAD + "1 0.0\n", 4),
    ],
)
def test_a_damaged_line_is_named(name: str, text: str, line: int, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_text(text, encoding="latin-1")
    with pytest.raises(InputError) as caught:
        list(LogFile(path))
    assert str(caught.value).startswith(f"{path}:{line}: ")
    with gzip.open(f"{path}.gz", "wt", encoding="latin-1") as file:
        file.write(text)
    with pytest.raises(InputError) as caught:
        list(LogFile(Path(f"{path}.gz")))
    assert str(caught.value).startswith(f"{path}.gz:{line}: ")


@pytest.mark.parametrize("impossible", ["123#112233445566778899", "FFF#11"])
def test_a_frame_that_no_bus_could_carry_is_left_out_and_counted(impossible: str, tmp_path: Path) -> None:
    (tmp_path / "a.log").write_text(f"(1.5) can0 123#11\n(1.6) can0 {impossible}\n(1.7) can0 124#22\n")
    log = LogFile(tmp_path / "a.log")
    assert [message.arbitration_id for message in log] == [0x123, 0x124]
    assert log.impossible == 1 and log.skipped == 0


@pytest.mark.parametrize("classes", ["20000004", "20000080", "2000008C", "30000001"])
def test_candump_logs_error_frames_of_every_class(classes: str, tmp_path: Path) -> None:
    (tmp_path / "a.log").write_text(f"(1.5) can0 {classes}#0004000000000000\n(1.6) can0 00000004#11\n")
    error, data = LogFile(tmp_path / "a.log")
    assert error.is_error_frame and error.timestamp == 1.5
    assert not data.is_error_frame and (data.arbitration_id, data.is_extended_id) == (4, True)


@pytest.mark.parametrize(
    "text, line",
    [
        ("garbage\nmore\n", 1),
        ("date today\nhello\n", 2),
        ("\x89PNG\x00\xff", 1),
        (ASC_HEAD + "0.1 1 Statistic: D 1\n%", 5),
    ],
)
def test_a_file_without_frames_that_is_no_log_is_named_with_its_line(text: str, line: int, tmp_path: Path) -> None:
    path = tmp_path / "bad.asc"
    path.write_text(text, encoding="latin-1")
    with pytest.raises(InputError, match="no line of the file is a frame") as caught:
        list(LogFile(path))
    assert str(caught.value).startswith(f"{path}:{line}: ")


def test_a_log_without_frames_is_one(tmp_path: Path) -> None:
    path = tmp_path / "empty.asc"
    path.write_text(ASC_HEAD + "// comment\n0.0 Start of measurement\n0.1 1 Statistic: D 1\nEnd TriggerBlock\n")
    assert list(LogFile(path)) == []


def test_events_and_comments_are_no_damage(tmp_path: Path) -> None:
    path = tmp_path / "a.asc"
    path.write_text(
        ASC_HEAD + "// comment\n0.0 Start of measurement\n0.1 1  Statistic: D 1 R 0 XD 0 XR 0 E 0 O 0 B 0.1%\n"
        "0.2 CAN 1 Status:chip status error active\n0.3 1 123 Rx d 1 11\n\nEnd TriggerBlock\n"
        "2.200804 0 16777215 0 1 GMGroup: Marker Group GMMarker: [1] GMDescription: of Vector's own converter\n"
    )
    log = LogFile(path)
    assert len(list(log)) == 1
    assert log.skipped == 3


def test_a_cut_or_damaged_blf_is_refused_with_its_offset(tmp_path: Path) -> None:
    path = tmp_path / "a.blf"
    chance = random.Random(1)  # the same in every run: some bytes of a container may change without harm to its text
    write(path, [frame(k % 2048, chance.randbytes(8), k / 1000) for k in range(8000)])
    whole = path.read_bytes()
    assert len(list(LogFile(path))) == 8000
    for cut in (len(whole) - 100, len(whole) // 2, 150, 20, 3, 0):
        path.write_bytes(whole[:cut])
        with pytest.raises(InputError, match=r"byte \d+"):
            list(LogFile(path))
    middle = len(whole) // 2
    path.write_bytes(whole[:middle] + bytes([whole[middle] ^ 0xFF]) + whole[middle + 1 :])
    with pytest.raises(InputError, match=r"byte \d+: the container is damaged"):
        list(LogFile(path))


def test_a_cut_gzip_file_is_refused_behind_its_last_line(tmp_path: Path) -> None:
    path = tmp_path / "a.log.gz"
    write(path, [frame(1, os.urandom(8), k / 1000) for k in range(5000)])
    path.write_bytes(path.read_bytes()[:-2000])
    with pytest.raises(InputError, match=r"a\.log\.gz:\d\d\d+: "):
        list(LogFile(path))
    path.write_bytes(b"no gzip")
    with pytest.raises(InputError, match=r"can't be read"):
        list(LogFile(path))


def test_what_is_no_database_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    path.write_bytes(b"x" * 4096)
    with pytest.raises(InputError, match="not a database"):
        list(LogFile(path))
    path.unlink()
    sqlite3.connect(path).close()
    path.touch()
    with pytest.raises(InputError, match="no such table"):
        list(LogFile(path))


@given(data=st.binary(max_size=400), ending=st.sampled_from(FORMATS))
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_rubbish_is_refused_or_read_but_never_anything_else(data: bytes, ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"rubbish.{ending}"
    path.write_bytes(data)
    try:
        list(LogFile(path))
    except InputError as error:
        assert error.where is not None and error.where.startswith(str(path))


@given(cut=st.integers(0, 10_000), ending=st.sampled_from([*FORMATS[:6]]), flip=st.integers(0, 255))
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_log_with_one_wrong_byte_is_refused_or_read(cut: int, ending: str, flip: int, tmp_path: Path) -> None:
    path = tmp_path / f"wrong.{ending}"
    path.unlink(missing_ok=True)
    write(path, of_every_kind())
    whole = bytearray(path.read_bytes())
    whole[cut % len(whole)] ^= flip
    path.write_bytes(whole)
    try:
        list(LogFile(path))
    except InputError as error:
        assert error.where is not None and error.where.startswith(str(path))


def test_a_full_disk_is_said(tmp_path: Path) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full on this system")
    path = tmp_path / "a.log"
    path.symlink_to("/dev/full")
    log = LogWriter(path, force=True)
    log.write(frame(1))
    with pytest.raises(OSError, match="No space left"):
        log.flush()


@pytest.mark.parametrize("ending", ["asc", "blf", "log", "trc", "csv", "db"])
def test_a_disk_that_becomes_full_leaves_a_log_that_opens(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"log.{ending}"
    program = (
        "import random, resource, signal, sys; sys.path.insert(0, sys.argv[2])\n"
        "from bus_tools.made_frames import frame; from rds.bus.tools.logs import LogWriter\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (30_011, 30_011))\n"
        "log, chance = LogWriter(sys.argv[1]), random.Random(1)\n"
        "try:\n"
        "    for k in range(20_000):\n"
        "        log.write(frame(k % 2048, chance.randbytes(8), k / 1000))\n"
        "        if k % 40 == 39: log.flush()\n"
        "except OSError:\n"
        "    try: log.close()\n"
        "    finally: print('full at', k)\n"
    )
    here = str(Path(__file__).resolve().parents[1])
    ran = subprocess.run([sys.executable, "-c", program, str(path), here], capture_output=True, text=True, check=False)
    assert "full at" in ran.stdout, ran.stderr
    kept = [message.arbitration_id for message in LogFile(path)]
    assert kept == [k % 2048 for k in range(len(kept))]
    assert len(kept) > int(ran.stdout.split()[-1]) - 300  # without what came since the last flush, or was in a buffer


@pytest.mark.parametrize("ending", ["blf", "log", "db", "csv.gz"])
def test_a_log_has_one_writer_at_a_time(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"a.{ending}"
    first = LogWriter(path)
    first.write(frame(1))
    with pytest.raises(InputError, match="another recording is writing it"):
        LogWriter(path, force=True)
    first.write(frame(2))
    first.close()
    assert [message.arbitration_id for message in LogFile(path)] == [1, 2]
    second = LogWriter(path, force=True)
    second.write(frame(3))
    second.close()
    assert [message.arbitration_id for message in LogFile(path)] == [3]


@pytest.mark.parametrize("ending", ["asc", "blf", "log", "trc", "csv", "db"])
def test_python_can_converts_what_was_written_here(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"a.{ending}"
    write(path, [frame(0x21, bytes([k]), k / 1000) for k in range(50)])
    command = [sys.executable, "-m", "can.logconvert", str(path), str(tmp_path / "b.csv")]
    subprocess.run(command, check=True, capture_output=True)
    assert [message.data[0] for message in LogFile(tmp_path / "b.csv")] == list(range(50))
