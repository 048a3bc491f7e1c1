"""The state machine of a drive (CiA 402, power drive system finite state automaton): states, commands, transitions."""

from __future__ import annotations

from enum import Enum

from rds.bus.modules.cia402.codes import STATUS_PATTERNS, State

_FAULT_RESET_BIT = 0x80


class Command(Enum):
    """What a controlword 0x6040 asks for."""

    SHUTDOWN = "shutdown"
    SWITCH_ON = "switch on"  # in OPERATION ENABLED: disable operation
    ENABLE_OPERATION = "enable operation"
    DISABLE_VOLTAGE = "disable voltage"
    QUICK_STOP = "quick stop"
    NONE = "none"  # bit 7 is set: only its rising edge means something


# (state, command) -> number of the transition. 3 goes on by itself to 4 if operation is to be enabled.
_COMMANDED = {
    (State.SWITCH_ON_DISABLED, Command.SHUTDOWN): 2,
    (State.READY, Command.SWITCH_ON): 3,
    (State.READY, Command.ENABLE_OPERATION): 3,
    (State.SWITCHED_ON, Command.ENABLE_OPERATION): 4,
    (State.OPERATION_ENABLED, Command.SWITCH_ON): 5,
    (State.SWITCHED_ON, Command.SHUTDOWN): 6,
    (State.READY, Command.DISABLE_VOLTAGE): 7,
    (State.READY, Command.QUICK_STOP): 7,
    (State.OPERATION_ENABLED, Command.SHUTDOWN): 8,
    (State.OPERATION_ENABLED, Command.DISABLE_VOLTAGE): 9,
    (State.SWITCHED_ON, Command.DISABLE_VOLTAGE): 10,
    (State.SWITCHED_ON, Command.QUICK_STOP): 10,
    (State.OPERATION_ENABLED, Command.QUICK_STOP): 11,
    (State.QUICK_STOP_ACTIVE, Command.DISABLE_VOLTAGE): 12,
    (State.QUICK_STOP_ACTIVE, Command.ENABLE_OPERATION): 16,
}

# Number of the transition -> (from, to); 13 starts in every state but the fault states.
TRANSITIONS = {
    1: (State.NOT_READY, State.SWITCH_ON_DISABLED),
    2: (State.SWITCH_ON_DISABLED, State.READY),
    3: (State.READY, State.SWITCHED_ON),
    4: (State.SWITCHED_ON, State.OPERATION_ENABLED),
    5: (State.OPERATION_ENABLED, State.SWITCHED_ON),
    6: (State.SWITCHED_ON, State.READY),
    7: (State.READY, State.SWITCH_ON_DISABLED),
    8: (State.OPERATION_ENABLED, State.READY),
    9: (State.OPERATION_ENABLED, State.SWITCH_ON_DISABLED),
    10: (State.SWITCHED_ON, State.SWITCH_ON_DISABLED),
    11: (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE),
    12: (State.QUICK_STOP_ACTIVE, State.SWITCH_ON_DISABLED),
    13: (None, State.FAULT_REACTION_ACTIVE),
    14: (State.FAULT_REACTION_ACTIVE, State.FAULT),
    15: (State.FAULT, State.SWITCH_ON_DISABLED),
    16: (State.QUICK_STOP_ACTIVE, State.OPERATION_ENABLED),
}


def command(controlword: int) -> Command:
    """The command in bits 7, 3, 2, 1 and 0 of a controlword."""
    if controlword & _FAULT_RESET_BIT:
        return Command.NONE
    if not controlword & 0x02:
        return Command.DISABLE_VOLTAGE
    if not controlword & 0x04:
        return Command.QUICK_STOP
    if not controlword & 0x01:
        return Command.SHUTDOWN
    return Command.ENABLE_OPERATION if controlword & 0x08 else Command.SWITCH_ON


class StateMachine:
    """One drive's state. Every verb returns the numbers of the transitions that it made, in order."""

    def __init__(self) -> None:
        self.state = State.NOT_READY
        self._reset_bit = True  # a bit that is set when the drive wakes up is no rising edge

    @property
    def status_bits(self) -> int:
        """Bits 0 to 3, 5 and 6 of the statusword."""
        return STATUS_PATTERNS[self.state][1]

    def wake(self) -> list[int]:
        """The self-test is over."""
        return self._make(1) if self.state is State.NOT_READY else []

    def control(self, controlword: int, may_resume: bool = False, may_reset: bool = True) -> list[int]:
        """Obey a controlword. `may_resume`: QUICK STOP ACTIVE may be left to OPERATION ENABLED (option codes 5, 6).

        `may_reset`: a fault may be reset; an edge that comes while it may not resets nothing later.
        """
        reset = bool(controlword & _FAULT_RESET_BIT)
        rising, self._reset_bit = reset and not self._reset_bit, reset
        if self.state is State.FAULT:
            return self._make(15) if rising and may_reset else []
        wanted = command(controlword)
        number = _COMMANDED.get((self.state, wanted))
        if number is None or (number == 16 and not may_resume):
            return []
        made = self._make(number)
        if number == 3 and wanted is Command.ENABLE_OPERATION:
            made += self._make(4)
        return made

    def stopped(self) -> list[int]:
        """The quick stop has come to its end, and the drive shall not stay in QUICK STOP ACTIVE."""
        return self._make(12) if self.state is State.QUICK_STOP_ACTIVE else []

    def fault(self) -> list[int]:
        """Something is wrong: from any state to the fault reaction."""
        if self.state in (State.FAULT_REACTION_ACTIVE, State.FAULT):
            return []
        return self._make(13)

    def reacted(self) -> list[int]:
        """The fault reaction has come to its end."""
        return self._make(14) if self.state is State.FAULT_REACTION_ACTIVE else []

    def _make(self, number: int) -> list[int]:
        self.state = TRANSITIONS[number][1]
        return [number]
