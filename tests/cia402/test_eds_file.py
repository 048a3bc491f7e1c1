"""EDS files as makers write them: read all the same, mapped all the same, and simulated as they say."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import canopen
import pytest
from canopen.sdo import SdoAbortedError
from typer.testing import CliRunner

from rds.bus.modules.cia402.commissioned import Choices, experiment_text
from rds.bus.modules.cia402.commissioning import CommissioningOptions, Declined, commission
from rds.bus.modules.cia402.configure import library, prepare
from rds.bus.modules.cia402.eds_file import read_eds
from rds.bus.modules.cia402.settings import read_settings
from rds.cli.main import app
from rds.core.errors import InputError
from rds.machines import Machine

from .test_commissioning import Operator, Served, opened

ODD = """; made by a tool
[FileInfo]
Description=a drive
[Comments]
Line1=no number of lines
[DeviceInfo]
VendorName=Geräte
VendorNumber=
ProductName=Axis 5°
PRODUCTNUMBER=1A2B
[DummyUsage]
Dummy0005=1
[1018Sub1]
ParameterName=Vendor
DataType=7
AccessType=RO
DefaultValue=0x9A
[1018SUB2]
PARAMETERNAME=Product
datatype=0007
DefaultValue=00010
[1018]
ParameterName=Identity
ObjectType=0x9
[1003]
ParameterName=Errors
ObjectType=8
DataType=0x0007
AccessType=ro
CompactSubObj=3
[1003Name]
NrOfEntries=3
2=the second alone has a name
[603f]
ParameterName=Error code ; of CiA 402
  that goes on here
DataType=0x0006
AccessType=ro
LowLimit=
HighLimit=n/a
[1017]
ParameterName=Heartbeats, as a DCF has them
DataType=0x0006
DefaultValue=0
ParameterValue=0x64
[1018Sub3]
ParameterName=Revision
DataType=7
DefaultValue=3
ParameterValue=
[1014]
ParameterName=Emergency
DataType=0x0007
AccessType=rw
DefaultValue=0x80 + $NodeID
[1400sub1]
ParameterName=COB-ID
DataType=0x0007
AccessType=rw
DefaultValue=$NODEID+0x200
[6040]
ParameterName=Controlword
DataType=0x0006
[6040]
ParameterName=Controlword, said twice
DataType=0x0006
AccessType=rww
[2000]
ParameterName=no data type
"""


@pytest.mark.parametrize(
    "encode",
    [
        pytest.param(lambda text: text.encode(), id="utf-8"),
        pytest.param(lambda text: text.encode("latin-1"), id="latin-1"),
        pytest.param(lambda text: text.encode("utf-8-sig"), id="byte order mark"),
        pytest.param(lambda text: text.replace("\n", "\r\n").encode("cp1252"), id="Windows"),
    ],
)
def test_what_makers_write_is_read(encode: object, tmp_path: Path) -> None:
    path = tmp_path / "odd.eds"
    path.write_bytes(encode(ODD))  # type: ignore[operator]
    found = read_eds(path, 5)
    device = found.device_information
    assert (device.vendor_number, device.product_number) == (None, 0x1A2B)
    assert (device.vendor_name, device.product_name) == ("Geräte", "Axis 5°")
    assert (found[0x1018][1].default, found[0x1018][2].default) == (0x9A, 10)
    assert (found[0x1017].default, found[0x1018][3].default) == (100, 3)
    assert found[0x1003][3].data_type == 7 and 4 not in list(found[0x1003])
    assert found[0x603F].name == "Error code" and (found[0x603F].min, found[0x603F].max) == (None, None)
    assert (found[0x1014].default, found[0x1400][1].default) == (0x85, 0x205)
    assert found[0x6040].access_type == "rww" and 0x2000 not in found


@pytest.mark.parametrize(
    "text, said", [("", "no section"), ("[DeviceInfo\n", "not a readable EDS"), ("[1000]\n", "no section")]
)
def test_what_is_no_eds_is_told(text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "no.eds").write_text(text)
    with pytest.raises(InputError, match=said):
        read_eds(tmp_path / "no.eds", 5)
    with pytest.raises(InputError, match="no such EDS"):
        read_eds(tmp_path / "nowhere.eds", 5)


def test_an_eds_of_millions_of_sub_indices_is_refused(tmp_path: Path) -> None:
    arrays = (f"[{index:04X}]\nObjectType=0x8\nDataType=0x7\nCompactSubObj=254\n" for index in range(0x2000, 0x2100))
    (tmp_path / "wide.eds").write_text("[DeviceInfo]\n" + "".join(arrays))
    with pytest.raises(InputError, match=r"wide\.eds.* more than 50000 sub-indices"):
        read_eds(tmp_path / "wide.eds", 5)


def changed(folder: Path, *changes: tuple[str, str]) -> Path:
    """Our drive's EDS, otherwise."""
    text = files("rds.bus.modules.cia402").joinpath("axis.eds").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "other.eds"
    path.write_text(text)
    return path


