"""The axis behind a module: motor and carriage, its encoder as the module counts it, its limit switches.

It is a MachineAxis whose output is what the module recorded, and which refuses what must not be: a voltage while the
emergency stop is latched, or towards a limit switch that is open. Time is cut into steps of 1 ms at most, in each of
which edges are counted, switches looked at, and `watch` is called; so what the module does depends on bus time alone,
however late its process learns of it.
"""

from __future__ import annotations

from collections.abc import Callable

from rds.bus.modules.oacs.codes import DUTY, Kind
from rds.bus.modules.oacs.module_data import ModuleData
from rds.bus.modules.oacs.quadrature import Counter, Interrupts
from rds.bus.modules.oacs.switches import LimitSwitch
from rds.models.machine_axis import MachineAxis, MachineParameters

STEP = 1e-3  # s
_NO_TIME = 1e-12  # s
_REST = 1e-9  # mm/s: below that an axis without friction counts as standing


class Plant(MachineAxis):
    """The axis of the module `data`, at rest where it is switched on at the instant `start`, s."""

    def __init__(self, parameters: MachineParameters, data: ModuleData, start: float):
        super().__init__(parameters, start, speed_output=data.kind == Kind.TOOL)
        self.data = data
        self.tool = data.kind == Kind.TOOL
        self.emergency = False
        self.trips = 0  # how often a limit switch has opened
        self.changes = 0  # how often one has opened or closed
        self.opened = False  # whether one is open
        self.watch: Callable[[float], None] = lambda now: None
        self.awake = False  # whether `watch` wants every step
        self._moving = False
        self._resolution = 1.0 / data.counts_per_unit
        interrupts = Interrupts(data.interrupt_service, data.interrupt_pause, data.interrupt_every)
        count = 0 if self.tool else round(data.start * data.counts_per_unit)
        self.counter = Counter(interrupts, count, start, data.counts_per_turn)
        low = LimitSwitch(data.lowest - data.overtravel, -1, data.debounce)
        high = LimitSwitch(data.highest + data.overtravel, 1, data.debounce)
        self.switches: tuple[LimitSwitch, ...] = (low, high) if data.switches else ()
        for switch in self.switches:  # it may stand on one, for longer than the debouncing takes
            switch.look(data.start, start - data.debounce, count)
        self._look(start)

    @property
    def true_position(self) -> float:
        """Where the carriage really is, unit from the axis's zero; of a tool, its speed."""
        return super().output() if self.tool else self.data.start + super().output()

    @property
    def counts(self) -> int:
        """What the module recorded; of a tool, its speed in counts."""
        return round(super().output() / self._resolution) if self.tool else self.counter.recorded

    @property
    def duty(self) -> float:
        """Of the motor driver, signed."""
        return self.voltage / self.data.supply * DUTY

    @property
    def busy(self) -> bool:
        """Whether something is going on, so that time has to go on with it."""
        return (
            self.awake
            or bool(self._commands)
            or self.voltage != 0.0
            or abs(self.velocity) > _REST
            or any(switch.due is not None for switch in self.switches)
        )

    def output(self) -> float:
        """What the module measures: recorded position (unit), or a tool's speed (rev/min)."""
        return super().output() if self.tool else self.counter.recorded * self._resolution

    def command(self, voltage: float, at: float) -> None:
        """A voltage is commanded at the instant `at`; zero instead of what must not be, none in an emergency stop."""
        if not self.emergency:
            super().command(self.allowed(voltage), at)

    def drive(self, duty: float, at: float) -> None:
        """The node's own controller sets the motor driver's duty (-255 to 255), at once."""
        self._commands.clear()
        self._commands.append((at, self.allowed(duty / DUTY * self.data.supply)))

    def allowed(self, voltage: float) -> float:
        """`voltage`, or 0 V where it must not be applied."""
        if self.emergency or (
            self.opened and any(switch.open and voltage * switch.side > 0 for switch in self.switches)
        ):
            return 0.0
        return voltage

    def advance(self, until: float) -> float:
        """Move on to the instant `until`; return what the module measures there."""
        while self.now < until and not self._moving:
            if not self.busy:
                super().advance(until)
                break
            self._step(min(self.now + STEP, until))
        return self.output()

    def cut(self, at: float) -> None:
        """Zero volts from the instant `at` on."""
        self.advance(at)
        self._release()

    def look(self, at: float) -> None:
        """Look at the switches at this instant, after something was done to their wires."""
        self.advance(at)
        self._look(at)

    def _move(self, time: float) -> None:
        if time > _NO_TIME:  # rounding of instants leaves such rests, in which nothing moves
            super()._move(time)

    def _step(self, until: float) -> None:
        self._moving = True  # cut() in what follows must not step again
        try:
            since, before = self.now, self._carriage
            super().advance(until)
            if not self.tool:
                start, scale = self.data.start, self.data.counts_per_unit
                self.counter.move((start + before) * scale, (start + self._carriage) * scale, since, until)
                self._look(until)
            self.watch(until)
        finally:
            self._moving = False

    def _look(self, at: float) -> None:
        position = self.data.start + self._carriage
        for switch in self.switches:
            if not switch.look(position, at, self.counter.recorded):
                continue
            self.changes += 1
            self.opened = any(each.open for each in self.switches)
            if switch.open:
                self.trips += 1
                self.cut(at)  # a switch that opens stops the axis, whichever way it moves
