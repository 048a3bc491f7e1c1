"""The data that a module carries about itself, and its bytes in the data download (ISO 15765-2; oacs-thesis 8.5).

Layout of version 1, little-endian, `LENGTH` bytes (version 2 has what is marked so, too, and `LENGTH_2` bytes):

    uint8 version · uint8 kind · uint8 axis letter · uint8 joint · uint32 serial number · 12 bytes type text (ASCII)
    float32 accuracy, repeatability · lowest, highest, initial position · counts per unit
    float32 least speed, clockwise speed, counter-clockwise speed (unit/min) · supply (V)
    16 float32: the 4x4 transformation matrix with the axis at its zero, row by row
    version 2: the interfaces by which it is mounted, and on which it carries the next module, 24 bytes each:
        uint8 side (0 does not say, 1 male, 2 female, 3 neutral) · 3 reserved · float32 size, mm · 16 bytes kind (ASCII)
        of the first one, the byte after the side is the place of the module's voltage in cyclic commands (0: not said)
    version 2: 12 bytes type text of the accessory mounted on it, which has no board (ASCII; empty: none)
    uint32 CRC-32 (that of zlib and Ethernet) of all before it

A microcontroller without double precision can make and read it, since all numbers are float32.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite
from struct import Struct, error
from typing import NamedTuple
from zlib import crc32

from rds.bus.modules.oacs.codes import SERIALS, Kind
from rds.core.errors import InputError, MachineError
from rds.machines.library import Interface

VERSIONS = (1, 2)
SIDES = ("", "male", "female", "neutral")
UNITS = {Kind.TRANSLATIONAL: "mm", Kind.ROTARY: "deg", Kind.TOOL: "rev/min"}
SLOTS = 8  # of cyclic commands
JOINTS = ("", "x", "y", "z", "a", "b", "c")  # of the matrix: along which axis it shifts, or about which it turns
Matrix = tuple[tuple[float, float, float, float], ...]

_BODY = Struct("<BBBBI12s10f16f")
_CRC = Struct("<I")
_MORE = Struct("<BB2xf16sB3xf16s12s")
LENGTH = _BODY.size + _CRC.size
LENGTH_2 = LENGTH + _MORE.size
_ORTHOGONAL = 1e-3  # how far the matrix's rotation may be from one


@dataclass(frozen=True)
class ModuleDescription:
    """What a module says about itself. Lengths in the axis's unit: mm, degrees; rev/min of a tool."""

    kind: Kind
    axis: str  # letter
    type_text: str
    serial: int
    accuracy: float  # worst, unit
    repeatability: float  # worst, ± unit
    lowest: float  # unit, from the axis's zero
    highest: float
    initial: float  # position at delivery
    counts_per_unit: float
    least_speed: float  # unit/min
    clockwise_speed: float  # unit/min
    counterclockwise_speed: float
    supply: float  # V
    matrix: Matrix  # from one interface to the next, with the axis at zero
    joint: str = ""  # one of JOINTS
    mounted_by: Interface | None = None  # None: it does not say
    carries_on: Interface | None = None
    accessory: str = ""  # type text of the accessory mounted on it
    slot: int = 0  # place of its voltage in cyclic commands, from 1; 0: it does not say

    @property
    def version(self) -> int:
        """Of the download: 2 where it says more than version 1 can."""
        return 2 if self.mounted_by or self.carries_on or self.accessory or self.slot else 1

    @property
    def unit(self) -> str:
        """Unit of positions and lengths."""
        return UNITS[self.kind]

    @property
    def resolution(self) -> float:
        """Units per encoder count."""
        return 1.0 / self.counts_per_unit


class _Numbers(NamedTuple):
    """The numbers of the body before the matrix, in their order."""

    accuracy: float
    repeatability: float
    lowest: float
    highest: float
    initial: float
    counts_per_unit: float
    least_speed: float
    clockwise_speed: float
    counterclockwise_speed: float
    supply: float


def encode_description(description: ModuleDescription) -> bytes:
    """The bytes of the download. InputError for a description that no module can have."""
    d = description
    problem = _problem(d)
    if problem:
        raise InputError(f"module description: {problem}")
    try:
        body = _BODY.pack(
            d.version,
            d.kind,
            ord(d.axis),
            JOINTS.index(d.joint),
            d.serial,
            d.type_text.encode("ascii"),
            *(getattr(d, name) for name in _Numbers._fields),
            *(value for row in d.matrix for value in row),
        )
    except (error, OverflowError) as reason:
        raise InputError(f"module description: a value does not fit: {reason}") from None
    if d.version > 1:
        first, second = _side_values(d.mounted_by), _side_values(d.carries_on)
        body += _MORE.pack(first[0], d.slot, *first[1:], *second, d.accessory.encode("ascii"))
    return body + _CRC.pack(crc32(body))


def _side_values(side: Interface | None) -> tuple[int, float, bytes]:
    return (0, 0.0, b"") if side is None else (SIDES.index(side.gender), side.size, side.kind.encode("ascii"))


