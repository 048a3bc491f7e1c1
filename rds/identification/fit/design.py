"""From a fitted model to a controller in one call: the general tracking controller of mini-cnc-rds, equations 4 to 9.

It is designed for the linear part of the axis: τ and K, viscous friction included. Coulomb friction, play, delay and
the rest are not in its law; `design_notes` says which of them the model has, and `rds robustness` what they do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from rds.controllers import tracking
from rds.core.adapt import is_control_system
from rds.core.atomic import keep_another, write_whole
from rds.core.errors import InputError
from rds.core.types import SPINDLE_UNIT, Controller
from rds.identification.fit.estimate import Estimate
from rds.identification.fit.model_file import ModelFile, read_model
from rds.identification.fit.run_model import run_model
from rds.identification.structures.signals import POSITIONS
from rds.machines import Machine
from rds.models.machine_model import MachineAxisMotion, linear_part

LEFT_OUT = {
    **dict.fromkeys(
        ("friction_plus", "friction_minus"),
        "Coulomb friction: a tracking error remains that changes with the direction",
    ),
    "stribeck": "Stribeck friction: stick and slip at the lowest speeds",
    "backlash": "play: it leaves an error of up to the play at each reversal, and may bring a limit cycle",
    "dead_zone": "the dead zone of the amplifier, which acts as more friction",
    "offset": "the amplifier's offset: a constant error remains, as there is no integral",
    "delay": "the delay, which takes phase margin",
    **dict.fromkeys(
        ("viscous_plus", "viscous_difference"),
        "viscous friction that differs by direction: tau and K are those of the mean of both",
    ),
}


@dataclass(frozen=True)
class Linear:
    """The linear part of a fitted axis: τ (s), K ((mm/s)/V), and sentences on what is not in it, and on what the fit
    warned of: parameters that are not to be used, or are guesses. `unit` is that of its position, where not mm.
    """

    tau: float
    K: float
    left_out: tuple[str, ...]
    name: str  # of the model file, or of the machine's axis
    doubts: tuple[str, ...] = ()
    unit: str = "mm"


def left_out_of(params: Mapping[str, Any]) -> tuple[str, ...]:
    """Sentences on what an axis with these parameters has, and a design by τ and K does not know of."""
    return tuple(dict.fromkeys(sentence for name, sentence in LEFT_OUT.items() if params.get(name)))


def linear_axis_of(model: Linear | ModelFile | Estimate | str | Path) -> Linear:
    """The linear part of the axis that a model file or a fit describes; InputError where it has none to track with.

    A student's structure needs parameters `tau` (s) and `K` ((mm/s)/V) with that meaning. What is linear stays.
    """
    if isinstance(model, Linear):
        return model
    if isinstance(model, Estimate):
        model = _unwritten(model)
    if is_control_system(model):
        raise InputError(
            f"a {type(model).__name__} of python-control is no fitted axis; give a model file or an estimate, or "
            "design by python-control and hand that system in as the controller of an Experiment"
        )
    file = model if isinstance(model, ModelFile) else read_model(model)
    made = run_model(file)
    if file.structure == "spindle":
        raise InputError(
            "a spindle has its speed measured, and there is nothing to observe; use the controller 'tracking' or 'pid'",
            file.path,
        )
    if not {"tau", "K"} <= set(made.params):
        raise InputError("the design needs tau (s) and K ((mm/s)/V), which this model does not have", file.path)
    params = linear_part(made.params) if made.motion is MachineAxisMotion else made.params
    left_out = [*left_out_of(made.params)]
    if file.is_student:
        left_out.append(f"whatever {Path(file.structure).name} has beside tau and K")
    name, unit = Path(file.path).name, file.output_unit or "mm"
    if not file.is_student:
        unit = POSITIONS[unit][0]  # of a log of speeds, the position that the library's axis has
    return Linear(float(params["tau"]), float(params["K"]), tuple(left_out), name, tuple(file.doubts()), unit)


def _unwritten(estimate: Estimate) -> ModelFile:
    """What the model file of a fit would hold of its model."""
    return ModelFile(
        estimate.structure,
        estimate.options,
        estimate.parameters,
        estimate.covariance,
        estimate.method,
        warnings=estimate.warnings,
        unidentifiable=estimate.unidentifiable,
        path=f"the fit of {estimate.structure}",
        output_unit=estimate.output_unit,
        command_unit=estimate.command_unit,
    )


def linear_axis_of_machine(machine: Machine, name: str) -> Linear:
    """The linear part of a machine's axis, by the model that the machine's file gives it; InputError for a spindle."""
    axis = machine.axis(name)
    if axis.unit == SPINDLE_UNIT:
        raise InputError(
            f"{name} is a spindle: its speed is measured, and there is nothing to observe; "
            "use the controller 'tracking' or 'pid'"
        )
    params = axis.model
    return Linear(params["tau"], params["K"], left_out_of(params), f"axis {name} of {machine.name}", unit=axis.unit)


def design_tracking(
    model: Linear | ModelFile | Estimate | str | Path,
    *,
    sample_period: float = 0.001,
    poles: Sequence[Any] = tracking.POLES,
    observer_pole: float = tracking.OBSERVER_POLE,
    voltage_range: float = 10.0,
) -> Controller:
    """The tracking controller for the axis of a model file or a fit.

    It is sampled every `sample_period` s and stays within ±`voltage_range` V; `poles` are the two poles of the error,
    `observer_pole` that of the velocity's observer, 1/s. Hand it in as the `controller` of an Experiment. InputError as
    for `linear_axis_of`, and for poles too fast for the sampled loop.
    """
    axis = linear_axis_of(model)
    options: dict[str, Any] = {"poles": poles, "observer_pole": observer_pole}
    return tracking.make({"tau": axis.tau, "K": axis.K}, sample_period, voltage_range, **options)


def tracking_system(
    model: Linear | ModelFile | Estimate | str | Path,
    *,
    sample_period: float | None = None,
    poles: Sequence[Any] = tracking.POLES,
    observer_pole: float = tracking.OBSERVER_POLE,
) -> Any:
    """The same controller as a `control.StateSpace` (continuous without a `sample_period`), for analysis."""
    from rds.controllers.design import tracking_controller_system

    axis = linear_axis_of(model)
    return tracking_controller_system(axis.tau, axis.K, poles, observer_pole, sample_period)


def write_tracking(path: str | Path, model: Linear | ModelFile | Estimate | str | Path, **options: Any) -> Path:
    """Write the controller of `design_tracking(model, **options)` as a file of the user's own, to read and change."""
    path = Path(path)
    if path.suffix != ".py":
        raise InputError("a controller is a Python file; give it a name that ends in .py", str(path))
    keep_another(path, "Tracking control designed for", "designed controller")
    axis = linear_axis_of(model)
    made = design_tracking(model, **options)
    period, limit = float(options.get("sample_period", 0.001)), float(options.get("voltage_range", 10.0))
    said_limit = f"{limit!r}" if isfinite(limit) else 'float("inf")'
    g1, g2, L, F, G, H = (made.params[name] for name in ("g1", "g2", "L", "F", "G", "H"))
    inverse_gain, inertia = made.params["coefficients"][:2]
    left_out = "".join(f"- {sentence}\n" for sentence in axis.left_out)
    not_in_it = f"\nIt knows nothing of:\n{left_out}" if left_out else ""
    doubts = "".join(f"- {sentence}\n" for sentence in axis.doubts)
    not_in_it += f"\nThe fit of tau and K warned:\n{doubts}" if doubts else ""
    text = _FILE.format(**locals()).replace("mm/s", f"{axis.unit}/s")
    return write_whole(path, text.encode())


