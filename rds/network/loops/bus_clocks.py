"""The clocks of a machine's modules on CAN: offset and drift by messages, and what they leave of a circle.

One call asks all modules at the same instant, which each tells by its own clock; CAN makes that instant common to all
(no message of theirs has to come in time). What the host's clock showed then is the middle between sending the call and
the first answer: the same for all, so that between modules the delay of the messages cancels.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import can
import numpy as np

from rds.bus.hub.bus_settings import SERIAL
from rds.bus.modules.dialects import DEFAULT, bus_interface, is_served
from rds.bus.modules.drift import drifts
from rds.bus.modules.rds import frames
from rds.bus.modules.server_process import end_server, start_server
from rds.bus.tools.link import BUILTIN, bus_name, default_channel, open_bus
from rds.bus.tools.listening import pause
from rds.core.errors import InputError, MachineError
from rds.core.quantities import Quantity
from rds.machines import load_machine
from rds.machines.machine import Machine
from rds.network.clocks import ClockEstimate, circle_error

SECONDS = Quantity("how long to ask", "s", 0.5, 3600.0, default=5.0)
PERIOD = Quantity("between two calls", "s", 0.005, 10.0, default=0.05)
RADIUS = Quantity("of the circle", "mm", above=0.0, high=1e4, default=20.0)
FEED = Quantity("along the circle", "mm/s", above=0.0, high=1e4, default=20.0)
AFTER = 60.0  # s after which the circle is judged without synchronization
_ANSWER = 0.2  # s
_LEARNING = 10  # calls before predictions count


@dataclass(frozen=True)
class BusClocks:
    """What was found of each module: estimates, errors of predictions (calls × modules, s), clocks set once (same)."""

    machine: str
    axes: Sequence[str]
    estimates: Sequence[ClockEstimate]
    errors: np.ndarray
    trip: float  # s: shortest from the call to the first answer
    radius: float  # mm
    feed: float  # mm/s

    def apart(self) -> tuple[float, np.ndarray]:
        """Seconds that the first two modules' clocks are apart `AFTER` s after they were set; and with estimates."""
        first, second = self.estimates[:2]
        return (first.rate - second.rate) * AFTER, self.errors[_LEARNING:, 0] - self.errors[_LEARNING:, 1]

    def circles(self) -> tuple[float, float]:
        """The largest contour error of the circle, mm, without synchronization and with it."""
        without, with_ = self.apart()
        return self._circle(without), self._circle(float(np.abs(with_).max()))

    def _circle(self, apart: float) -> float:
        return float(np.abs(circle_error(self.radius, self.feed, np.full(720, apart))).max())

    def to_json(self) -> dict[str, Any]:
        """Plain values for json.dumps."""
        without, with_ = self.circles()
        return {
            "machine": self.machine,
            "clocks": {
                name: {
                    "drift_ppm": each.drift,
                    "error_us": each.error * 1e6,
                    "worst_us": float(np.abs(self.errors[_LEARNING:, i]).max() * 1e6),
                    "answers": each.answers,
                    "left_out": each.left_out,
                }
                for i, (name, each) in enumerate(zip(self.axes, self.estimates, strict=True))
            },
            "round_trip_us": self.trip * 1e6,
            "circle": {
                "radius_mm": self.radius,
                "feed_mm_s": self.feed,
                "without_um": without * 1e3,
                "with_um": with_ * 1e3,
            },
        }

    def __str__(self) -> str:
        lines = [
            f"clocks of {self.machine}, against the host's:",
            "axis      drift     prediction, rms   worst   answers",
        ]
        for i, (name, each) in enumerate(zip(self.axes, self.estimates, strict=True)):
            worst = np.abs(self.errors[_LEARNING:, i]).max() * 1e6
            used = f"{each.answers} of {each.answers + each.left_out}"
            lines.append(f"{name:8}{each.drift:8.2f} ppm {each.error * 1e6:8.1f} µs {worst:11.1f} µs   {used}")
        without, with_ = self.circles()
        x, y = self.axes[:2]
        lines += [
            f"shortest round trip {self.trip * 1e6:.0f} µs: an offset to the host's clock can be wrong by half of it",
            f"circle of {self.radius:g} mm at {self.feed:g} mm/s, played by {x} and {y} from buffers by their clocks:",
            f"  clocks set once, {AFTER:g} s ago   {without * 1e3:9.3f} µm off",
            f"  clocks synchronized         {with_ * 1e3:9.3f} µm off (the worst prediction)",
        ]
        return "\n".join(lines)


