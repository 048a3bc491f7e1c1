"""The delays of a machine's loop, measured: τ = τ_sc + τ_c + τ_ca (dcs-thesis, equation 2.1), bus load and host load.

The loop is that of a run: each sample the drivers send a tick and wait for the answers, the laws compute, the voltages
wait in the drivers. It is a dry run: the machine does not move. A second node on the bus tells when frames were on it:

    τ_ca   from the host's sending until the command is on the bus
    τ_sc   from then, when the modules read their encoders, until the host has all answers
    τ_c    until the laws have their voltages
"""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import dataclass, replace
from math import isfinite, nan
from pathlib import Path
from typing import Any

import numpy as np

from rds.bus.hub.bus_settings import DEFAULT_BAUD, SERIAL
from rds.core.clock import LatePolicy, RealTimeClock
from rds.core.contracts import Drivers
from rds.core.errors import InputError
from rds.core.quantities import Quantity
from rds.modes import SYSTEM_TEST
from rds.modes.experiment.experiment import Experiment
from rds.modes.loop.plan import Plan
from rds.modes.loop.stopwatch import quiet_memory
from rds.modes.process.machine import machine_behind
from rds.network.loops.bus_times import Directions, Frame, directions
from rds.network.loops.host_load import HostLoad
from rds.network.trace import write_trace

PERCENTILES = (50.0, 95.0, 99.0, 99.9)
SECONDS = Quantity("how long to measure", "s", 0.05, 3600.0, default=5.0)
_STEADY = 1.0  # s at most of the host's load with nothing to do
_WARM = 50  # samples before the first that counts


@dataclass(frozen=True)
class Measurement:
    """What was measured: delays of each sample in s (NaN: lost), and loads."""

    machine: str
    bus: str
    sample_period: float  # s
    sensor: np.ndarray
    computing: np.ndarray
    actuator: np.ndarray
    lateness: np.ndarray  # s from when a sample was due until its tick was sent
    split_error: float  # s: how far the split between both directions can be wrong
    bus_load: float  # % of the bit rate; NaN where no second node can listen
    bitrate: int  # bit/s that the load is of
    host: HostLoad

    @property
    def total(self) -> np.ndarray:
        """τ of each sample, s; NaN where a message was lost."""
        return self.sensor + self.computing + self.actuator

    def parts(self) -> dict[str, np.ndarray]:
        """The delays by their names."""
        named = {"sensor": self.sensor, "computing": self.computing, "actuator": self.actuator}
        return named | {"total": self.total, "lateness": self.lateness}

    def to_json(self) -> dict[str, Any]:
        """Plain values for json.dumps: delays in µs."""
        return {
            "machine": self.machine,
            "bus": self.bus,
            "sample_period_s": self.sample_period,
            "samples": len(self.sensor),
            "delays_us": {name: _summary(values) for name, values in self.parts().items()},
            "split_error_us": _finite(self.split_error * 1e6),
            "bus_load_percent": _finite(self.bus_load),
            "bitrate": self.bitrate,
            "host_load_percent": self.host.summary(),
        }

    def save(self, path: str | Path) -> None:
        """The delays as a trace that a [network] table reads."""
        about = f"delays of {self.machine} on {self.bus} at {self.sample_period:g} s a sample, s"
        columns = {"sensor": self.sensor, "computing": self.computing, "actuator": self.actuator}
        write_trace(path, columns, (about,))

    def __str__(self) -> str:
        told = self.to_json()
        lines = [
            f"{self.machine} on {self.bus}, {len(self.sensor)} samples of {self.sample_period * 1e3:g} ms",
            f"{'delay, µs':<26}{'mean':>8}{'50 %':>8}{'95 %':>8}{'99 %':>8}{'99.9 %':>9}{'max':>9}{'lost':>7}",
        ]
        names = {
            "sensor": "sensor to controller",
            "computing": "computing",
            "actuator": "controller to actuator",
            "total": "in all",
            "lateness": "tick late by",
        }
        for name, summary in told["delays_us"].items():
            cells = [summary[key] for key in ("mean", "p50", "p95", "p99", "p99.9", "max")]
            shown = [f"{'-' if cell is None else format(cell, '.1f'):>8}" for cell in cells]
            lines.append(f"{names[name]:<26}{''.join(shown[:4])} {shown[4]} {shown[5]}{summary['lost']:>7}")
        lines.append(f"the split between both directions is good to ± {self.split_error * 1e6:.0f} µs")
        if isfinite(self.bus_load):
            lines.append(f"bus load {self.bus_load:.1f} % of {self.bitrate / 1e3:g} kbit/s")
        for phase, load in told["host_load_percent"].items():
            whole = "" if load["computer_mean"] is None else f", the computer {load['computer_mean']:.0f} %"
            mean, most = load["process_mean"], load["process_max"]
            lines.append(f"host's load, {phase}: {mean:.0f} % of a processor (most {most:.0f} %){whole}")
        return "\n".join(lines)


def measure(
    machine: str = "mini-cnc",
    *,
    seconds: float = 5.0,
    sample_period: float | None = None,
    bus: dict[str, Any] | None = None,
    controller: Any = "p",
    real_time: bool = False,
) -> Measurement:
    """Measure the loop of all axes of a machine for `seconds`; one that is not there is started, on the built-in bus.

    `bus` is a [bus] table. With `real_time` this process has the scheduling of a run's target while it
    measures. Raises InputError for what will not do, and MachineError for a machine that does not answer.
    """
    SECONDS.check(seconds, "seconds", "measure")
    plan = _plan(machine, sample_period, bus or {}, controller)
    with ExitStack() as stack:
        if real_time:
            from rds.modes.process.environment import prepared

            stack.enter_context(prepared(plan.priority, plan.cpu))
        host = HostLoad("started")
        reached = stack.enter_context(machine_behind(plan))
        host.enter("steady")
        host.rest(min(seconds, _STEADY))
        return _measured(reached, max(int(seconds / plan.T), 20), host)


