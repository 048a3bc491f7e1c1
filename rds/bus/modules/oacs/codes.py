"""The numbers of the oacs dialect: identifiers and the codes that stand in its bytes. No I/O and no cantools here.

The DBC file beside this one describes the same numbers for firmware; a test proves that both agree.
"""

from __future__ import annotations

from enum import IntEnum, IntFlag

from rds.core.errors import InputError

HOST = 0x000  # what modules say to the host: replies, positions, acknowledgements
GENERAL = 0x001  # calls to all modules
COMMAND = 0x000  # + node: what the host says to one module
FLOW = 0x110  # + node: ISO 15765-2 flow control of a data download
DOWNLOAD = 0x120  # + node: its data
PARAMETER = 0x130  # + node: a tuning parameter reported
STATUS = 0x140  # + node
ACCELERATION = 0x150  # + node
CURRENT = 0x160  # + node
IDENTITY = 0x1E000000  # + node << 20 + serial number; 29 bits

NODES = range(0x02, 0x0F)  # 0x000 and 0x001 are taken by table 5, 0x00F begins the cyclic frames
SERIALS = 1 << 20
VERSION = 1  # of the dialect
DUTY = 255  # of the motor driver's pulse width: the whole supply
THOUSAND = 1000.0  # distances travel in thousandths of the axis's unit
SLOT_GRID = 0.010  # s; each module sends 0x000 of its own accord in a slot of this grid, see `slot_offset`


class Code(IntEnum):
    """First byte of a call or a command."""

    CALL_ONE = 1  # reply with ID and kind of module
    CALL_TWO = 2  # reply with ID and type of module
    DATA_CALL = 2  # the same number sent to one module: the data download
    MOVE = 3
    SET_PARAMETER = 5
    READ_PARAMETER = 6
    READINGS = 7
    EMERGENCY = 8  # to all: stop; to one: reset
    IDENTITY = 9  # reply with the serial number


class MessageToHost(IntEnum):
    """First byte of what a module says to the host."""

    CALL_ONE = 1
    CALL_TWO = 2
    POSITION = 3
    ACKNOWLEDGEMENT = 4


class Move(IntEnum):
    """Second byte of a move command."""

    STOP = 0
    START = 1
    SWITCH_DIRECTION = 2
    TO_POINT = 3
    JOG = 4
    HOME = 5


class Acknowledges(IntEnum):
    """Which command an acknowledgement belongs to; 0 and 3 are the thesis's, the others fill its gaps."""

    START = 0
    PARAMETER = 1
    SWITCH_DIRECTION = 2
    STOP = 3
    TO_POINT = 4
    JOG = 5
    HOME = 6
    READINGS = 7
    EMERGENCY = 8
    UNKNOWN = 9  # a command that the module does not know


OF_MOVE = {
    Move.STOP: Acknowledges.STOP,
    Move.START: Acknowledges.START,
    Move.SWITCH_DIRECTION: Acknowledges.SWITCH_DIRECTION,
    Move.TO_POINT: Acknowledges.TO_POINT,
    Move.JOG: Acknowledges.JOG,
    Move.HOME: Acknowledges.HOME,
}


class Result(IntEnum):
    """What became of a command; from 2 on it was not carried out."""

    CARRIED_OUT = 0
    ACCEPTED = 1
    OUTSIDE_TRAVEL = 2
    AT_LIMIT = 3
    EMERGENCY_LATCHED = 4
    BAD_VALUE = 5
    NOT_FOR_THIS_MODULE = 6
    STALLED = 7
    BUSY = 8
    STOPPED_BY_LIMIT = 9
    STOPPED_BY_EMERGENCY = 10
    STOPPED_BY_COMMAND = 11
    HOST_COMMANDS = 12
    TIME_OVER = 13
    HOST_SILENT = 14
    NOTHING_MOVES = 15


class Mode(IntEnum):
    """What a module does."""

    IDLE = 0
    MOVING = 1
    JOGGING = 2
    HOMING = 3
    RUNNING = 4
    SETTLING = 5
    COMMANDED = 6
    EMERGENCY = 7


class Kind(IntEnum):
    """Kind of module."""

    TRANSLATIONAL = 1
    ROTARY = 2
    TOOL = 3


class Quantity(IntFlag):
    """What a module sends periodically."""

    POSITION = 1
    ACCELERATION = 2
    CURRENT = 4


class Select(IntEnum):
    """The node's controller."""

    PI = 1
    PID = 2


class Parameter(IntEnum):
    """Number of a tuning parameter."""

    SELECT = 0
    KP = 1
    KI = 2
    KD = 3
    INTEGRAL_LIMIT = 4
    OUTPUT_LOW = 5
    OUTPUT_HIGH = 6
    KICK = 7
    SAMPLE_TIME = 8
    TOLERANCE = 9


def check_node(node: int) -> int:
    """`node` itself; InputError unless it is a module's number, 2 to 14."""
    if isinstance(node, bool) or not isinstance(node, int) or node not in NODES:
        raise InputError(f"module number {node!r} must be from {NODES[0]} to {NODES[-1]}")
    return node


def identity_identifier(node: int, serial: int) -> int:
    """The 29-bit identifier of a module's identity: no two modules share it, even if they share the number."""
    return IDENTITY + (node << 20) + serial


def slot_offset(node: int) -> float:
    """Where in the grid of `SLOT_GRID` a module may send 0x000, s after the grid's line.

    Arbitration cannot part two frames with the same identifier; so that none meet, each module has a slot.
    """
    return SLOT_GRID * node / 16.0


def next_slot(node: int, at: float, base: float) -> float:
    """The module's first slot not before `at`; the grid's lines are `SLOT_GRID` apart, one of them at `base`. In s."""
    first = base + slot_offset(node)
    passed = (at - first) / SLOT_GRID
    return first + SLOT_GRID * -((-passed + 1e-6) // 1.0) if passed > 0 else first
