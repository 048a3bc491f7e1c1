"""What moves the modules of a jogged machine: by voltages, with the loops here, or by drives that have them inside."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

from rds.bus.modules.calling import find_machine
from rds.bus.modules.dialects import SERIAL_DIALECTS, open_drivers
from rds.bus.tools.link import default_channel
from rds.controllers import library_controller
from rds.core.contracts import Drivers, Watch
from rds.core.errors import MachineError
from rds.core.types import SPINDLE_UNIT, Controller, Reference
from rds.machines.machine import Axis, Machine
from rds.panels.jog.axes import JogAxis, JogSpindle, jog_axes, jog_spindles

_COUNTS = 5.0  # of error at rest over which friction is made up for
_ANSWERS_IN = 0.5  # s in which a spindle's module has to say that it is there
_ASTRAY = 0.2  # s; longer than a module may be silent
_FROM_SWITCHES = 1e-3  # of the travel, which is left between an axis and its limit switch: to touch one is a fault


class ModuleControl(Protocol):
    """Called in turn by the loop, `period` s apart: read(), write()."""

    period: float
    axes: dict[str, JogAxis]
    spindles: dict[str, JogSpindle]
    left_out: dict[str, str]  # axis or spindle -> why it can't be jogged

    def start(self) -> None:
        """Take the modules; nothing moves. MachineError where that fails."""

    def read(self) -> dict[str, float]:
        """Positions (axis units) and the spindles' speeds (rev/min), measured."""

    def write(self, places: Mapping[str, float], speeds: Mapping[str, float]) -> None:
        """Where the axes shall be, and at which speed; how fast the spindles shall turn (among `speeds`)."""

    def home(self, methods: Mapping[str, int], watch: Watch) -> None:
        """Let the drives of these axes find their home; what `watch` raises ends that, without power."""

    def close(self) -> None:
        """Let the modules go: no voltage."""


def open_hand(dialect: str, machine: Machine, bus: Mapping[str, Any]) -> ModuleControl:
    """The hand for modules of this dialect; `bus` holds what a `[bus]` table does."""
    return DriveControl(machine, bus) if dialect == "cia402" else VoltageControl(machine, dialect, bus)


@dataclass(frozen=True)
class AxisLaw:
    """How an axis that takes voltages is held on its reference; units of the axis, s, V."""

    tau: float
    K: float
    friction: tuple[float, float]  # lost speed, forwards and backwards (negative)
    voltage: float  # the most
    resolution: float

    @property
    def farthest(self) -> float:
        """The error for which Kp alone asks for the whole voltage: more than any speed of a right axis makes."""
        return 2.0 * self.tau * abs(self.K) * self.voltage

    def volts(self, error: float, velocity: float) -> float:
        """The voltage for an error of position and a reference velocity.

        u = (v + f)/K + Kp e, with Kp = 1/(2 tau K), which damps τẍ + ẋ = K u by 0.7. At rest, friction f is made up
        for in proportion to the error, within some counts, so that small steps are not lost in it.
        """
        share = (velocity > 0.0) - (velocity < 0.0) if velocity else error / (_COUNTS * self.resolution)
        share = min(max(share, -1.0), 1.0)
        friction = share * self.friction[0] if share > 0.0 else -share * self.friction[1]
        volts = (velocity + friction) / self.K + error / (2.0 * self.tau * self.K)
        return min(max(volts, -self.voltage), self.voltage)


class SpindleLaw:
    """How a spindle that takes a voltage keeps its speed: the library's PID, and no voltage at rest."""

    def __init__(self, axis: Axis, T: float, voltage: float):
        self._law: Controller = library_controller("pid", axis.model, T, voltage, unit=SPINDLE_UNIT)
        self._state: Any = self._law.initial_state

    def volts(self, speed: float, measured: float) -> float:
        """V for a wanted and a measured speed, rev/min."""
        if speed == measured == 0.0:
            self._state = self._law.initial_state
            return 0.0
        volts, self._state = self._law.control(0.0, Reference(speed, 0.0, 0.0), measured, self._state, self._law.params)
        return float(volts)


