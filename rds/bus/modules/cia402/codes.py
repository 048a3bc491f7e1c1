"""The numbers of CiA 301 and CiA 402 (IEC 61800-7-201) that people read, as data: codes and what they mean."""

from __future__ import annotations

from enum import IntEnum, StrEnum

NODES = range(1, 128)  # node-IDs

# --- CiA 301


# Table 41: identifiers that no configurable object (PDO, SYNC, emergency) may be given.
RESTRICTED = (range(0x080), range(0x101, 0x181), range(0x581, 0x600), range(0x601, 0x680), range(0x6E0, 0x800))

# Standard identifiers of CANopen, first and last, and what a frame with one does to a machine. The predefined ones come
# first; then those that a host may have given to a process data object or to SYNC, which is all that is not restricted.
IDENTIFIERS = (
    (0x000, 0x000, "starts, stops or resets drives (CANopen NMT)"),
    (0x080, 0x080, "makes drives take over their set points (CANopen SYNC)"),
    (0x081, 0x0FF, "would pass for a drive's emergency message (CANopen)"),
    (0x581, 0x5FF, "would pass for a drive's answer (CANopen SDO)"),
    (0x601, 0x67F, "sets a drive's parameters (CANopen SDO)"),
    (0x6E0, 0x6FF, "manages nodes (CANopen)"),
    (0x700, 0x77F, "would pass for a heartbeat (CANopen)"),
    (0x7E4, 0x7E5, "sets node-IDs and bit rates (CANopen LSS)"),
    (0x100, 0x100, "sets clocks (CANopen TIME), or commands a drive"),
    (0x181, 0x580, "commands a drive, or would pass for its measured values (CANopen process data)"),
    (0x600, 0x600, "may command a drive (CANopen process data)"),
    (0x680, 0x6DF, "may command a drive (CANopen process data)"),
)


class Nmt(IntEnum):
    """NMT states as a heartbeat reports them (CiA 301, 7.2.8.3.2)."""

    BOOT_UP = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


class NmtCommand(IntEnum):
    """NMT commands (CiA 301, 7.2.8.2.1)."""

    START = 1
    STOP = 2
    ENTER_PRE_OPERATIONAL = 128
    RESET_NODE = 129
    RESET_COMMUNICATION = 130


class Abort(IntEnum):
    """SDO abort codes (CiA 301, table 22)."""

    TOGGLE = 0x05030000
    COMMAND = 0x05040001
    BLOCK_SIZE = 0x05040002
    SEQUENCE = 0x05040003
    CRC = 0x05040004
    WRITE_ONLY = 0x06010001
    READ_ONLY = 0x06010002
    NO_OBJECT = 0x06020000
    NOT_MAPPABLE = 0x06040041
    PDO_LENGTH = 0x06040042
    PARAMETERS_INCOMPATIBLE = 0x06040043
    TOO_LONG = 0x06070012
    TOO_SHORT = 0x06070013
    NO_SUBINDEX = 0x06090011
    VALUE = 0x06090030
    TOO_HIGH = 0x06090031
    TOO_LOW = 0x06090032
    GENERAL = 0x08000000
    DEVICE_STATE = 0x08000022
    NO_DATA = 0x08000024


# Emergency error codes: CiA 301 table 26 and CiA 402 (IEC 61800-7-201) table of error codes; FFxx is our drive's own.
# A code that is not here has the meaning of its class: xx00, then x000.
ERROR_TEXTS = {
    0x0000: "no error",
    0x1000: "generic error",
    0x2000: "current",
    0x2300: "current, device output side",
    0x2310: "continuous over-current",
    0x2320: "short circuit or earth leakage",
    0x2330: "earth leakage",
    0x2340: "short circuit",
    0x3000: "voltage",
    0x3100: "mains voltage",
    0x3110: "mains over-voltage",
    0x3120: "mains under-voltage",
    0x3130: "phase failure",
    0x3200: "DC link voltage",
    0x3210: "DC link over-voltage",
    0x3220: "DC link under-voltage",
    0x4000: "temperature",
    0x4200: "device temperature",
    0x4210: "excess temperature of the device",
    0x4300: "drive temperature",
    0x4310: "excess temperature of the drive",
    0x5000: "device hardware",
    0x5100: "device hardware supply",
    0x5400: "power section",
    0x5500: "data memory",
    0x6000: "device software",
    0x6100: "internal software",
    0x6200: "user software",
    0x6300: "data record",
    0x7000: "additional modules",
    0x7100: "power",
    0x7110: "brake chopper",
    0x7120: "motor",
    0x7121: "motor blocked",
    0x7122: "motor error or commutation",
    0x7300: "sensor",
    0x7305: "incremental encoder 1 faulty",
    0x7306: "incremental encoder 2 faulty",
    0x7310: "speed",
    0x7320: "position",
    0x7500: "communication",
    0x8000: "monitoring",
    0x8100: "communication",
    0x8110: "CAN overrun: frames lost",
    0x8120: "CAN in error-passive mode",
    0x8130: "life guard or heartbeat error",
    0x8140: "recovered from bus off",
    0x8150: "CAN identifier collision",
    0x8200: "protocol error",
    0x8210: "PDO not processed due to a length error",
    0x8220: "PDO length exceeded",
    0x8240: "unexpected SYNC data length",
    0x8250: "RPDO time-out",
    0x8300: "torque control",
    0x8400: "velocity speed controller",
    0x8500: "position controller",
    0x8600: "positioning controller",
    0x8611: "following error",
    0x8612: "reference limit",
    0x8700: "sync controller: SYNC missing",
    0x9000: "external error",
    0xF000: "additional functions",
    0xFF00: "device specific",
    0xFF01: "negative limit switch (simulated drive)",
    0xFF02: "positive limit switch (simulated drive)",
    0xFF03: "emergency stop button (simulated drive)",
}

