"""axis.eds against CiA 306 (form), CiA 301 and CiA 402 (objects), and against the drive that it describes."""

from __future__ import annotations

import configparser
import importlib.util
import logging
import subprocess
import sys
from importlib.resources import files

import canopen
import pytest
from canopen.objectdictionary import ODVariable, datatypes
from canopen.objectdictionary.datatypes import INTEGER_TYPES

from .conftest import Abort, Rig

PATH = str(files("rds.bus.modules.cia402").joinpath("axis.eds"))
U8, U16, U32, I8, I16, I32 = (
    datatypes.UNSIGNED8,
    datatypes.UNSIGNED16,
    datatypes.UNSIGNED32,
    datatypes.INTEGER8,
    datatypes.INTEGER16,
    datatypes.INTEGER32,
)
# index, sub-index: data type, may be written, may be mapped (CiA 301, 7.5.2; CiA 402 object descriptions)
OBJECTS = {
    (0x1000, 0): (U32, False, False),
    (0x1001, 0): (U8, False, True),
    (0x1003, 0): (U8, True, False),
    (0x1003, 1): (U32, False, False),
    (0x1005, 0): (U32, True, False),
    (0x1006, 0): (U32, True, False),
    (0x1014, 0): (U32, True, False),
    (0x1016, 1): (U32, True, False),
    (0x1017, 0): (U16, True, False),
    (0x1018, 1): (U32, False, False),
    (0x1018, 4): (U32, False, False),
    (0x1019, 0): (U8, True, False),
    (0x1029, 1): (U8, True, False),
    **{(0x1400 + n, 1): (U32, True, False) for n in range(4)},
    **{(0x1400 + n, 2): (U8, True, False) for n in range(4)},
    **{(0x1600 + n, 0): (U8, True, False) for n in range(4)},
    **{(0x1600 + n, 8): (U32, True, False) for n in range(4)},
    **{(0x1800 + n, 1): (U32, True, False) for n in range(4)},
    **{(0x1800 + n, 3): (U16, True, False) for n in range(4)},
    **{(0x1800 + n, 5): (U16, True, False) for n in range(4)},
    **{(0x1A00 + n, 8): (U32, True, False) for n in range(4)},
    (0x6007, 0): (I16, True, False),
    (0x603F, 0): (U16, False, True),
    (0x6040, 0): (U16, True, True),
    (0x6041, 0): (U16, False, True),
    (0x605A, 0): (I16, True, False),
    (0x605B, 0): (I16, True, False),
    (0x605C, 0): (I16, True, False),
    (0x605E, 0): (I16, True, False),
    (0x6060, 0): (I8, True, True),
    (0x6061, 0): (I8, False, True),
    (0x6064, 0): (I32, False, True),
    (0x6065, 0): (U32, True, False),
    (0x6066, 0): (U16, True, False),
    (0x6067, 0): (U32, True, False),
    (0x6068, 0): (U16, True, False),
    (0x606C, 0): (I32, False, True),
    (0x6071, 0): (I16, True, True),
    (0x6072, 0): (U16, True, True),
    (0x6077, 0): (I16, False, True),
    (0x607A, 0): (I32, True, True),
    (0x607C, 0): (I32, True, False),
    (0x607D, 1): (I32, True, False),
    (0x607D, 2): (I32, True, False),
    (0x6081, 0): (U32, True, True),
    (0x6083, 0): (U32, True, True),
    (0x6084, 0): (U32, True, True),
    (0x608F, 1): (U32, False, False),
    (0x6091, 1): (U32, False, False),
    (0x6092, 1): (U32, False, False),
    (0x6098, 0): (I8, True, False),
    (0x6099, 1): (U32, True, False),
    (0x6099, 2): (U32, True, False),
    (0x609A, 0): (U32, True, False),
    (0x60C2, 1): (U8, True, False),
    (0x60C2, 2): (I8, True, False),
    (0x60F4, 0): (I32, False, True),
    (0x60FD, 0): (U32, False, True),
    (0x60FF, 0): (I32, True, True),
    (0x6502, 0): (U32, False, False),
}


@pytest.fixture(scope="module")
def text() -> configparser.RawConfigParser:
    parser = configparser.RawConfigParser(strict=True)
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read(PATH)
    return parser


@pytest.fixture(scope="module")
def objects() -> canopen.ObjectDictionary:
    return canopen.import_od(PATH, 5)


def variables(objects: canopen.ObjectDictionary) -> list[ODVariable]:
    return [v for thing in objects.values() for v in ([thing] if isinstance(thing, ODVariable) else thing.values())]