def without(text: str, *indices: str) -> str:
    """An EDS without some objects."""
    sections = text.split("\n[")
    return "\n[".join(section for section in sections if section.split("]")[0].split("sub")[0] not in indices)


def test_a_mapping_that_is_an_array_is_written(served: Served, tmp_path: Path) -> None:
    """The library writes no entry of it: it asks for their number, which it has just set to 0."""
    text = files("rds.bus.modules.cia402").joinpath("axis.eds").read_text()
    sections = text.split("[1600]\n")
    other = tmp_path / "array.eds"
    other.write_text(sections[0] + "[1600]\n" + sections[1].replace("ObjectType=0x9", "ObjectType=0x8", 1))
    channel, nodes = served("X")
    operator = Operator(refused="switch the power on")
    with opened(channel) as bus, pytest.raises(Declined):
        commission(bus, CommissioningOptions(node=2, period=0.01, eds=other), "bench", operator, tmp_path)
    assert "mode csp" in operator.said
    assert nodes[0].drive.receive_pdos[0].mapped == [(0x6040, 0), (0x607A, 0)]


def test_a_drive_of_another_eds_has_what_that_says(served: Served, machine: Machine, tmp_path: Path) -> None:
    other = changed(
        tmp_path, ("VendorNumber=0x0\n", "VendorNumber=0x1A3\n"), ("ProductNumber=0x402", "ProductNumber=9")
    )
    other.write_text(without(other.read_text(), "6084", "608F", "6092", "1403", "1603", "6071"))
    channel, nodes = served("X", eds=other)
    nodes[0].drive.objects.values |= {
        (0x6502, 0): 0x61,
        (0x6072, 0): 100,
    }  # profile position, homing, interpolated position
    operator = Operator(refused="switch the power on")
    with opened(channel) as bus, pytest.raises(Declined):
        commission(
            bus,
            CommissioningOptions(node=2, period=0.01, eds=other, counts=1000.0),
            "bench",
            operator,
            tmp_path / "kept",
        )
    assert "vendor 0x1a3, product 0x9" in operator.said[0] and any(
        said.startswith("mode pp: it moves by profiles") for said in operator.said
    )
    for said in ("encoder ? increments", "the largest torque, 0x6072, is 100 ‰"):
        assert any(said in text for text in operator.said)
    settings = read_settings({"mode": "pp", "axis": {"X": {"node": 2, "eds": str(other)}}}, machine, ["X"])
    with opened(channel) as bus, library(bus) as network:
        prepare(network, settings, 0.01)  # 0x6084, which it lacks, is optional
    assert nodes[0].drive.objects[0x6060] == 1


@pytest.mark.parametrize("cyclic", [True, False])
def test_a_drive_without_a_list_of_modes_is_asked_by_choosing(served: Served, tmp_path: Path, cyclic: bool) -> None:
    """0x6502 is optional, and so is torque: a positioning drive need have neither the cyclic modes nor 0x6071."""
    other = tmp_path / "bare.eds"
    text = files("rds.bus.modules.cia402").joinpath("axis.eds").read_text()
    other.write_text(without(text, "6071", "6502"))
    channel, nodes = served("X", eds=other)
    writers = nodes[0].drive.objects.writers
    choose = writers[0x6060, 0]

    def chosen(value: int) -> None:
        if value in (9, 10) or (value == 8 and not cyclic):
            raise SdoAbortedError(0x06090030)
        choose(value)

    writers[0x6060, 0] = chosen
    operator = Operator(refused="switch the power on")
    with opened(channel) as bus, pytest.raises(Declined):
        commission(bus, CommissioningOptions(node=2, period=0.01, eds=other), "bench", operator, tmp_path)
    assert any(said.startswith("mode csp" if cyclic else "mode pp") for said in operator.said)
    assert "by its position loop" in operator.said[-1]
    assert nodes[0].drive.objects[0x6060] == 0  # as it was