def _plan(machine: str, sample_period: float | None, bus: dict[str, Any], controller: Any) -> Plan:
    """A run in which nothing moves: all axes that a command carries, held where they stand."""
    from rds.machines import load_machine

    axes = [name for name, axis in load_machine(machine).axes.items() if not axis.is_spindle]
    if not axes:
        raise InputError(f"machine {machine!r} has no axis but spindles; a loop of positions is measured")
    experiment = Experiment(
        machine,
        axes,
        duration=1.0,
        sample_period=sample_period,
        reference={"kind": "constant", "value": 0.0},
        controller=controller,
        bus=bus or None,
    )
    return replace(experiment.plan(), mode=SYSTEM_TEST)


def _measured(plan: Plan, samples: int, host: HostLoad) -> Measurement:
    from rds.bus.modules.dialects import DEFAULT, open_drivers
    from rds.bus.modules.shared_bus import OPEN_TO_MANY
    from rds.bus.tools.link import bus_name, bus_options, open_bus
    from rds.bus.tools.statistics import BITRATE, Statistics

    bus = dict(plan.bus)
    bus.pop("faults", None)
    dialect = bus.pop("dialect", DEFAULT)
    interface, channel = bus["interface"], bus.get("channel")
    bitrate = int(bus.get("baud", DEFAULT_BAUD) if interface == SERIAL else bus.get("bitrate", BITRATE))
    watcher = None
    if interface in OPEN_TO_MANY:  # nobody else can listen on a serial line, and most adapters are opened once
        watcher = open_bus(interface, channel, None, node="watcher", **bus_options(bus))
    clock = RealTimeClock(round(plan.T * 1e9), LatePolicy(discard=True))
    drivers = None
    try:
        host.enter("set up")
        drivers = open_drivers(dialect, plan.machine, plan.names, plan.T, True, bus)
        drivers.start()
        while watcher is not None and watcher.recv(0.0) is not None:
            pass  # frames of the start
        statistics = Statistics(bitrate, bus.get("data_bitrate"))
        host.enter("running")
        times, frames = _loop(plan, drivers, clock, watcher, statistics, samples, host)
    finally:
        if drivers is not None:
            drivers.close()
        if watcher is not None:
            watcher.shutdown()
    late, sent, received, computed = (np.array(column) * 1e-9 for column in zip(*times, strict=True))
    found: Directions = directions(sent, received, frames, len(plan.axes))
    return Measurement(
        machine=plan.machine.name,
        bus=bus_name(interface, channel),
        sample_period=plan.T,
        sensor=found.sensor,
        computing=computed - received,
        actuator=found.actuator,
        lateness=late,
        split_error=found.split_error,
        bus_load=statistics.snapshot().load if watcher is not None else _line_load(plan, bus, interface),
        bitrate=bitrate,
        host=host,
    )


def _line_load(plan: Plan, bus: dict[str, Any], interface: str) -> float:
    """Share of the period that a frame and the answers of all units take on a serial line, %; NaN of another bus."""
    if interface != SERIAL:
        return nan
    from rds.bus.modules.dcs.drivers import exchange_time

    baud, checksum = float(bus.get("baud", DEFAULT_BAUD)), bool(bus.get("checksum", True))
    return 100.0 * exchange_time(baud, len(plan.machine.axes), checksum) / plan.T


def _loop(
    plan: Plan, drivers: Drivers, clock: RealTimeClock, watcher: Any, statistics: Any, samples: int, host: HostLoad
) -> tuple[list[tuple[int, int, int, int]], list[list[Frame]]]:
    """The samples' lateness, and when they were sent, answered and computed (ns); and the frames of each sample."""
    laws = plan.start().laws
    times: list[tuple[int, int, int, int]] = []
    frames: list[list[Frame]] = []
    now = time.perf_counter_ns
    k, last = 0, samples + _WARM
    with quiet_memory():
        clock.start()
        while k < last:
            k = clock.wait(k)
            sent = now()
            positions = drivers.exchange()
            received = now()
            voltages: list[float] = []
            row: list[float] = [k]
            for law in laws:
                law(k % plan.samples, positions, row, voltages)
            computed = now()
            drivers.write([0.0] * len(voltages))
            heard: list[Frame] = []
            while watcher is not None and (frame := watcher.recv(0.0)) is not None:
                heard.append((frame.timestamp, frame.arbitration_id))
                if k >= _WARM:
                    statistics.add(frame)
            host.read()
            if k >= _WARM:
                times.append((clock.lateness(k, sent), sent, received, computed))
                frames.append(heard)
            k += 1
    return times, frames


def _summary(values: np.ndarray) -> dict[str, Any]:
    whole = values[np.isfinite(values)] * 1e6
    lost = int(len(values) - len(whole))
    if not len(whole):
        return {"mean": None, "deviation": None, "max": None, "lost": lost} | {f"p{p:g}": None for p in PERCENTILES}
    percentiles = {f"p{p:g}": float(np.percentile(whole, p)) for p in PERCENTILES}
    told = {"mean": float(whole.mean()), "deviation": float(whole.std()), "max": float(whole.max()), "lost": lost}
    return told | percentiles


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