class VoltageControl:
    """Modules that take voltages (rds, oacs, dcs): a loop for each axis and spindle whose model has tau and K."""

    period = 0.002  # s; on a serial line, which carries no more, the machine's sample period

    def __init__(self, machine: Machine, dialect: str, bus: Mapping[str, Any]):
        self.left_out: dict[str, str] = {}
        serial = dialect in SERIAL_DIALECTS
        if serial:
            self.period = machine.sample_period
        for axis in machine.axes.values():
            if not (axis.model.get("tau") and axis.model.get("K")):
                self.left_out[axis.name] = "its modules take voltages, and it has no model with tau and K"
        self.axes = {name: axis for name, axis in jog_axes(machine).items() if name not in self.left_out}
        options = {key: value for key, value in bus.items() if key not in ("dialect", "cia402", "faults")}
        self.spindles = {name: each for name, each in jog_spindles(machine).items() if name not in self.left_out}
        if self.spindles:
            _leave_out(self, set(_on_line(machine, options) if serial else _on_bus(machine, options)))
        volts = machine.converter.range
        self._laws = {name: _axis_law(machine.axis(name), volts, self.period) for name in self.axes}
        self._turners = {name: SpindleLaw(machine.axis(name), self.period, volts) for name in self.spindles}
        self._names = [*self.axes, *self.spindles]
        self._drivers = open_drivers(dialect, machine, self._names, self.period, False, options)
        self._origin = [0.0] * len(self._names)
        self._measured: dict[str, float] = {}
        self._astray = dict.fromkeys(self._laws, 0)  # periods in a row in which an axis is too far from its reference

    def start(self) -> None:
        """As Hand.start; positions count from the modules' own zero."""
        self._drivers.start()
        self._origin = self._drivers.standing

    def read(self) -> dict[str, float]:
        """As Hand.read."""
        moved = self._drivers.exchange()
        self._measured = {name: at + start for name, at, start in zip(self._names, moved, self._origin, strict=True)}
        return self._measured

    def write(self, places: Mapping[str, float], speeds: Mapping[str, float]) -> None:
        """As Hand.write. MachineError for an axis that is far from its reference, and stays so."""
        measured = self._measured
        for name, law in self._laws.items():
            error = measured[name] - places[name]
            self._astray[name] = self._astray[name] + 1 if abs(error) > law.farthest else 0
            if self._astray[name] * self.period > _ASTRAY:
                raise MachineError(
                    f"{name} is {abs(error):.3g} {self.axes[name].unit} from where it is to be, and was let go: see "
                    "whether it is blocked, or its voltage, its encoder or K of its model has the wrong sign"
                )
        volts = [law.volts(places[name] - measured[name], speeds[name]) for name, law in self._laws.items()]
        volts += [law.volts(speeds[name], measured[name]) for name, law in self._turners.items()]
        self._drivers.write(volts)

    def home(self, methods: Mapping[str, int], watch: Watch) -> None:
        """MachineError: it takes a drive to find home."""
        raise MachineError("these modules have no homing; Home moves the axes to their zero")

    def close(self) -> None:
        """As Hand.close."""
        self._drivers.close()


def _leave_out(hand: ModuleControl, answering: set[str]) -> None:
    """A machine may be used without its spindle's module; without an axis's, it is not whole, which start() says."""
    for name in [name for name in hand.spindles if name not in answering]:
        del hand.spindles[name]
        hand.left_out[name] = "no module answers for it; switch it on, and take the machine again"


def _on_bus(machine: Machine, options: Mapping[str, Any]) -> list[str]:
    return find_machine(machine, timeout=_ANSWERS_IN, **options)


def _on_line(machine: Machine, options: Mapping[str, Any]) -> list[str]:
    from rds.bus.modules.dcs.calling import find_units

    return find_units(machine, options.get("channel"), options.get("baud"))


def _axis_law(axis: Axis, voltage: float, period: float) -> AxisLaw:
    """A loop that is slow enough for its sample period: the module's own time constant may be much shorter."""
    friction = float(axis.model.get("friction_plus", 0.0)), float(axis.model.get("friction_minus", 0.0))
    tau = max(float(axis.model["tau"]), 2.0 * period)
    return AxisLaw(tau, axis.model["K"], friction, voltage, axis.resolution)


