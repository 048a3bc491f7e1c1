"""Message tables of others: DBC files and CSV tables, analysed as our machines are."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rds.bus import read_messages
from rds.bus.analysis.message_tables import is_message_table
from rds.cli.main import app
from rds.core.errors import InputError

DBC = """VERSION ""

BU_: ENGINE

BO_ 256 Speed: 8 ENGINE
 SG_ rpm : 0|16@1+ (1,0) [0|0] "" ENGINE

BO_ 2566844926 Status: 8 ENGINE
 SG_ load : 0|8@1+ (1,0) [0|0] "" ENGINE

BO_ 512 OnChange: 2 ENGINE
 SG_ lamp : 0|8@1+ (1,0) [0|0] "" ENGINE

BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 256 10;
BA_ "GenMsgCycleTime" BO_ 2566844926 100;
"""


def test_a_dbc_file_is_analysed_and_messages_without_a_period_are_named(tmp_path: Path) -> None:
    (tmp_path / "car.dbc").write_text(DBC)
    done = CliRunner().invoke(
        app, ["bus", "analyse", str(tmp_path / "car.dbc"), "--bitrate", "250000", "--json"], catch_exceptions=False
    )
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert [(row["name"], row["identifier"], row["period_us"]) for row in found["messages"]] == [
        ("Speed", 256, 10_000.0),
        ("Status", 0x18FEF1FE, 100_000.0),
    ]
    assert found["messages"][1]["extended"] and found["without_period"] == ["OnChange"]
    # 8 bytes: at most 135 bits in 10 ms, and 160 in 100 ms, of 250 kbit/s
    assert found["worst_load_percent"] == pytest.approx(100 * (135 / 0.01 + 160 / 0.1) / 250e3, abs=0.01)
    assert "OnChange" in done.stderr


def test_a_message_of_a_transport_protocol_is_left_out_and_named(tmp_path: Path) -> None:
    """J1939's DM1 of 20 bytes has no frame of its own; the others of the file are analysed as without it."""
    long = 'BO_ 2566834709 Faults: 20 Gateway\n SG_ Lamp : 0|8@1+ (1,0) [0|255] "" Gateway\n\n'
    (tmp_path / "car.dbc").write_text(DBC)
    (tmp_path / "truck.dbc").write_text(DBC.replace("BO_ 256 ", f"{long}BO_ 256 ", 1))
    car, truck = (
        CliRunner().invoke(app, ["bus", "analyse", str(tmp_path / name), "--json"], catch_exceptions=False)
        for name in ("car.dbc", "truck.dbc")
    )
    assert truck.exit_code == 0 and "more than 8 bytes" in truck.stderr and "Faults" in truck.stderr
    found = json.loads(truck.stdout)
    assert found["transported"] == ["Faults"] and found["messages"] == json.loads(car.stdout)["messages"]


def test_a_file_of_transported_messages_alone_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "truck.dbc"
    path.write_text('VERSION ""\nBU_: Gateway\nBO_ 2566834709 Faults: 20 Gateway\n')
    with pytest.raises(InputError, match=r"Faults has more than 8 bytes, .* VFrameFormat"):
        read_messages(path, 0.1)


def test_a_can_fd_message_switches_the_bit_rate_unless_the_file_says_no(tmp_path: Path) -> None:
    formats = ",".join(f'"{name}"' for name in ("StandardCAN", "ExtendedCAN", *["reserved"] * 12, "StandardCAN_FD"))
    fd = f"""{DBC}BA_DEF_ BO_ "VFrameFormat" ENUM {formats};
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_ "VFrameFormat" BO_ 256 14;
BA_ "VFrameFormat" BO_ 512 14;
"""
    switch = 'BA_DEF_ BO_ "CANFD_BRS" ENUM "0","1";\nBA_DEF_DEF_ "CANFD_BRS" "{}";\nBA_ "CANFD_BRS" BO_ 512 {};\n'
    for more, switched in (
        ("", (True, True)),
        (switch.format(1, 0), (True, False)),
        (switch.format(0, 1), (False, True)),
        (switch.replace('"0","1"', '"No","Yes"').format("No", 1), (False, True)),
    ):
        (tmp_path / "car.dbc").write_text(fd + more)
        found = {m.name: m for m in read_messages(tmp_path / "car.dbc", period=0.1).messages}
        assert found["Speed"].fd and not found["Status"].fd
        assert (found["Speed"].bitrate_switch, found["OnChange"].bitrate_switch) == switched


