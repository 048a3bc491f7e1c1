"""What a module sends of its own accord while it is asked to: position in motion, acceleration, current.

Positions are taken at the instants start + k period, in the module's own slot, so a recorded motion has the times
k period exactly; a motion begins in a slot, at most 10 ms after its command.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rds.bus.modules.oacs import messages
from rds.bus.modules.oacs.codes import SLOT_GRID, MessageToHost, Quantity
from rds.bus.modules.oacs.sensors import gravities, motor_current, swing, vibrating

if TYPE_CHECKING:
    from rds.bus.modules.oacs.messages import Frame
    from rds.bus.modules.oacs.module import OacsModule

USUAL_PERIOD = 0.1  # s, of the position while in motion, if nobody asks for more


class Readings:
    """The periodic readings of one module."""

    def __init__(self, module: OacsModule):
        self._module = module
        self._asked = Quantity.POSITION
        self._period = USUAL_PERIOD
        self._sequence = 0
        self._samples = 0
        self._moving = False
        self.next: float | None = None  # s

    def subscribe(self, quantities: Quantity, period_ms: int, at: float) -> bool:
        """Send these every `period_ms`; False if that is not a multiple of the slots' grid."""
        if period_ms <= 0 or period_ms % round(SLOT_GRID * 1000):
            return False
        self._asked = quantities
        self._period = period_ms / 1000.0
        self._plan(self._module.slot(at))
        return True

    def begin(self, at: float) -> None:
        """A motion begins at the instant `at`, in a slot: its positions count from there."""
        self._sequence = 0
        self._plan(at)

    def _plan(self, first: float) -> None:
        self.next = first if self._asked else None

    def take(self, now: float) -> None:
        """Take the readings that are due by `now`, each at its own instant."""
        while self.next is not None and self.next <= now:
            at, module = self.next, self._module
            module.advance(at)
            moving = module.mover.motion is not None
            if Quantity.POSITION in self._asked and (moving or self._moving):
                module.send(self._position(), at)
            self._moving = moving
            if Quantity.ACCELERATION in self._asked and module.data.accelerometer is not None:
                module.send(self._acceleration(at), at)
            if Quantity.CURRENT in self._asked:
                module.send(self._current(), at)
            self._samples = (self._samples + 1) & 0xFFFF
            rest = self._asked & ~Quantity.POSITION
            self.next = at + self._period if moving or rest else None

    def _position(self) -> Frame:
        module = self._module
        sequence, self._sequence = self._sequence, (self._sequence + 1) & 0xFF
        return messages.encode(
            "Reply",
            Code=MessageToHost.POSITION,
            BoardID=module.node,
            Item=1,
            PositionAxis=ord(module.data.letter),
            Position=(module.plant.counts + 0x800000) % 0x1000000 - 0x800000,
            Sequence=sequence,
        )

    def _acceleration(self, at: float) -> Frame:
        data, plant = self._module.data, self._module.plant
        assert data.accelerometer is not None
        full = data.clockwise_speed if plant.tool else data.clockwise_speed / 60.0
        share = min(abs(plant.velocity) / full, 1.0) if full else 0.0
        x, y, z = (gravities(r) for r in vibrating(data.accelerometer, data.vibration, share, at))
        return messages.encode(
            "Acceleration",
            self._module.node,
            AccelerationX=x,
            AccelerationY=y,
            AccelerationZ=z,
            AccelerationCount=self._samples,
        )

    def _current(self) -> Frame:
        data, plant = self._module.data, self._module.plant
        # the speed at the full supply, which friction keeps below the motor's own
        clockwise = plant.voltage > 0.0 or (plant.voltage == 0.0 and plant.velocity > 0.0)
        full = data.clockwise_speed if clockwise else data.counterclockwise_speed
        start, run = data.currents(clockwise)
        speed = plant.velocity if plant.tool else plant.velocity * 60.0
        current = motor_current(plant.voltage, speed, start, run, data.supply, full)
        if data.current_swing and data.lead and full:
            current += swing(data.current_swing, abs(speed) / full, plant.true_position, data.lead)
        current = max(current, 0.0)
        return messages.encode("Current", self._module.node, Current=min(current, 32.0), CurrentCount=self._samples)
