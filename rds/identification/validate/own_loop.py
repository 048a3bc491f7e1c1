"""The loop of one of our own results, from what the result says of itself: its controller, reference and limits.

A law of the library is made again with the parameters that were recorded, and is believed only if it answers the
recorded measurements with the recorded commands. Then the same loop runs in virtual time with another model in the
axis's place: encoder, law, converter, and the sample that a real bus takes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError, RdsError
from rds.core.types import Controller, Model, Reference
from rds.identification.logs.log import Log
from rds.identification.logs.result_log import is_result
from rds.results.result import Result, open_result

_SAME = 1e-6  # of the converter's range: a command that was made again
_FEW = 0.01  # of the samples, in which a run may have lost an answer
_PARTS = ("reference", "reference_velocity", "reference_acceleration")


@dataclass(frozen=True)
class OwnLoop:
    """What acted in a run of one axis: `simulate(model)` runs it with another model, and gives the result."""

    axis: str
    controller: Controller
    result: Result
    resolution: float  # mm, of the encoder; 0: none
    late: int  # samples from a command until it acts

    def simulate(self, model: Model) -> Result:
        """The recorded references followed by the recorded law, with `model` as the axis from the recorded place."""
        from rds.machines.encoder import encoder
        from rds.modes.parts import start

        result, axis, T = self.result, self.axis, self.result.sample_period
        measured = result[f"{axis}_measured"]
        begin = (float(measured[0]), *model.initial_state[1:]) if model.output is None else model.initial_state
        motion = start(replace(model, initial_state=begin), T)
        count = encoder(self.resolution, quantization=self.resolution > 0.0) or float
        limit = _limit(result.meta)
        found, waiting, state = np.empty(len(measured)), [0.0] * self.late, self.controller.initial_state
        control, params = self.controller.control, self.controller.params
        for k, r in enumerate(_references(result, axis)):
            found[k] = y = count(motion.read())
            u, state = control(k * T, r, y, state, params)
            waiting.append(min(max(float(u), -limit), limit))
            motion.write(waiting.pop(0))
        columns = {"time": result["time"], f"{axis}_reference": result[f"{axis}_reference"], f"{axis}_measured": found}
        return Result(columns, meta={"axes": [axis], "sample_period": T})


def own_loop(log: Log) -> OwnLoop | str | None:
    """The loop that was logged; a clause on why there is none to simulate; None for what is no controlled run of ours.

    A law of somebody's own file is not run for a verdict: the clause asks for the experiment.
    """
    path = Path(log.source)
    if not log.closed_loop or not log.source or not path.exists() or not is_result(path):
        return None
    result = open_result(path)
    axis = log.name.rpartition(":")[2] if len(result.axes) > 1 else result.axes[0]
    about = (result.meta.get("controller") or {}).get(axis)
    if not isinstance(about, Mapping):
        return None
    if about.get("path") or about.get("source"):
        return f"the controller was {about.get('name')}, a file of somebody's own: give --loop EXPERIMENT.toml"
    if any(f"{axis}_{part}" not in result for part in (*_PARTS, "command", "voltage")):
        return "the result lacks columns of its reference or its voltages"
    if result.meta.get("verdict") in ("missed", "void"):
        return "samples of the run were late, and a loop without that is another one"
    if result.meta.get("changes"):
        return "live values were changed during the run"
    try:
        controller = _made(about, result, axis)
    except (RdsError, TypeError, ValueError) as error:
        return f"its controller cannot be made again ({error})"
    late = _late(result, axis)
    if late is None or not _answers_alike(controller, result, axis):
        return "its controller, made again, gives other commands than the recorded ones"
    resolution = 0.0 if result.meta.get("quantization") is False else log.resolution or 0.0
    return OwnLoop(axis, controller, result, resolution, late)


def _made(about: Mapping[str, Any], result: Result, axis: str) -> Controller:
    """The library's law with the recorded options; what follows from them is made anew."""
    from rds.controllers import controller_module, library_controller

    name, params = str(about["name"]), dict(about.get("params") or {})
    known = controller_module(name).OPTIONS
    options = {key: value for key, value in params.items() if key in known and value is not None}
    design = ((result.meta.get("model") or {}).get(axis) or {}).get("params") or {}
    unit = result.units.get(f"{axis}_measured") or "mm"
    made = library_controller(name, design, result.sample_period, _limit(result.meta), unit=unit, **options)
    if not isinstance(made, Controller):
        raise InputError(f"{name} is no law of one axis")
    return made


def _limit(meta: Mapping[str, Any]) -> float:
    reach = meta.get("voltage_range")
    return float(reach) if meta.get("saturation", True) and reach else inf


def _references(result: Result, axis: str) -> list[Reference]:
    columns = (result[f"{axis}_{part}"].tolist() for part in _PARTS)
    return [Reference(*row) for row in zip(*columns, strict=True)]


def _answers_alike(controller: Controller, result: Result, axis: str) -> bool:
    """Whether the law answers each recorded measurement with the recorded command."""
    state, T = controller.initial_state, result.sample_period
    commands = result[f"{axis}_command"]
    found = np.empty(len(commands))
    rows = zip(_references(result, axis), result[f"{axis}_measured"].tolist(), strict=True)
    for k, (r, y) in enumerate(rows):
        found[k], state = controller.control(k * T, r, y, state, controller.params)
    scale = float(result.meta.get("voltage_range") or 10.0)
    return bool(np.mean(np.abs(found - commands) > _SAME * scale) <= _FEW)


def _late(result: Result, axis: str) -> int | None:
    """After how many samples the commands act: 0 or 1; None where neither explains the voltages."""
    limit = _limit(result.meta)
    asked, acting = np.clip(result[f"{axis}_command"], -limit, limit), result[f"{axis}_voltage"]
    step = 1e-3 * float(result.meta.get("voltage_range") or 10.0)  # of the converter
    for late in (0, 1):
        off = np.abs(acting[late:] - asked[: len(asked) - late]) > step
        if np.mean(off) <= _FEW:
            return late
    return None
