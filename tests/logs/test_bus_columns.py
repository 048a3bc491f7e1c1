"""Columns of bus logs: never two signals in one, never times out of order, and a reason for what was left out."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import can
import pytest

from rds.bus.modules.rds.frames import COMMAND
from rds.bus.tools.decode import load_dbc
from rds.core.errors import InputError
from rds.identification.logs.describe import describe
from rds.identification.logs.log import Gravity, Log
from rds.identification.logs.read_log import read_log
from tests.logs.data_files import axis, write
from tests.logs.test_formats import DBC

MAP = """
[bus]
dbc = ["a.dbc", "b.dbc"]
[axis.X]
command = "Drive.Voltage"
position = "Encoder.Position"
"""
Frame = tuple[float, int, bytes]


def frames(shift: int = 0, samples: int = 200) -> list[Frame]:
    """Time (s), identifier and data of a drive's and an encoder's frames."""
    made, found = axis(samples), list[Frame]()
    for t, u, y in zip(made["time"].tolist(), made["voltage"], made["position"], strict=True):
        found.append((t, 256 + shift, round(u * 1000).to_bytes(2, "little", signed=True) + bytes(6)))
        found.append((t + 1e-4, 257 + shift, round(y * 1000).to_bytes(4, "little", signed=True) + bytes(4)))
    return found


def logged(folder: Path, sent: Iterable[Frame], second: str = "", mapping: str = MAP) -> Log:
    with can.CanutilsLogWriter(folder / "bus.log") as writer:
        for t, identifier, data in sent:
            writer(can.Message(timestamp=1e3 + t, arbitration_id=identifier, data=data, is_extended_id=False))
    (folder / "a.dbc").write_text(DBC)
    (folder / "b.dbc").write_text(second or DBC)
    (folder / "bus.log.map.toml").write_text(mapping)
    (log,) = read_log(folder / "bus.log")
    return log


def test_messages_of_one_name_are_never_one_column(tmp_path: Path) -> None:
    second = DBC.replace("BO_ 256", "BO_ 512").replace("BO_ 257", "BO_ 513")
    assert len(logged(tmp_path, frames(), second)) == 200
    with pytest.raises(InputError, match=r"Drive\.Voltage is in frames of 0x100 and of 0x200"):
        logged(tmp_path, sorted(frames() + frames(256)), second)


def test_an_identifier_with_two_descriptions_is_refused(tmp_path: Path) -> None:
    assert len(logged(tmp_path, frames(), DBC)) == 200
    with pytest.raises(InputError, match=r"b\.dbc: identifier 0x101 is 'Encoder' there, and 'Encoder' in a\.dbc"):
        logged(tmp_path, frames(), DBC.replace("0|32@1- (0.001,0)", "0|32@1- (0.01,0)"))


def test_commands_out_of_order_are_refused(tmp_path: Path) -> None:
    sent = frames()
    sent[100], sent[102] = sent[102], sent[100]
    with pytest.raises(InputError, match=r"the time of command goes back at sample 51, from 0\.051"):
        logged(tmp_path, sent)


@pytest.mark.parametrize("line", ["rate = 1000.0", 'column = "Drive.Voltage"'])
def test_a_time_of_its_own_is_refused(tmp_path: Path, line: str) -> None:
    with pytest.raises(InputError, match="is a bus log, whose times are those of receipt; leave"):
        logged(tmp_path, frames(), mapping=f"[time]\n{line}\n{MAP}")


def test_the_first_frame_that_does_not_fit_says_why(tmp_path: Path) -> None:
    sent = frames()
    sent[-1] = (*sent[-1][:2], b"ab")
    log = logged(tmp_path, sent)
    assert len(log) == 199
    assert any("1 frames do not fit" in f.what and "the first 0x101: Wrong data size" in f.what for f in log.findings)


def test_a_log_that_ends_in_a_line_is_cut(tmp_path: Path) -> None:
    assert not [f for f in logged(tmp_path, frames()).findings if f.kind == "cut"]
    whole = (tmp_path / "bus.log").read_bytes()
    (tmp_path / "bus.log").write_bytes(whole[:-3])
    (log,) = read_log(tmp_path / "bus.log")
    assert [f.gravity for f in log.findings if f.kind == "cut"] == ["warning"]


def test_a_log_without_frames_says_so(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="it holds no frames"):
        logged(tmp_path, [])


@pytest.mark.parametrize(
    ("name", "head", "line"),
    [
        (
            "savvy.csv",
            "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8",
            "{us},{id:08X},false,Rx,0,8,{bytes},",
        ),
        ("old.csv", "Time Stamp,ID,Extended,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8", "{us},{id:08X},false,0,8,{bytes},"),
        ("candump.txt", "(0.000000) can0 7FF#00", "({s:.6f}) can0 {id:03X}#{hex}"),
        ("shown.txt", " (0.000000)  can0  7FF   [1]  00", " ({s:.6f})  can0  {id:03X}   [8]  {blanks}"),
        ("microchip.can", "//---------------------------------", "{ms};RX;{id:#x};8;{semicolons};;;;;;;;;"),
    ],
)
def test_logs_of_other_tools_become_columns(name: str, head: str, line: str, tmp_path: Path) -> None:
    lines = [head]
    for t, identifier, data in frames():
        cells = [f"{byte:02X}" for byte in data]
        lines.append(
            line.format(
                us=round(t * 1e6),
                ms=f"{t * 1e3:.3f}",
                s=t,
                id=identifier,
                bytes=",".join(cells),
                semicolons=";".join(cells),
                blanks=" ".join(cells),
                hex="".join(cells),
            )
        )
    (tmp_path / name).write_text("\n".join(lines) + "\n")
    (tmp_path / "a.dbc").write_text(DBC)
    (tmp_path / f"{name}.map.toml").write_text(MAP.replace('["a.dbc", "b.dbc"]', '"a.dbc"'))
    (log,) = read_log(tmp_path / name)
    made = axis(200)
    assert len(log) == 200 and abs(log.position - made["position"]).max() < 6e-4


def test_frames_that_are_read_as_our_own_are_said_to_be(tmp_path: Path) -> None:
    """Another bus may use the identifiers of our modules for something else: a car's log is no log of voltages."""

    def said(sent: list[tuple[int, bytes]]) -> tuple[Gravity, str]:
        with can.CanutilsLogWriter(tmp_path / "car.log") as writer:
            for k, (identifier, data) in enumerate(sent):
                writer(can.Message(timestamp=1e3 + k, arbitration_id=identifier, data=data, is_extended_id=False))
        findings = describe(tmp_path / "car.log").findings
        return next((f.gravity, f.what) for f in findings if "no DBC file is given" in f.what)

    voltages = (COMMAND, bytes(8))
    gravity, what = said([voltages] * 3)
    assert gravity is Gravity.NOTE and "RDS's own modules (command)" in what and 'dbc = "axes.dbc"' in what
    assert said([voltages, (0x7F3, bytes(8)), voltages])[0] is Gravity.WARNING