def test_the_library_loads_it_without_a_word(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        canopen.import_od(PATH, 5)
    assert not caplog.records


@pytest.mark.parametrize(
    "section, keys",
    [
        ("FileInfo", "FileName FileVersion FileRevision EDSVersion CreatedBy CreationDate CreationTime"),
        ("DeviceInfo", "VendorName VendorNumber ProductName ProductNumber RevisionNumber Granularity NrOfRXPDO"),
        ("DeviceInfo", "NrOfTXPDO LSS_Supported SimpleBootUpSlave SimpleBootUpMaster DynamicChannelsSupported"),
        ("DeviceInfo", "BaudRate_125 BaudRate_250 BaudRate_500 BaudRate_1000 GroupMessaging"),
        ("DummyUsage", " ".join(f"Dummy{n:04d}" for n in range(1, 8))),
        ("Comments", "Lines"),
        ("MandatoryObjects", "SupportedObjects"),
    ],
)
def test_mandatory_sections_and_keys(text: configparser.RawConfigParser, section: str, keys: str) -> None:
    for key in keys.split():
        assert text.has_option(section, key), f"[{section}] {key}"


def test_every_listed_object_has_its_section_and_every_section_is_listed(text: configparser.RawConfigParser) -> None:
    listed = []
    for section in ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects"):
        count = int(text[section]["SupportedObjects"])
        assert len(text[section]) == count + 1
        listed += [int(text[section][str(place)], 0) for place in range(1, count + 1)]
    there = [int(section, 16) for section in text.sections() if len(section) == 4]
    assert sorted(listed) == sorted(there) and len(set(listed)) == len(listed)
    assert {0x1000, 0x1001, 0x1018} <= set(listed)


def test_every_object_says_what_cia_306_wants(text: configparser.RawConfigParser) -> None:
    for name in text.sections():
        if len(name) != 4 and "sub" not in name:
            continue
        section = text[name]
        assert section["ParameterName"] and len(section["ParameterName"]) <= 241
        if section["ObjectType"] == "0x7":
            assert section["AccessType"] in ("ro", "wo", "rw", "rwr", "rww", "const")
            assert section["PDOMapping"] in ("0", "1")
            int(section["DataType"], 0)
            assert ("LowLimit" in section) == ("HighLimit" in section)
        else:
            assert section["ObjectType"] in ("0x8", "0x9")
            subs = [other for other in text.sections() if other.startswith(f"{name}sub")]
            assert int(section["SubNumber"]) == len(subs)
            highest = int(text[f"{name}sub0"]["DefaultValue"], 0)
            assert max(int(sub[7:], 16) for sub in subs) == highest or name.startswith(("16", "1A", "1003"))


@pytest.mark.parametrize("key", OBJECTS, ids=lambda key: f"{key[0]:04X}:{key[1]:02X}")
def test_objects_are_as_the_standards_say(objects: canopen.ObjectDictionary, key: tuple[int, int]) -> None:
    variable = objects.get_variable(*key)
    assert variable is not None
    assert (variable.data_type, variable.writable, variable.pdo_mappable) == OBJECTS[key]


def test_defaults_are_within_their_limits(objects: canopen.ObjectDictionary) -> None:
    for variable in variables(objects):
        if variable.data_type in INTEGER_TYPES and variable.index >= 0x1000:
            assert variable.default is not None, variable.qualname
            assert variable.min is None or variable.min <= variable.default <= variable.max, variable.qualname
            assert variable.decode_raw(variable.encode_raw(variable.default)) == variable.default


def test_identifiers_follow_the_node(objects: canopen.ObjectDictionary) -> None:
    assert objects[0x1014].default == 0x85
    assert objects[0x1200][1].default == 0x605
    assert objects[0x1400][1].default == 0x205
    assert objects[0x1800][1].default == 0x40000185
    assert objects[0x1803][1].default == 0xC0000485


def test_supported_modes_are_those_of_the_profile(objects: canopen.ObjectDictionary) -> None:
    assert objects[0x6502].default == sum(1 << mode - 1 for mode in (1, 3, 6, 8, 9, 10))
    assert objects[0x1000].default & 0xFFFF == 402


def test_the_drive_has_every_object_of_its_eds(rig: Rig, objects: canopen.ObjectDictionary) -> None:
    for variable in variables(objects):
        if variable.data_type == datatypes.VISIBLE_STRING or variable.index < 0x1000:
            continue
        rig.read(variable.index, variable.subindex)
        if not variable.writable:
            with pytest.raises(Abort) as refused:
                rig.write(variable.index, 0, len(variable) // 8, variable.subindex)
            assert refused.value.code == 0x06010002


def test_an_independent_checker_finds_nothing() -> None:
    if importlib.util.find_spec("eds_utils") is None:
        pytest.skip("eds-utils is not installed")
    script = "import sys; from eds_utils.eds_validate import eds_validate; eds_validate(sys.argv[1:])"
    done = subprocess.run([sys.executable, "-c", script, PATH], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout + done.stderr) == (0, "")
