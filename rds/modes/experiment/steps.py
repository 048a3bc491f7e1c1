"""A run that a `for` loop takes sample by sample: reference and measured position out, command voltage in."""

from __future__ import annotations

import secrets
import threading
from contextlib import suppress
from math import isfinite
from multiprocessing.connection import Connection, Listener
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.types import Controller, Reference, Source
from rds.modes import DEFAULT, load_mode
from rds.modes.experiment.experiment import Experiment
from rds.modes.loop.caller_control import PATIENCE, CallerControl, answer, question
from rds.results import Result

_POLL = 0.05  # s


class Step:
    """One sample: `t` (s), `reference` (position, velocity, acceleration), `measured`; the loop sets `voltage` (V).

    Positions are in the axis's unit. With several axes, all but `t` are arrays in axis order.
    """

    __slots__ = ("measured", "reference", "t", "voltage")

    t: float
    reference: Reference
    measured: Any
    voltage: Any

    def __init__(self, t: float, reference: Reference, measured: Any):
        for name, value in (("t", t), ("reference", reference), ("measured", measured), ("voltage", None)):
            object.__setattr__(self, name, value)

    def __setattr__(self, name: str, value: Any) -> None:
        if name != "voltage":
            raise AttributeError(f"step.{name} cannot be set: a loop sets step.voltage, and reads the rest of a step")
        object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        return f"Step(t={self.t!r}, reference={self.reference!r}, measured={self.measured!r}, voltage={self.voltage!r})"


class Steps:
    """What `rds.steps` gives: iterate over it once, then look at its `result`."""

    def __init__(self, axes: int, patience: float | None):
        self._n = axes
        self._step: Step | None = None
        self._over = False
        self._line: Connection | None = None
        self._connected = threading.Event()
        key = secrets.token_bytes(32)
        self._listener = Listener(backlog=1, authkey=key)  # a socket in a folder that only its user may enter
        self.controller = Controller(
            CallerControl(self._listener.address, key, axes, patience),
            source=Source("a for loop"),
            coupled=axes > 1,
            repeatable=False,
        )

    def begin(self, experiment: Experiment, mode: str, out: str | Path | None) -> Steps:
        """Start the run of an experiment that has `controller`."""
        threading.Thread(target=self._accept, name="rds steps", daemon=True).start()
        self._run = experiment.start(mode, out=out)
        return self

    def __iter__(self) -> Steps:
        if self._over:
            raise InputError("this run is over: `result` has what it recorded; for another run call rds.steps again")
        return self

    def __next__(self) -> Step:
        """The next sample, after the last one's voltage has gone out; the run's own errors end the iteration."""
        if self._step is not None:
            self._answer(self._voltages(self._step))
        self._step = self._asked()
        if self._step is None:
            self._ended()
            raise StopIteration
        return self._step

    def __enter__(self) -> Steps:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def result(self) -> Result:
        """The run's result, with all that was recorded. A run whose loop was left early (`break`) is ended first."""
        self.stop()
        return self._run.wait()

    def stop(self) -> None:
        """End the run, at 0 V from here on; does nothing where it is over."""
        if self._over:
            return
        self._run.stop()
        rest = [0.0] * self._n
        if self._step is not None:
            self._answer(rest)
        while self._asked() is not None:
            self._answer(rest)
        self._step = None
        self._close()
        with suppress(Exception):  # `result` tells
            self._run.wait()

    def _asked(self) -> Step | None:
        """The loop's next question; None once the run is over."""
        while not self._connected.wait(_POLL):
            if self._run.done:
                return None
        line = self._line
        assert line is not None
        try:
            while not line.poll(_POLL):
                if self._run.done:
                    return None
            t, *values = question(self._n).unpack(line.recv_bytes())
        except (EOFError, OSError):
            return None
        if self._n == 1:
            p, v, a, y = values
            return Step(t, Reference(p, v, a), y)
        p, v, a, y = np.array(values).reshape(4, self._n)
        return Step(t, Reference(p, v, a), y)  # type: ignore[arg-type]

    def _answer(self, voltages: list[float]) -> None:
        assert self._line is not None
        with suppress(OSError):  # the run is over: the next question tells
            self._line.send_bytes(answer(self._n).pack(*voltages))

    def _voltages(self, step: Step) -> list[float]:
        given = step.voltage
        with suppress(TypeError, ValueError):
            if isinstance(given, str | bytes | bool):  # which NumPy reads as numbers
                raise TypeError
            values: list[float] = np.asarray(given, dtype=float).reshape(self._n).tolist()
            if all(map(isfinite, values)):
                return values
        wanted = "a finite number in V" if self._n == 1 else f"{self._n} finite numbers in V, one for each axis"
        said = f"at t = {step.t:.3f} s step.voltage is {given!r}; set it to {wanted} before the loop's next turn"
        self.stop()
        raise InputError(said)

    def _ended(self) -> None:
        self._close()
        self._run.wait()

    def _close(self) -> None:
        self._over = True
        if self._line is not None:
            self._line.close()
        self._listener.close()

    def _accept(self) -> None:
        try:
            self._line = self._listener.accept()
        except Exception:  # closed before the run asked for anything, or somebody without the key
            return
        self._connected.set()

    def __del__(self) -> None:
        with suppress(Exception):
            if not self._over:
                self._run.stop()
                self._close()


def steps(
    machine: str = "mini-cnc",
    axis: Any = "X",
    mode: str = DEFAULT,
    duration: float | None = None,
    sample_period: float | None = None,
    *,
    out: str | Path | None = None,
    **parts: Any,
) -> Steps:
    """A run that a `for` loop of your own controls, in any mode that has controllers.

        run = rds.steps(axis="X", duration=5.0, reference=rds.sinusoid(5.0, 0.2))
        for step in run:
            step.voltage = 30.0 * (step.reference.position - step.measured)
        print(run.result.metrics)

    The arguments are those of `rds.Experiment` but for `controller`, and `out` as of its `run`. Each turn of the loop
    is one sample: in simulation as fast as the loop goes, in emulation and implementation when the clock says so, where
    the verdict on timing counts the loop's time as the controller's. What does not keep up with 1 ms takes a longer
    `sample_period`. With several axes the voltages are an array in axis order. A loop that is left by `break` ends the
    run; one that gives no voltage for 5 s of real time does so, too.

    Raises InputError for what will not do, and in the loop what `Experiment.run` raises.
    """
    if "controller" in parts:
        raise InputError("the for loop is the controller: leave out `controller`, or use rds.Experiment")
    axes = 1 if isinstance(axis, str) else len(list(axis))
    made = Steps(axes, PATIENCE if load_mode(mode).real_time else None)
    try:
        experiment = Experiment(machine, axis, mode, duration, sample_period, controller=made.controller, **parts)
        return made.begin(experiment, mode, out)
    except BaseException:
        made._close()
        raise