def test_a_log_of_frames_that_no_bus_could_carry_is_told_as_that(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("Time Stamp,ID,Extended,Bus,LEN,D1\n1000,00000900,false,0,1,FE,\n")
    with pytest.raises(InputError, match="no bus could carry any of its 1 frames"):
        read_log(tmp_path / "a.csv")


@pytest.mark.parametrize("coding", ["cp1252", "utf-8", "utf-8-sig"])
def test_units_of_a_dbc_are_read_in_the_coding_that_it_is_in(tmp_path: Path, coding: str) -> None:
    """Vector's tools write code page 1252, many others UTF-8."""
    path = tmp_path / "axes.dbc"
    path.write_bytes(DBC.replace('"mm"', '"µm"').encode(coding))
    units = {signal.unit for message in load_dbc(path).messages for signal in message.signals}
    assert "µm" in units and not any("Â" in unit for unit in units if unit)


GVRET_HEAD = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"


@pytest.mark.parametrize(
    ("name", "head", "row"),
    [
        ("bus.log", "", "({t:.6f}) can{c} {i:03X}#{d}\n"),
        ("bus.asc", "base hex  timestamps absolute\nno internal events logged\n", "{t:.6f} {c} {i:X} Rx d 8 {s}\n"),
        ("bus.txt", "", " ({t:.6f})  can{c}  {i:03X}   [8]  {s}\n"),
        ("bus.csv", GVRET_HEAD, "{m},{i:08X},false,Rx,{c},8,{b}\n"),
        ("bus.crtd", "0.000 CXX made\n", "{t:.6f} {c}R11 {i:X} {s}\n"),
    ],
)
@pytest.mark.parametrize("channels", [1, 2])
def test_two_channels_of_a_recorder_are_never_one_column(
    tmp_path: Path, name: str, head: str, row: str, channels: int
) -> None:
    """Two axes of one kind on two buses use the same identifiers."""
    text = head
    for at, (t, i, data) in enumerate(frames()):
        s = data.hex(" ").upper()
        c, b, m = 1 + at // 2 % channels, s.replace(" ", ","), round(t * 1e6)
        text += row.format(t=t + 1, m=m, c=c, i=i, d=data.hex(), s=s, b=b)
    (tmp_path / name).write_text(text)
    (tmp_path / "a.dbc").write_text(DBC)
    (tmp_path / f"{name}.map.toml").write_text(MAP.replace(', "b.dbc"', ""))
    if channels == 1:
        assert len(read_log(tmp_path / name)[0]) == 200
    else:
        with pytest.raises(InputError, match=r"Drive\.Voltage \(0x100\) was received on two channels"):
            read_log(tmp_path / name)


def test_a_bus_log_is_a_second_file_whose_offset_is_stated(tmp_path: Path) -> None:
    logged(tmp_path, frames())
    made = axis(200)
    write(tmp_path / "host.csv", {"time [s]": made["time"] + 0.5, "u [V]": made["voltage"]})
    (tmp_path / "host.csv.map.toml").write_text("""
time = { column = "time" }
bus = { dbc = "a.dbc" }
second = { file = "bus.log", offset = 0.5, drift = 1e-6 }
[axis.X]
command = "u"
position = { column = "Encoder.Position", second = true }
""")
    (log,) = read_log(tmp_path / "host.csv")
    assert len(log) >= 198 and abs(log.time[0] - 0.5) < 2e-3
