"""The drive as CiA 402 sees it: state machine, modes, stops and faults, over the object dictionary and the servo.

Zero volts whenever the state isn't OPERATION ENABLED, QUICK STOP ACTIVE or FAULT REACTION ACTIVE, and in the latter two
only as long as a ramp lasts that an option code asks for (quick stop option codes 5 and 6: standing still under power).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import inf
from typing import Any

from canopen.sdo import SdoAbortedError

from rds.bus.modules.cia402 import codes
from rds.bus.modules.cia402.codes import Abort, Mode, State
from rds.bus.modules.cia402.dictionary import Dictionary
from rds.bus.modules.cia402.homing import METHODS
from rds.bus.modules.cia402.modes import MODES, TARGETS, OperationMode
from rds.bus.modules.cia402.motions import Ramp
from rds.bus.modules.cia402.servo import Servo
from rds.bus.modules.cia402.state_machine import Command, StateMachine, command

_ON = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE)
_STAYING = (5, 6)  # quick stop option codes that stay in QUICK STOP ACTIVE
_LONGEST_STOP = 2.0  # s after a ramp's end for an axis to stand still; then the voltage is cut anyway


class Operation:
    """State and mode of one drive. `report(code)` is called with each new error, `cleared()` when all are reset."""

    def __init__(
        self,
        objects: Dictionary,
        servo: Servo,
        report: Callable[[int], None],
        cleared: Callable[[], None],
    ):
        self.machine = StateMachine()
        self.objects, self.servo = objects, servo
        self.now = servo.axis.now
        self.remote = False  # whether NMT is OPERATIONAL
        self.is_host_missing: Callable[[], bool] = lambda: False  # whether heartbeats that it waits for have stopped
        self.interlock = False  # whether the emergency stop button is pressed: no fault can be reset meanwhile
        self._report, self._cleared = report, cleared
        self._mode: OperationMode | None = None  # while OPERATION ENABLED
        self._stop: Ramp | None = None  # a stop under way
        self._stop_ends = 0.0  # s: by then the axis has to stand
        self._leaving: int | None = None  # controlword that is carried out once the stop has ended
        self._written = False  # a cyclic target that doesn't act yet
        self._fresh = self._synced = 0.0  # s: when a cyclic target began to act; last SYNC
        self._is_old = False
        self.period = 1e-3  # s between two SYNCs
        self._patience = 2.5, 10.5  # periods
        self._connect()

    def _connect(self) -> None:
        servo, readers, writers = self.servo, self.objects.readers, self.objects.writers
        readers |= {
            (0x6041, 0): self.statusword,
            (0x6061, 0): lambda: self.objects[0x6060],
            (0x6062, 0): lambda: _wrap(round(servo.position_demand)),
            (0x6063, 0): lambda: _wrap(servo.raw),
            (0x6064, 0): lambda: _wrap(servo.position),
            (0x606B, 0): lambda: _wrap(round(servo.velocity_demand)),
            (0x606C, 0): lambda: _wrap(round(servo.velocity)),
            (0x6077, 0): lambda: max(-32768, min(32767, round(servo.applied))),
            (0x60F4, 0): lambda: _wrap(round(servo.following_error)),
            (0x60FD, 0): lambda: servo.inputs | (codes.INTERLOCK if self.interlock else 0),
        }
        writers |= {
            (0x6040, 0): self.control,
            (0x6060, 0): self._choose,
            (0x6098, 0): self._check_method,
            (0x6065, 0): lambda value: setattr(servo, "following_window", value),
            (0x6066, 0): lambda value: setattr(servo, "following_time", value * 1e-3),
            (0x6072, 0): lambda value: setattr(servo, "voltage_limit", value * 1e-3 * servo.volts),
            (0x607D, 1): lambda value: setattr(servo, "software_limits", (value, servo.software_limits[1])),
            (0x607D, 2): lambda value: setattr(servo, "software_limits", (servo.software_limits[0], value)),
            (0x2001, 1): partial(self._set_gain, "position_gain"),
            (0x2001, 2): partial(self._set_gain, "velocity_gain"),
            (0x2001, 3): partial(self._set_gain, "integral_time"),
            (0x2001, 4): partial(self._set_gain, "current_limit"),
        }
        writers |= {(index, 0): partial(self._take_target, index, modes) for index, modes in TARGETS.items()}

    # --- what the bus asks for

    @property
    def mode(self) -> Mode:
        """The mode of operation, 0x6061."""
        return Mode(self.objects[0x6060])

    def look_up(self) -> None:
        """Work with what the objects say now: `period` is 0x1006 where given, else the interpolation time 0x60C2."""
        cycle, values = self.objects[0x1006], self.objects.values
        self.period = cycle * 1e-6 if cycle else values[0x60C2, 1] * 10.0 ** values[0x60C2, 2]
        self._patience = values[0x2000, 1] + 0.5, values[0x2000, 2] + 0.5

    def wake(self) -> None:
        """The self-test after switching on is over."""
        self.machine.wake()

    def statusword(self) -> int:
        """0x6041 now."""
        word = self.machine.status_bits | codes.VOLTAGE_ENABLED
        if self.remote:
            word |= codes.REMOTE
        if self._mode is not None:
            word |= self._mode.status()
            if self.servo.limited or self._mode.clamped:
                word |= codes.INTERNAL_LIMIT
        return word

    def control(self, word: int) -> None:
        """Obey a controlword, 0x6040."""
        if command(word) is Command.ENABLE_OPERATION and not self._is_powered() and self.is_host_missing():
            return
        option = {Command.SWITCH_ON: 0x605C, Command.SHUTDOWN: 0x605B}.get(command(word))
        if self.machine.state is State.OPERATION_ENABLED and option and self.objects[option] and self._is_powered():
            if self._leaving is None:
                self._brake(self.objects[0x6084])
            self._leaving = word
            return
        if self._leaving is not None and command(word) is Command.ENABLE_OPERATION:
            self._leaving = None
            self._start_mode()
        for number in self.machine.control(word, self.objects[0x605A] in _STAYING, not self.interlock):
            self._pass(number)
        if self._mode is not None and self._leaving is None:
            self._mode.control(word, self.now)

    def fault(self, code: int, at: float | None = None) -> None:
        """Something is wrong, since the instant `at`: report it and react by option code 0x605E."""
        self.now = self.now if at is None else at
        made = self.machine.fault()
        if made or code != self.objects[0x603F]:
            self._report(code)
        for number in made:
            self._pass(number)

    def abort_connection(self, code: int) -> None:
        """The host has gone: react by option code 0x6007. Without power on, it is only reported."""
        option = self.objects[0x6007]
        if option == 1 and self.machine.state in _ON:
            self.fault(code)
            return
        self._report(code)
        if option in (2, 3):
            self.control(codes.DISABLE_VOLTAGE if option == 2 else codes.QUICK_STOP)

    def sync(self) -> None:
        """SYNC: cyclic targets act from now on."""
        self._synced = self.now
        self.actuate()

    def actuate(self) -> None:
        """A cyclic target that was written acts from now on."""
        if self._written and self._mode is not None and self._leaving is None:
            self._written = self._is_old = False
            self._fresh = self.now
            self._mode.actuate(self.now, self.period)

    def power_off(self) -> None:
        """As after switching on: zero volts, no fault, SWITCH ON DISABLED."""
        self.machine = StateMachine()
        self.machine.wake()
        self._drop()
        servo, values = self.servo, self.objects.values
        for index, subindex in ((0x6065, 0), (0x6066, 0), (0x6072, 0), (0x607D, 1), (0x607D, 2)):
            self.objects.writers[index, subindex](values[index, subindex])
        gains = servo.position_gain, servo.velocity_gain, servo.integral_time, servo.current_limit
        values |= {(0x2001, place): gain for place, gain in enumerate(gains, 1)}

    # --- what time brings

    def deadline(self) -> float:
        """The next instant at which something has to be decided, s; infinite if there is none."""
        if self._mode is not None:
            return self._fresh + self._patience[self._is_old] * self.period if self._mode.cyclic else inf
        return self._stop_ends if self._stop is not None else inf

    def expire(self) -> None:
        """The deadline is now."""
        if self._stop is not None:
            self._stopped()
        elif not self._is_old:
            self._is_old = True
            assert self._mode is not None
            self._mode.too_old(self.now)
        else:
            silent = self.now - self._synced > 0.999 * (self.now - self._fresh)
            self.fault(codes.SYNC_LOST if silent else codes.RPDO_TIMEOUT)

    def advance(self, until: float) -> None:
        """Move on to the instant `until`, at most the next deadline."""
        if until > self.now:
            self.servo.advance(until)
            self.now = until
            if self._mode is not None:
                self._mode.watch(until)
            if self._stop is not None and self._stop.done and self.servo.axis.velocity == 0.0:
                self._stopped()

    # --- transitions

    def _pass(self, number: int) -> None:
        """Do what goes with a transition of the state machine."""
        if number in (4, 16):
            self._start_mode()
        elif number == 11:
            self._quick_stop(self.objects[0x605A])
        elif number == 13:
            reaction = self.objects[0x605E]
            if reaction and self._is_powered():
                self._brake(self.objects[0x6085 if reaction == 2 else 0x6084])
            else:
                self._stopped()
        else:
            self._drop()
            if number == 15:
                self._cleared()

    def _is_powered(self) -> bool:
        return self._mode is not None or self._stop is not None

    def _start_mode(self) -> None:
        self._stop = self._leaving = None
        self._written = self._is_old = False
        self._fresh = self._synced = self.now
        self._mode = MODES[self.mode](self.objects, self.servo, self.now)

    def _quick_stop(self, option: int) -> None:
        if option == 0:
            self._stopped()
        else:
            self._brake(self.objects[0x6085 if option in (2, 6) else 0x6084])

    def _brake(self, deceleration: float) -> None:
        """A ramp to zero speed, whatever it was to lead to before; _stopped() when the axis stands."""
        self._mode = self._leaving = None
        self.servo.guarded = False
        velocity = self.servo.velocity
        self._stop = Ramp(velocity, 0.0, deceleration, deceleration)
        self._stop_ends = self.now + abs(velocity) / deceleration + _LONGEST_STOP
        self.servo.lead(self._stop)

    def _stopped(self) -> None:
        """A stop has come to its end."""
        self._stop = None
        leaving, self._leaving = self._leaving, None
        if self.machine.state is State.OPERATION_ENABLED and leaving is not None:
            made = self.machine.control(leaving)
        elif self.machine.state is State.FAULT_REACTION_ACTIVE:
            made = self.machine.reacted()
        elif self.objects[0x605A] in _STAYING:
            made = []  # QUICK STOP ACTIVE, held at rest by the loop
        else:
            made = self.machine.stopped()
        for number in made:
            self._pass(number)

    def _drop(self) -> None:
        """Zero volts now."""
        self._mode = self._stop = self._leaving = None
        self.servo.cut(self.now)

    # --- what is written to the objects

    def _choose(self, value: int) -> None:
        if value not in {int(mode) for mode in MODES}:
            raise SdoAbortedError(Abort.VALUE)
        if value != self.objects[0x6060]:
            self.objects.values[0x6060, 0] = value
            if self._mode is not None:
                self._start_mode()

    def _check_method(self, value: int) -> None:
        if value and value not in METHODS:
            raise SdoAbortedError(Abort.VALUE)

    def _set_gain(self, name: str, value: float) -> None:
        if not 0.0 < value < 1e9:  # false for NaN too
            raise SdoAbortedError(Abort.VALUE)
        setattr(self.servo, name, value)

    def _take_target(self, index: int, modes: set[Mode], value: Any) -> None:
        self.objects.values[index, 0] = value  # which the mode looks at
        if self._mode is None or self.objects[0x6060] not in modes:
            return
        if self._mode.cyclic:
            self._written = True
        else:
            self._mode.target(self.now)


def _wrap(value: int) -> int:
    """As a 32-bit counter does."""
    return (value + 0x80000000) % 0x100000000 - 0x80000000
