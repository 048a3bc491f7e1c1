"""EDS files of any maker (CiA 306), as the `canopen` library reads them.

Makers' tools write what the library's reader stumbles over: another character set or a byte order mark, keys in
another case, numbers without 0x or with leading zeros, empty numbers, a section twice, sub-indices without their
object, compact arrays with some of their names. So the text is written anew in the form that it expects. What is no
number is left out, as if the maker had not said it.
"""

from __future__ import annotations

import configparser
import io
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import canopen

from rds.core.errors import InputError

_LARGEST = 4 << 20  # bytes of an EDS
_MOST = 50_000  # sub-indices: compact arrays describe 254 of them in a line
_INDEX = re.compile(r"([0-9a-f]{4})", re.IGNORECASE)
_SUBINDEX = re.compile(r"([0-9a-f]{4})sub([0-9a-f]{1,2})", re.IGNORECASE)
_NODE = re.compile(r"\s*\+?\s*\$nodeid\s*\+?\s*", re.IGNORECASE)
_NUMBERS = ("ObjectType", "DataType", "PDOMapping", "LowLimit", "HighLimit", "DefaultValue", "CompactSubObj")
_WORDS = ("ParameterName", "AccessType")
_DEVICE_NUMBERS = ("VendorNumber", "ProductNumber", "RevisionNumber")
_DEVICE_WORDS = ("VendorName", "ProductName")
_VARIABLE, _ARRAY, _RECORD = "7", "8", "9"
_MAPPINGS = (*range(0x1600, 0x1800), *range(0x1A00, 0x1C00))  # their number of entries may be written
_ERRORS = 0x1003  # starts without any
_TEXTS = range(0x09, 0x10)  # data types of texts, times and domains: their values stay as they are
_REALS = (0x08, 0x11)
_U8 = "0x5"

Section = dict[str, str]


def read_eds(path: str | Path, node: int) -> canopen.ObjectDictionary:
    """The object dictionary of an EDS or DCF, for a node-ID. InputError for a file that is none."""
    place = Path(path)
    if not place.is_file():
        raise InputError("there is no such EDS; check the name", str(path))
    size = place.stat().st_size
    if size > _LARGEST:
        raise InputError(f"it has {size} bytes, and an EDS has less than {_LARGEST}", str(path))
    parser = configparser.RawConfigParser(
        strict=False, allow_no_value=True, inline_comment_prefixes=(";",), delimiters=("=",)
    )
    if place.read_bytes()[:100].lstrip(b"\xef\xbb\xbf \r\n\t").startswith(b"<?xml"):
        raise InputError(
            "it is XML (an XDD, or a description for EtherCAT), and no EDS; take the maker's EDS, or export one from "
            "it, as CANopenEditor does",
            str(path),
        )
    try:
        parser.read_string(_text(place.read_bytes()))
    except configparser.Error as error:
        raise InputError(f"not a readable EDS: {' '.join(str(error).split())}", str(path)) from error
    sections = {name.strip().lower(): dict(parser[name]) for name in parser.sections()}
    if "deviceinfo" not in sections:
        raise InputError("not a readable EDS: it has no section [DeviceInfo]", str(path))
    text = io.StringIO("\n".join(_rewritten(sections, str(path))))
    text.name = "rewritten.eds"  # by whose ending the library knows the format
    try:
        return canopen.import_od(text, node)
    except Exception as error:  # the library raises whatever its parser stumbles over
        raise InputError(f"not a readable EDS: {error}", str(path)) from error


