"""Fault confinement: a CAN controller counts its errors, and takes itself off the bus when it is the cause.

Source: Bosch, "CAN Specification 2.0" (1991), part B, section 8, rules 1 to 12, which ISO 11898-1 took over:

    rule  1   a receiver detects an error                                        REC + 1
    rule  3   a transmitter sends an error flag                                  TEC + 8
          except an error-passive one that gets no acknowledgement (rule 3, exception 1)
    rule  7   a frame was sent                                                   TEC - 1, not below 0
    rule  8   a frame was received                REC - 1, not below 0; from above 127 to 127 (119 to 127 are allowed)
    rule  9   error passive from TEC or REC = 128 on
    rule 10   error active again when both are 127 or less
    rule 11   bus off from TEC = 256 on
    rule 12   after 128 times 11 recessive bits, error active with both counters 0

Rules 2 and 4 to 6, for errors within error flags and flags that one node alone sees, do not arise here: whatever
disturbs the wire, every node sees at once.
"""

from __future__ import annotations

from enum import IntEnum

WARNING = 96  # at which controllers warn
PASSIVE = 128
BUS_OFF = 256
STEP = 8  # of the transmit error counter
RECOVERY = 128  # sequences of SEQUENCE recessive bits
SEQUENCE = 11  # bits
_MOST = 255  # of the receive error counter: it has eight bits


class ErrorState(IntEnum):
    """How a controller may take part."""

    ACTIVE = 0  # its error flags destroy frames
    PASSIVE = 1  # its error flags are recessive, and it pauses between frames
    OFF = 2  # it takes no part

    @property
    def words(self) -> str:
        """As messages call it."""
        return ("error active", "error passive", "bus off")[self]


class ErrorCounters:
    """Transmit and receive error counter of one controller, and the state that follows from them."""

    __slots__ = ("rec", "state", "tec")

    def __init__(self) -> None:
        self.tec = 0
        self.rec = 0
        self.state = ErrorState.ACTIVE

    def failed_to_send(self, unacknowledged: bool = False) -> None:
        """An error in a frame that this controller sent; `unacknowledged`: nobody else saw an error."""
        if not (unacknowledged and self.state is ErrorState.PASSIVE):
            self.tec += STEP
            self._settle()

    def sent(self) -> None:
        """A frame went through."""
        if self.tec:
            self.tec -= 1
            self._settle()

    def failed_to_receive(self) -> None:
        """An error in a frame that another one sent."""
        if self.state is not ErrorState.OFF and self.rec < _MOST:
            self.rec += 1
            self._settle()

    def received(self) -> None:
        """Another one's frame came through."""
        if self.rec:
            self.rec = min(self.rec - 1, PASSIVE - 1)
            self._settle()

    def reset(self) -> None:
        """As after recovery from bus off."""
        self.tec = self.rec = 0
        self.state = ErrorState.ACTIVE

    @property
    def warning(self) -> bool:
        """Whether a counter has come to the warning limit."""
        return self.tec >= WARNING or self.rec >= WARNING

    def _settle(self) -> None:
        if self.state is ErrorState.OFF:
            return  # only reset() leads out
        if self.tec >= BUS_OFF:
            self.state = ErrorState.OFF
        else:
            passive = self.tec >= PASSIVE or self.rec >= PASSIVE
            self.state = ErrorState.PASSIVE if passive else ErrorState.ACTIVE
