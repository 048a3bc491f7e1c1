"""A model alone under a voltage: `lsim`, with the arguments of scipy's and python-control's functions of that name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import ContractError, InputError
from rds.core.toml_table import TomlTable
from rds.machines import load_machine
from rds.modes.experiment.experiment_file import EXPERIMENT
from rds.modes.experiment.parts import Setting, make_model

_REGULAR = 1e-6  # of a sample period: how far a time may be off the grid


def lsim(
    system: Any,
    U: Any,
    T: Any,
    X0: Any = None,
    params: Mapping[str, Any] | None = None,
    *,
    machine: str = "mini-cnc",
    axis: str = "X",
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The response of a model to a voltage, without loop, converter or encoder: `(T, yout, xout)` as scipy's lsim.

    `system` is what `rds.Experiment` takes as `model`: a library model's name, a file, functions, a python-control
    system, an `rds.Model`. `U` is the voltage in V, one number or one for each time, held from each time to the
    next. `T` are the times in s, at equal distances (N,). `X0` is the first state (default: the model's own) and
    `params` stand over the model's. Returns the times (N,), the output at each (N,), and the states (N, n), in the
    model's units. `axis` of `machine` lends a library model its numbers.

    Raises InputError for times, voltages, states or parameters that do not fit, ContractError for a model that fails.
    """
    times = _numbers("T", T)
    if times.ndim != 1 or len(times) < 2 or not np.all(np.isfinite(times)):
        raise InputError(
            f"T has the shape {times.shape}; give two times or more in s, as np.arange(0.0, 1.0, 0.001) does"
        )
    period = float((times[-1] - times[0]) / (len(times) - 1))
    if period <= 0.0 or np.abs(times - times[0] - period * np.arange(len(times))).max() > _REGULAR * period:
        raise InputError("the times in T are not at equal distances; give them as np.arange(0.0, 1.0, 0.001) does")
    voltage = _numbers("U", U)
    if voltage.shape not in ((), (1,), times.shape) or not np.all(np.isfinite(voltage)):
        raise InputError(
            f"U has the shape {voltage.shape}; give one finite voltage in V, or {len(times)}, one for each time"
        )
    voltage = np.broadcast_to(voltage, times.shape)
    chosen = load_machine(machine)
    setting = Setting(chosen.axis(axis), period, np.inf, Path.cwd())
    model = make_model(TomlTable({"model": system}, EXPERIMENT), setting)
    if unknown := [name for name in params or {} if name not in model.params]:
        raise InputError(f"the model has no parameter {unknown[0]!r}; it has {', '.join(model.params) or 'none'}")
    numbers = dict(model.params) | dict(params or {})
    state = model.initial_state if X0 is None else np.atleast_1d(_numbers("X0", X0)).tolist()
    if np.shape(state) != (len(model.initial_state),) or not np.all(np.isfinite(state)):
        raise InputError(
            f"X0 = {list(state)} does not fit; give {len(model.initial_state)} finite numbers, one for each state"
        )
    states = np.empty((len(times), len(state)))
    output = np.empty(len(times))
    for k, u in enumerate(voltage):
        states[k] = state
        output[k] = model.seen(state, numbers, times[k])
        if not np.all(np.isfinite(states[k])):
            raise ContractError(
                f"the model's state is {list(state)} at t = {times[k]:g} s; check its equations and units"
            )
        if k + 1 < len(times):
            state = model.moved(state, float(u), period, numbers, times[k])
    return times, output, states


def _numbers(name: str, values: Any) -> np.ndarray:
    try:
        kind = np.asarray(values).dtype
        if kind.kind in "cmM":  # numpy would drop what is imaginary, and count dates in ns
            raise TypeError(f"it has the type {kind}")
        return np.asarray(values, float)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{name} = {values!r:.100} is not made of real numbers: {error}; give an array of floats"
        ) from error