def _text(data: bytes) -> str:
    """Of an EDS, from its first section on. They have no character set: UTF-8 where it is, else that of Windows."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace")
    return text[max(text.find("["), 0) :].replace("\0", "")


def _rewritten(sections: Mapping[str, Mapping[str, str | None]], where: str) -> Iterator[str]:
    device = sections["deviceinfo"]
    yield "[DeviceInfo]"
    for key in _DEVICE_NUMBERS:
        if (value := _number(device.get(key.lower()))) is not None:
            yield f"{key}={value}"
    for key in _DEVICE_WORDS:
        yield f"{key}={_line(device.get(key.lower()))}"
    yield "[DummyUsage]"
    used = sections.get("dummyusage", {})
    for number in range(1, 8):
        yield f"Dummy{number:04d}={1 if _number(used.get(f'dummy{number:04d}')) else 0}"
    for index, thing in sorted(_objects(sections, where).items()):
        for subindex, section in sorted(thing.items(), key=lambda item: -1 if item[0] is None else item[0]):
            yield f"[{index:04X}]" if subindex is None else f"[{index:04X}sub{subindex:X}]"
            yield from (f"{key}={value}" for key, value in section.items())


def _objects(sections: Mapping[str, Mapping[str, str | None]], where: str) -> dict[int, dict[int | None, Section]]:
    """By index, the section of the object (None) and those of its sub-indices."""
    described = 0
    found: dict[int, dict[int | None, Section]] = {}
    for name, values in sections.items():
        if match := _INDEX.fullmatch(name):
            found.setdefault(int(match[1], 16), {})[None] = _section(values)
        elif match := _SUBINDEX.fullmatch(name):
            found.setdefault(int(match[1], 16), {})[int(match[2], 16)] = _section(values)
    complete: dict[int, dict[int | None, Section]] = {}
    for index, thing in found.items():
        whole = thing.setdefault(None, {"ParameterName": f"0x{index:04X}"})
        members: dict[int | None, Section] = {
            key: section for key, section in thing.items() if key is not None and "DataType" in section
        }
        count = min(max(int(whole.pop("CompactSubObj", "0")), 0), 254)
        if count and "DataType" in whole:
            members = _compact(sections, index, whole, count)
        described += len(members)
        if described > _MOST:
            raise InputError(
                f"it describes more than {_MOST} sub-indices, and no drive has so many; is it the file of this drive?",
                where,
            )
        if members:
            kind = whole.get("ObjectType")
            head = {"ParameterName": whole["ParameterName"], "ObjectType": kind if kind == _ARRAY else _RECORD}
            complete[index] = {None: head, **{key: _variable(section) for key, section in members.items()}}
        elif "DataType" in whole:
            complete[index] = {None: _variable(whole)}
    return complete


def _compact(
    sections: Mapping[str, Mapping[str, str | None]], index: int, whole: Section, count: int
) -> dict[int | None, Section]:
    """The sub-indices of a compact array: as its object, but for the names and values that sections of their own list.

    How many entries there are is the array's length; of a mapping as far as entries are listed, of errors nothing.
    """
    names, values = (sections.get(f"{index:04x}{what}", {}) for what in ("name", "value"))
    access = whole.get("AccessType", "ro") if index in _MAPPINGS else "ro"
    members: dict[int | None, Section] = {0: {"ParameterName": "Entries", "DataType": _U8, "AccessType": access}}
    listed = [place for place in range(1, count + 1) if values.get(str(place))]
    entries = max(listed, default=0) if index in _MAPPINGS else count
    if entries and index != _ERRORS:
        members[0]["DefaultValue"] = str(entries)
    for place in range(1, count + 1):
        own = {"datatype": whole["DataType"], "defaultvalue": values.get(str(place))} if place in listed else {}
        members[place] = (
            whole | _section(own) | {"ParameterName": _line(names.get(str(place))) or whole["ParameterName"]}
        )
    return members


def _variable(section: Section) -> Section:
    return {"ParameterName": "", "AccessType": "rw", **section, "ObjectType": _VARIABLE}


def _section(values: Mapping[str, str | None]) -> Section:
    """What an object's section says, with keys and numbers as the library wants them."""
    found = {key: word for key in _WORDS if (word := _line(values.get(key.lower())))}
    found.setdefault("ParameterName", "no name")
    for key in _NUMBERS:
        text = _line(values.get(key.lower()))
        if key == "DefaultValue":  # a DCF has what the drive was set to besides
            text = _line(values.get("parametervalue")) or text
        kind = int(found.get("DataType", "0"), 0)
        is_value = key in ("DefaultValue", "LowLimit", "HighLimit")
        if is_value and (kind in _TEXTS or kind in _REALS):
            if text:
                found[key] = text
            continue
        is_relative = is_value and _NODE.search(text) is not None  # of a type or a count it would be no number
        stripped = (_NODE.sub("", text) or "0") if is_relative else text
        if (number := _number(stripped)) is not None:
            found[key] = f"$NODEID+{number}" if is_relative else str(number)
    return found


def _line(value: str | None) -> str:
    """The first line of a value: what the next, indented ones say is no part of it."""
    lines = (value or "").strip().splitlines()
    return lines[0].strip() if lines else ""


def _number(value: str | None) -> int | None:
    """A number of CiA 306, 0x for hexadecimal; also one with leading zeros, and one that only hexadecimal can be."""
    text = _line(value).replace(" ", "")
    for base in (0, 10, 16):
        try:
            return int(text, base)
        except ValueError:
            continue
    return None
