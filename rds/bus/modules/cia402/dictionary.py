"""A device's object dictionary: what its EDS says, the values now, and the rules of access (CiA 301, 7.4)."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import canopen
from canopen.objectdictionary import ODVariable, datatypes
from canopen.objectdictionary.datatypes import NUMBER_TYPES
from canopen.sdo import SdoAbortedError

from rds.bus.modules.cia402.codes import Abort
from rds.bus.modules.cia402.eds_file import read_eds

Key = tuple[int, int]  # index, sub-index
_NO_PARAMETERS = (0x1003, 0x1010, 0x1011, 0x6040, 0x6060, 0x6071, 0x607A, 0x60FF)  # errors, orders, targets
_AS_LEFT = (0x6072, 0x607D, 0x6502)  # limits and modes in which a drive of another EDS differs from ours
_IDENTITY = 0x1018
_PDO_COMMUNICATION, _DOES_NOT_EXIST = ((0x1400, 0x1600), (0x1800, 0x1A00)), 1 << 31
_EMPTY = {
    datatypes.VISIBLE_STRING: "",
    datatypes.UNICODE_STRING: "",
    datatypes.OCTET_STRING: b"",
    datatypes.DOMAIN: b"",
}


def axis_eds(node: int) -> canopen.ObjectDictionary:
    """The object dictionary of the simulated drive, `axis.eds`, for a node-ID from 1 to 127."""
    with as_file(files("rds.bus.modules.cia402").joinpath("axis.eds")) as path:
        return canopen.import_od(str(path), node)


@cache
def _axis_variables(node: int) -> dict[Key, ODVariable]:
    # below 0x1000 are data types, the dummies for mappings among them, but no objects
    return {(v.index, v.subindex): v for v in _variables(axis_eds(node)) if v.index >= 0x1000}


def _variables(objects: canopen.ObjectDictionary) -> list[ODVariable]:
    found: list[ODVariable] = []
    for thing in objects.values():
        found.extend([thing] if isinstance(thing, ODVariable) else thing.values())
    return found


@cache
def _described(eds: Path, node: int) -> dict[Key, ODVariable]:
    """The objects of another drive's EDS: those that ours has, with the access that it says, and others.

    Data types and limits of ours stay, which are those of CiA 402, whatever the EDS says.
    """
    described = read_eds(eds, node)
    said, ours = described.device_information, _axis_variables(node)
    found: dict[Key, ODVariable] = {}
    for other in _variables(described):
        key = other.index, other.subindex
        if other.index < 0x1000 or (other.data_type not in NUMBER_TYPES and other.data_type not in _EMPTY):
            continue
        found[key] = variable = copy(ours.get(key, other))
        variable.access_type, variable.pdo_mappable = other.access_type, other.pdo_mappable
        is_said = key not in ours or other.index < 0x2000 or other.index in _AS_LEFT
        if is_said and other.default is not None and not (variable.max is not None and other.default > variable.max):
            variable.default = other.default
    for place, value in ((1, said.vendor_number), (2, said.product_number), (3, said.revision_number)):
        if value is not None and (_IDENTITY, place) in found:
            found[_IDENTITY, place].default = value
    if (0x1008, 0) in found:
        found[0x1008, 0].default = said.product_name or "a drive"  # type: ignore[assignment]  # a text
    return found


class Dictionary:
    """The objects of the simulated drive with node-ID `node`; with another drive's `eds`, those that it has.

    `values` holds what is neither computed nor text, by (index, sub-index). A reader computes an object's value when
    it is asked for; a writer takes a new value before it is stored, and may refuse it by SdoAbortedError.
    """

    def __init__(self, node: int, eds: Path | None = None):
        ours = _axis_variables(node)
        self.variables = self.object_dictionary = ours if eds is None else _described(eds, node)
        self._hidden = {key: variable for key, variable in ours.items() if key not in self.variables}
        self._indices = {index for index, _ in self.variables}
        self.values: dict[Key, Any] = {}
        self.readers: dict[Key, Callable[[], Any]] = {}
        self.writers: dict[Key, Callable[[Any], None]] = {}
        self._stored: dict[Key, Any] = {}  # what is there when it is switched on again, instead of the EDS's values
        self.reset()

    def reset(self, lowest: int = 0, highest: int = 0xFFFF) -> None:
        """Values as in the EDS, for the objects from `lowest` to `highest`."""
        for key, variable in (self._hidden | self.variables).items():
            if lowest <= key[0] <= highest:
                nothing = _EMPTY.get(variable.data_type or 0, 0)
                default = nothing if variable.default is None else variable.default
                self.values[key] = self._stored.get(key, default)
        for first, last in _PDO_COMMUNICATION:
            for index in range(first, last):
                if (index, 1) in self._hidden:  # a PDO that this EDS does not have
                    self.values[index, 1] |= _DOES_NOT_EXIST

    def store(self) -> None:
        """Keep the values of parameters as they are now, for when it is switched on again (0x1010)."""
        self._stored = {
            key: self.values[key]
            for key, variable in self.variables.items()
            if variable.writable and key[0] not in _NO_PARAMETERS
        }

    def forget(self) -> None:
        """The EDS's values come back when it is switched on again (0x1011)."""
        self._stored = {}

    def __getitem__(self, index: int) -> Any:
        """The stored value of an object without sub-indices."""
        return self.values[index, 0]

    def variable(self, index: int, subindex: int) -> ODVariable:
        """The description of an object; SdoAbortedError if there is none."""
        variable = self.variables.get((index, subindex))
        if variable is None:
            raise SdoAbortedError(Abort.NO_SUBINDEX if index in self._indices else Abort.NO_OBJECT)
        return variable

    def read(self, index: int, subindex: int = 0) -> Any:
        """The value now."""
        key = index, subindex
        reader = self.readers.get(key)
        return self.values[key] if reader is None else reader()

    def write(self, index: int, subindex: int, value: Any) -> None:
        """Take a value, within its limits and with the writer's consent. Raises SdoAbortedError."""
        variable = self.variable(index, subindex)
        if variable.max is not None and value > variable.max:
            raise SdoAbortedError(Abort.TOO_HIGH)
        if variable.min is not None and value < variable.min:
            raise SdoAbortedError(Abort.TOO_LOW)
        writer = self.writers.get((index, subindex))
        if writer is not None:
            writer(value)
        self.values[index, subindex] = value

    # --- what canopen's SDO server asks for

    def get_data(self, index: int, subindex: int, check_readable: bool = False) -> bytes:
        """An object's bytes, little-endian. Raises SdoAbortedError."""
        variable = self.variable(index, subindex)
        if check_readable and not variable.readable:
            raise SdoAbortedError(Abort.WRITE_ONLY)
        return bytes(variable.encode_raw(self.read(index, subindex)))

    def set_data(self, index: int, subindex: int, data: bytes, check_writable: bool = False) -> None:
        """Take an object's bytes. Raises SdoAbortedError."""
        variable = self.check_writable(index, subindex) if check_writable else self.variable(index, subindex)
        if variable.data_type in NUMBER_TYPES and 8 * len(data) != len(variable):
            raise SdoAbortedError(Abort.TOO_LONG if 8 * len(data) > len(variable) else Abort.TOO_SHORT)
        self.write(index, subindex, variable.decode_raw(bytes(data)))

    def check_writable(self, index: int, subindex: int) -> ODVariable:
        """The description of an object that may be written; SdoAbortedError if there is none or it may not."""
        variable = self.variable(index, subindex)
        if not variable.writable:
            raise SdoAbortedError(Abort.READ_ONLY)
        return variable