_FILE = '''\
"""Tracking control designed for {axis.name}: tau = {axis.tau:.6g} s, K = {axis.K:.6g} (mm/s)/V.

For a loop sampled every {period!r} s: the observer's numbers hold for no other period.
{not_in_it}"""

sample_period = {period!r}  # s; a run of another one says so

params = {{
    "inertia": {inertia!r},  # V/(mm/s^2): tau / K
    "inverse_gain": {inverse_gain!r},  # V/(mm/s): 1 / K
    "g1": {g1!r},  # 1/s^2
    "g2": {g2!r},  # 1/s
    "L": {L!r},  # 1/s; of the observer, as the three below
    "F": {F!r},
    "G": {G!r},  # 1/s
    "H": {H!r},  # (mm/s)/V
    "limit": {said_limit},  # V
}}

initial_state = [0.0, 0.0]  # the observer's state (mm/s); 1 after the first sample


def control(t, r, y, state, params):
    z, started = state
    if not started:
        z = -params["L"] * y  # the axis starts at rest, wherever it stands
    velocity = params["L"] * y + z  # what the observer makes of it, mm/s
    wanted = r.acceleration + params["g1"] * (r.position - y) + params["g2"] * (r.velocity - velocity)  # mm/s^2
    voltage = params["inertia"] * wanted + params["inverse_gain"] * r.velocity
    voltage = min(max(voltage, -params["limit"]), params["limit"])
    return voltage, [params["F"] * z + params["G"] * y + params["H"] * voltage, 1.0]
'''