def test_an_xdd_is_told_as_xml(tmp_path: Path) -> None:
    (tmp_path / "drive.xdd").write_text('\ufeff<?xml version="1.0" encoding="utf-8"?>\n<ISO15745ProfileContainer/>\n')
    with pytest.raises(InputError, match=r"it is XML .* export one from it"):
        read_eds(tmp_path / "drive.xdd", 2)


def test_only_drives_have_an_eds(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["machine", "serve", "mini-cnc", "--eds", str(tmp_path / "x.eds")])
    assert done.exit_code == 2 and "those of cia402 do" in done.output
    done = CliRunner().invoke(
        app, ["machine", "serve", "mini-cnc", "--dialect", "cia402", "--eds", str(tmp_path / "x.eds")]
    )
    assert done.exit_code == 2 and "no such EDS" in done.output


def test_our_own_is_read_as_the_library_reads_it() -> None:
    path = str(files("rds.bus.modules.cia402").joinpath("axis.eds"))
    ours, theirs = read_eds(path, 5), canopen.import_od(path, 5)
    assert list(ours) == list(theirs)
    assert ours[0x1A00][2].default == theirs[0x1A00][2].default and ours[0x607D][1].min == theirs[0x607D][1].min


def test_a_drive_that_moves_by_profiles_gets_steps_instead_of_a_sine() -> None:
    choices = Choices("bench", "X", "mm", (-10.0, 10.0), 0.01, "pp", 2, 1000.0)
    table = tomllib.loads(experiment_text(choices, "bench.toml", {}))
    assert (table["reference"]["kind"], table["bus"]["cia402"]["mode"]) == ("square", "pp")
    assert replace(choices, mode="csp").motion == "sine"


COMPACT = """[DeviceInfo]
VendorNumber=1
[1A00]
ParameterName=TPDO mapping
ObjectType=8
DataType=0x0007
AccessType=rw
CompactSubObj=4
[1A00Value]
NrOfEntries=2
1=0x60410010
2=0x60640020
[1016]
ParameterName=Heartbeats
ObjectType=8
DataType=0x0007
AccessType=rw
DefaultValue=7
CompactSubObj=3
[1016VALUE]
NrOfEntries=1
2=$NODEID+0x10000
[1016Name]
NrOfEntries=1
3=of the third
[1003]
ParameterName=Errors
ObjectType=8
DataType=0x0007
AccessType=ro
CompactSubObj=2
[1600]
ParameterName=RPDO mapping
ObjectType=8
DataType=0x0007
AccessType=rw
CompactSubObj=2
"""


def test_the_values_and_names_of_a_compact_array_are_those_of_its_sections(tmp_path: Path) -> None:
    (tmp_path / "drive.eds").write_text(COMPACT)
    od = read_eds(tmp_path / "drive.eds", node=5)
    defaults = {index: [od[index][k].default for k in sorted(od[index])] for index in (0x1A00, 0x1016, 0x1003, 0x1600)}
    assert defaults == {
        0x1A00: [2, 0x60410010, 0x60640020, None, None],
        0x1016: [3, 7, 0x10005, 7],
        0x1003: [None, None, None],
        0x1600: [None, None, None],
    }
    assert [od[0x1016][k].name for k in (1, 2, 3)] == ["Heartbeats", "Heartbeats", "of the third"]


@pytest.mark.parametrize("line", ["DataType=$NODEID+0x7", "CompactSubObj=$NODEID", "CompactSubObj=-1"])
def test_a_type_or_a_count_that_is_no_number_is_passed_over(tmp_path: Path, line: str) -> None:
    (tmp_path / "drive.eds").write_text(f"{COMPACT}[2000]\nParameterName=odd\nDataType=7\n{line}\n")
    od = read_eds(tmp_path / "drive.eds", node=5)
    assert [od[0x1016][k].default for k in sorted(od[0x1016])] == [3, 7, 0x10005, 7]