def measure_clocks(
    machine: str,
    *,
    seconds: float = 5.0,
    period: float = 0.05,
    interface: str = BUILTIN,
    channel: str | None = None,
    drift: str | None = None,
    radius: float = 20.0,
    feed: float = 20.0,
    **options: Any,
) -> BusClocks:
    """Ask the modules of a machine (dialect rds) for their clocks; nothing moves. `options` go to the interface.

    Where none is served on the built-in bus, the machine is started for this, its clocks off by `drift` ("X:50").
    InputError for words that will not do, MachineError for modules that do not answer.
    """
    for declared, value, name in (
        (SECONDS, seconds, "seconds"),
        (PERIOD, period, "period"),
        (RADIUS, radius, "radius"),
        (FEED, feed, "feed"),
    ):
        declared.check(value, name)
    if seconds < 2 * _LEARNING * period:
        raise InputError(f"seconds = {seconds:g} are too few: at least {2 * _LEARNING} calls, one every {period:g} s")
    loaded = load_machine(machine)
    if len(loaded.axes) < 2:
        raise InputError(f"machine {loaded.name} has one axis; clocks that run apart take two", loaded.path)
    if bus_interface(loaded, {}) == SERIAL:
        raise InputError(
            f"{loaded.name} has units on a serial line, which tell no clocks; what drift costs their motion, "
            "`rds nc run FILE --method B,B-free --option drift=X:50` says",
            loaded.path,
        )
    place = default_channel(loaded, interface, channel)
    if drift is not None:
        drifts(drift, loaded)
    with ExitStack() as stack:
        served = is_served(DEFAULT, loaded, interface, place, **options)
        if drift is not None and (served or interface != BUILTIN):
            raise InputError("--drift is of a machine that is started here; give it to `rds machine serve`")
        if not served:
            if interface != BUILTIN:
                raise MachineError(f"no module of {loaded.name} answers on {bus_name(interface, place)}")
            server = start_server(DEFAULT, machine, str(place), {**options, **({"drift": drift} if drift else {})})
            stack.callback(end_server, server)
        bus = open_bus(interface, place, node="clocks", **options)
        stack.callback(bus.shutdown)
        try:
            estimates, errors, trip = _ask(bus, loaded, seconds, period)
        except can.CanError as error:
            raise MachineError(f"bus {bus_name(interface, place)} failed: {error}") from error
    return BusClocks(loaded.name, list(loaded.axes), estimates, errors, trip, radius, feed)


def _ask(
    bus: can.BusABC, machine: Machine, seconds: float, period: float
) -> tuple[list[ClockEstimate], np.ndarray, float]:
    nodes = [axis.node for axis in machine.axes.values()]
    estimates = [ClockEstimate() for _ in nodes]
    errors: list[list[float]] = []
    trips, missed = [], 0
    call = can.Message(arbitration_id=frames.CALL, is_extended_id=False, data=frames.TIME)
    while len(errors) < round(seconds / period):
        told, sent, received = _answers(bus, call, nodes)
        if len(told) < len(nodes):
            missed += 1
            if missed > 20:
                silent = [name for name, axis in machine.axes.items() if axis.node not in told]
                raise MachineError(f"{', '.join(silent)} do not tell their clocks; modules of dialect rds do")
            continue
        middle = 0.5 * (sent + received)
        # the line before this answer against the answer
        errors.append([each.at(middle) - told[node] for each, node in zip(estimates, nodes, strict=True)])
        for each, node in zip(estimates, nodes, strict=True):
            each.take(sent, told[node], received)
        trips.append(received - sent)
        pause(period)
    return estimates, np.array(errors), min(trips)


def _answers(bus: can.BusABC, call: can.Message, nodes: Sequence[int]) -> tuple[dict[int, float], float, float]:
    """The clocks by node, and the host's times (s) of the call and of the first answer."""
    told: dict[int, float] = {}
    while bus.recv(0.0) is not None:  # answers to an earlier call
        pass
    sent = time.monotonic()
    bus.send(call, _ANSWER)
    received = sent
    while len(told) < len(nodes) and (left := sent + _ANSWER - time.monotonic()) > 0.0:
        message = bus.recv(left)
        found = None
        if message is not None and message.is_extended_id and not message.is_error_frame:
            found = frames.decode_clock(message.arbitration_id, message.data)
        if found is not None and found[0] in nodes:
            if not told:
                received = time.monotonic()
            told[found[0]] = found[1]
    return told, sent, received