class DriveControl:
    """CiA 402 drives: axes follow positions (csp), spindles speeds (csv), and the loops are in the drives.

    Positions are the drives' own. A `[bus.cia402]` table among `bus` says how to reach the drives; which modes it
    names, and where its positions count from, is for runs. Its homing is carried out by home(), not at the start.
    """

    # Drives interpolate between two targets, and no loop is closed here: this slow, a computer that stalls for ten
    # periods is rare, after which drives are in fault.
    period = 0.02  # s

    def __init__(self, machine: Machine, bus: Mapping[str, Any]):
        self._machine = machine
        self._bus = {key: value for key, value in bus.items() if key not in ("dialect", "faults")}
        self.left_out: dict[str, str] = {}
        self.axes = dict(sorted(jog_axes(machine).items(), key=lambda each: each[0] != "Z"))  # Z is homed first
        self.spindles = jog_spindles(machine)
        for axis in machine.axes.values():
            if axis.name not in self.axes and axis.name not in self.spindles:
                self.left_out[axis.name] = "the machine's file has neither its limits nor a model with tau and K"
        if self.spindles:
            _leave_out(self, self._answering())
        self._names = [*self.axes, *self.spindles]
        self._drivers = self._open({})

    def start(self) -> None:
        """As Hand.start; the axes' travel is that of the machine, within the drives' software limits 0x607D."""
        self._start()

    def read(self) -> dict[str, float]:
        """As Hand.read."""
        return dict(zip(self._names, self._drivers.exchange(), strict=True))

    def write(self, places: Mapping[str, float], speeds: Mapping[str, float]) -> None:
        """As Hand.write."""
        self._drivers.write([places[name] if name in places else speeds[name] for name in self._names])

    def home(self, methods: Mapping[str, int], watch: Watch) -> None:
        """As Hand.home: homing mode 6, one axis after the other, while the others have no power."""
        self._drivers.close()
        self._drivers = self._open(methods)
        try:
            self._start(watch)
        except MachineError:
            raise
        except Exception:  # of the watch
            self._drivers.close()
            self._drivers = self._open({})
            self._start()
            raise

    def close(self) -> None:
        """As Hand.close: a quick stop, then no power."""
        self._drivers.close()

    def _answering(self) -> set[str]:
        from rds.bus.modules.cia402.scan import scan
        from rds.bus.modules.cia402.settings import read_settings

        settings = read_settings(self._bus.get("cia402", {}), self._machine, list(self.spindles))
        where = {"channel": default_channel(self._machine, self._bus["interface"], self._bus.get("channel"))}
        options = {key: value for key, value in (self._bus | where).items() if key != "cia402"}
        nodes = {device.node for device in scan(timeout=_ANSWERS_IN, **options) if device.is_drive}
        return {drive.axis.name for drive in settings.drives if drive.node in nodes}

    def _open(self, methods: Mapping[str, int]) -> Drivers:
        table = _drive_table(self._bus.get("cia402", {}), self._machine, self.spindles, methods)
        bus = self._bus | {"cia402": table}
        return open_drivers("cia402", self._machine, self._names, self.period, False, bus)

    def _start(self, *watch: Watch) -> None:
        self._drivers.start(*watch)
        for name, (low, high) in zip(self._names, self._drivers.limits, strict=True):
            if name in self.axes:
                lowest, highest = self._machine.axis(name).travel
                margin = _FROM_SWITCHES * (highest - lowest)
                travel = max(lowest + margin, low), min(highest - margin, high)
                if not travel[0] < travel[1]:
                    raise MachineError(
                        f"the software limits of {name} (0x607D), {low:g} to {high:g} {self.axes[name].unit}, leave "
                        f"nothing of its travel, {lowest:g} to {highest:g}: correct them, or the machine's file"
                    )
                self.axes[name] = replace(self.axes[name], travel=travel)


def _drive_table(
    given: Mapping[str, Any], machine: Machine, spindles: Mapping[str, Any], methods: Mapping[str, int]
) -> dict[str, Any]:
    """The `[bus.cia402]` table to jog with: `given`, but for modes, positions, and homing where `methods` ask for it.

    A method that the table gives is kept, with its home. Another one that ends at a limit switch makes this end of the
    travel home.
    """
    from rds.bus.modules.cia402.homing import METHODS
    from rds.bus.modules.cia402.servo import NEGATIVE

    tables = {name: dict(table) for name, table in given.get("axis", {}).items()}
    for name in machine.axes:
        table = tables.setdefault(name, {})
        table["mode"] = "csv" if name in spindles else "csp"
        own = {key: table.pop(key) for key in ("homing", "home") if key in table}
        if name in methods:
            if not own:
                own["homing"] = methods[name]
                switch = METHODS[methods[name]].switch
                if switch:
                    lower = (switch == NEGATIVE) == (table.get("direction", 1) == 1)
                    own["home"] = machine.axis(name).travel[0 if lower else 1]
            table |= own
    return dict(given) | {"mode": "csp", "positions": "drive", "axis": tables}