def test_a_csv_table_says_the_same(tmp_path: Path) -> None:
    (tmp_path / "car.csv").write_text(
        "identifier;period_ms;length;name;jitter_us\n0x100;10;8;Speed;50\n# slow ones\n0x18FEF1FE;100;8;Status;\n"
    )
    table = read_messages(tmp_path / "car.csv").messages
    assert [(m.name, m.extended, m.period, m.jitter) for m in table] == [
        ("Speed", False, 0.01, pytest.approx(50e-6)),
        ("Status", True, 0.1, 0.0),
    ]


def test_a_period_for_those_without_one(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("identifier,length\n1,8\n2,0\n")
    assert [m.period for m in read_messages(tmp_path / "a.csv", 0.02).messages] == [0.02, 0.02]
    with pytest.raises(InputError, match="--sample-period"):
        read_messages(tmp_path / "a.csv")


@pytest.mark.parametrize(
    "text, said",
    [
        ("identifier,period_ms\n1,8\n", "no column length"),
        ("identifier,period,length\n1,8,8\n", "has the column 'period'"),
        ("identifier,period_ms,period_s,length\n1,1,1,8\n", "a.csv:1: period is given twice"),
        ("identifier,length,period_ms,length\n1,8,1,4\n", "a.csv:1: length is given twice"),
        ("identifier,length,period_ms\n1,8,1\n2,99,1\n", "a.csv:3: message '0x2': 99 bytes with dlc 99 are no classic"),
        ("identifier,length,period_ms\n1,-1,1\n", "a.csv:2: message '0x1': -1 bytes"),
        (f"identifier,length,period_ms,name\n1,8,1,{'x' * 200_000}\n", "a.csv:2: the line cannot be read"),
        ("identifier,length,period_us\n1,8,0.0001\n", "a.csv:2: .* must be at least 1e-9 and less than 1e6"),
        ("identifier,period_ms,length\n1,10,8\nfast,10,8\n", ":3: identifier 'fast'"),
        ("identifier,period_ms,length\n1,10\n", ":2: the line has 2 columns"),
        ("identifier,period_ms,length\n# one\n\n1,10,8\nfast,10,8\n", ":5: identifier 'fast'"),
        ("identifier,period_ms,length\n", "no messages in it"),
        ("identifier,period_ms,length\n1,10,9\n", "9"),
        ("identifier,period_ms,length\n1,0,8\n", "--sample-period"),
    ],
)
def test_a_table_that_will_not_do_is_told_by_its_line(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError, match=said):
        read_messages(tmp_path / "a.csv")


def test_options_of_machines_are_refused_for_tables(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["bus", "analyse", str(tmp_path / "car.dbc"), "--fits"])
    assert done.exit_code == 2 and "--fits is for a machine" in done.stderr
    done = CliRunner().invoke(app, ["bus", "analyse", str(tmp_path / "car.dbc"), "--period", "0.01", "--units", "5"])
    assert done.exit_code == 2 and "--units is for a machine" in done.stderr


def test_other_databases_are_converted_by_cantools() -> None:
    with pytest.raises(InputError, match=r"convert it: `cantools convert car\.kcd car\.dbc`, and name car\.dbc"):
        is_message_table(Path("car.kcd"))


@pytest.mark.parametrize(("kind", "value"), [("STRING", '"fast"'), ("INT 0 0", "1" + "0" * 400), ("INT 0 0", "-5")])
def test_a_cycle_time_that_is_none_counts_as_not_given(tmp_path: Path, kind: str, value: str) -> None:
    text = DBC.replace("INT 0 65535", kind).replace(" 256 10;", f" 256 {value};")
    if kind == "STRING":
        text = text.replace('"GenMsgCycleTime" 0;', '"GenMsgCycleTime" "";').replace(" 100;", ' "";')
    (tmp_path / "car.dbc").write_text(text)
    found = read_messages(tmp_path / "car.dbc", period=0.01)
    assert {message.name: message.period for message in found.messages}["Speed"] == 0.01