def decode_description(data: bytes | bytearray) -> ModuleDescription:
    """The description in the bytes of a download.

    Raises MachineError saying what is wrong: version, length, check sum, or a value that cannot be.
    """
    data = bytes(data)
    if not data:
        raise MachineError("the data download is empty; ask the module again")
    if data[0] not in VERSIONS:
        raise MachineError(
            f"the data download is of version {data[0]}, this program reads versions {' and '.join(map(str, VERSIONS))}"
            "; update the program or the module's firmware"
        )
    length = LENGTH if data[0] == 1 else LENGTH_2
    if len(data) != length:
        raise MachineError(f"the data download has {len(data)} bytes; version {data[0]} has {length}")
    body = data[: -_CRC.size]
    (sent,) = _CRC.unpack_from(data, len(body))
    if crc32(body) != sent:
        raise MachineError(
            f"the data download's check sum is {sent:#010x} instead of {crc32(body):#010x}; ask the module again"
        )
    version, kind, letter, joint, serial, name, *numbers = _BODY.unpack_from(body)
    more = _MORE.unpack_from(body, _BODY.size) if version > 1 else (0, 0, 0.0, b"", 0, 0.0, b"", b"")
    try:
        description = ModuleDescription(
            Kind(kind),
            chr(letter),
            name.rstrip(b"\0").decode("ascii"),
            serial,
            *_Numbers(*numbers[:10]),
            tuple(tuple(numbers[10 + 4 * row : 14 + 4 * row]) for row in range(4)),
            JOINTS[joint],
            _side("mounted_by", more[0], *more[2:4]),
            _side("carries_on", *more[4:7]),
            more[7].rstrip(b"\0").decode("ascii"),
            more[1],
        )
    except (ValueError, IndexError) as reason:
        raise MachineError(f"the data download holds a value that cannot be: {reason}") from None
    problem = _problem(description)
    if problem:
        raise MachineError(f"the data download is not of a module: {problem}")
    return description


def _side(name: str, gender: int, size: float, kind: bytes) -> Interface | None:
    return Interface(name, kind.rstrip(b"\0").decode("ascii"), size, SIDES[gender]) if gender else None


def _problem(d: ModuleDescription) -> str:
    """What is wrong with a description; "" if nothing."""
    for name in _Numbers._fields:
        value = getattr(d, name)
        if not isfinite(value):
            return f"{name} = {value!r} must be finite"
        if value < 0 and name not in ("lowest", "highest", "initial"):
            return f"{name} = {value!r} must not be negative"
    if not d.counts_per_unit > 0 or not d.supply > 0:
        return f"counts_per_unit = {d.counts_per_unit!r} and supply = {d.supply!r} must be more than 0"
    if not d.lowest < d.highest or not d.lowest <= d.initial <= d.highest:
        return f"positions {d.lowest!r}, {d.initial!r}, {d.highest!r} must be lowest <= initial <= highest"
    if len(d.axis) != 1 or not d.axis.isascii() or not d.axis.isalpha():
        return f"axis = {d.axis!r} must be a letter"
    if d.joint not in JOINTS:
        return f"joint = {d.joint!r} must be one of {', '.join(JOINTS[1:])} or empty"
    if not 0 <= d.serial < SERIALS:
        return f"serial = {d.serial!r} must be from 0 to {SERIALS - 1}"
    if not (d.type_text.isascii() and d.type_text.isprintable() and 1 <= len(d.type_text) <= 12):
        return f"type_text = {d.type_text!r} must be 1 to 12 printable ASCII characters"
    if not (d.accessory.isascii() and d.accessory.isprintable() and len(d.accessory) <= 12):
        return f"accessory = {d.accessory!r} must be 12 printable ASCII characters at most"
    if not 0 <= d.slot <= SLOTS:
        return f"slot = {d.slot!r} must be from 1 to {SLOTS}, or 0"
    for name in ("mounted_by", "carries_on"):
        side = getattr(d, name)
        if side is None:
            continue
        if not (side.kind.isascii() and side.kind.isprintable() and 1 <= len(side.kind) <= 16):
            return f"kind = {side.kind!r} of {name} must be 1 to 16 printable ASCII characters"
        if not 0.0 < side.size < inf or side.gender not in SIDES[1:]:
            return f"{name} must have a size above 0 and a gender, and has {side.size!r} and {side.gender!r}"
    return _matrix_problem(d.matrix)


def _matrix_problem(matrix: Matrix) -> str:
    if len(matrix) != 4 or any(len(row) != 4 for row in matrix):
        return "the matrix must have 4 rows of 4 numbers"
    if not all(isfinite(value) for row in matrix for value in row):
        return f"the matrix holds a number that is not finite: {matrix!r}"
    if tuple(matrix[3]) != (0.0, 0.0, 0.0, 1.0):
        return f"the matrix's last row is {matrix[3]!r} instead of 0 0 0 1"
    for i in range(3):
        for j in range(i, 3):
            product = sum(matrix[i][k] * matrix[j][k] for k in range(3))
            if abs(product - (i == j)) > _ORTHOGONAL:
                return f"rows {i + 1} and {j + 1} of the matrix are not those of a rotation"
    (a, b, c), (d, e, f), (g, h, i_) = (row[:3] for row in matrix[:3])
    if a * (e * i_ - f * h) - b * (d * i_ - f * g) + c * (d * h - e * g) < 0:
        return "the matrix mirrors instead of turning"
    return ""