HEARTBEAT_LOST = 0x8130
IDENTIFIER_COLLISION = 0x8150
PDO_TOO_SHORT = 0x8210
RPDO_TIMEOUT = 0x8250
FOLLOWING_ERROR = 0x8611
REFERENCE_LIMIT = 0x8612
SYNC_LOST = 0x8700
EMERGENCY_STOP = 0xFF03
NEGATIVE_SWITCH = 0xFF01
POSITIVE_SWITCH = 0xFF02


def error_text(code: int) -> str:
    """What an emergency error code means, e.g. "0x8611 following error"."""
    for key in (code, code & 0xFFF0, code & 0xFF00, code & 0xF000):
        if key in ERROR_TEXTS:
            return f"0x{code:04X} {ERROR_TEXTS[key]}"
    return f"0x{code:04X} (unknown code)"


def error_register_bits(code: int) -> int:
    """The bits of the error register 0x1001 that go with an error code: generic, and the code's class."""
    if code & 0xFF00 == 0xFF00:
        return 0x81
    return 1 | {0x2: 0x02, 0x3: 0x04, 0x4: 0x08, 0x8: 0x20}.get(code >> 12, 0) | (0x10 if code >> 8 == 0x81 else 0)


# --- CiA 402


class State(StrEnum):
    """States of the power drive system (CiA 402, finite state automaton)."""

    NOT_READY = "NOT READY TO SWITCH ON"
    SWITCH_ON_DISABLED = "SWITCH ON DISABLED"
    READY = "READY TO SWITCH ON"
    SWITCHED_ON = "SWITCHED ON"
    OPERATION_ENABLED = "OPERATION ENABLED"
    QUICK_STOP_ACTIVE = "QUICK STOP ACTIVE"
    FAULT_REACTION_ACTIVE = "FAULT REACTION ACTIVE"
    FAULT = "FAULT"


# State -> (mask, value) of the statusword 0x6041.
STATUS_PATTERNS = {
    State.NOT_READY: (0x4F, 0x00),
    State.SWITCH_ON_DISABLED: (0x4F, 0x40),
    State.READY: (0x6F, 0x21),
    State.SWITCHED_ON: (0x6F, 0x23),
    State.OPERATION_ENABLED: (0x6F, 0x27),
    State.QUICK_STOP_ACTIVE: (0x6F, 0x07),
    State.FAULT_REACTION_ACTIVE: (0x4F, 0x0F),
    State.FAULT: (0x4F, 0x08),
}

STATUS_BITS = {
    0: "ready to switch on",
    1: "switched on",
    2: "operation enabled",
    3: "fault",
    4: "voltage enabled",
    5: "no quick stop",
    6: "switch on disabled",
    7: "warning",
    9: "remote",
    10: "target reached",
    11: "internal limit active",
    12: "mode-specific 12",
    13: "mode-specific 13",
}

VOLTAGE_ENABLED, WARNING, REMOTE = 1 << 4, 1 << 7, 1 << 9
TARGET_REACHED, INTERNAL_LIMIT, MODE_12, MODE_13 = 1 << 10, 1 << 11, 1 << 12, 1 << 13

# Controlword 0x6040: the commands, and the bits beside them.
DISABLE_VOLTAGE, QUICK_STOP, SHUTDOWN, SWITCH_ON, ENABLE_OPERATION, FAULT_RESET = 0x00, 0x02, 0x06, 0x07, 0x0F, 0x80
INTERLOCK = 1 << 3  # of the digital inputs 0x60FD: the emergency stop button is pressed
BIT_4, BIT_5, BIT_6, HALT = 1 << 4, 1 << 5, 1 << 6, 1 << 8


class Mode(IntEnum):
    """Modes of operation 0x6060; the ones that the simulated drive knows, and 0 for none."""

    NONE = 0
    PROFILE_POSITION = 1
    PROFILE_VELOCITY = 3
    HOMING = 6
    CYCLIC_POSITION = 8
    CYCLIC_VELOCITY = 9
    CYCLIC_TORQUE = 10

    @property
    def supported_bit(self) -> int:
        """This mode's bit in 0x6502."""
        return 1 << (self - 1) if self else 0


def state_of(statusword: int) -> State | None:
    """The state that a statusword shows; None if it shows none."""
    for state, (mask, value) in STATUS_PATTERNS.items():
        if statusword & mask == value:
            return state
    return None


def status_text(statusword: int) -> str:
    """A statusword for people: "0x0237 OPERATION ENABLED (ready to switch on, switched on, ...)"."""
    bits = ", ".join(text for bit, text in STATUS_BITS.items() if statusword >> bit & 1)
    return f"0x{statusword:04X} {state_of(statusword) or 'no state'} ({bits or 'no bit set'})"
