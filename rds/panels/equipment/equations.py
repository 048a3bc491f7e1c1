"""The equations of what runs, with the numbers in them: the law of each controller, and the model of each axis."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from rds.core.types import SPINDLE_UNIT
from rds.modes.loop.plan import Plan


def equations(plan: Plan) -> list[tuple[str, list[str]]]:
    """What each part computes: (title, lines). A student's own file is named, with the numbers of its params."""
    found = []
    for axis in plan.axes:
        name, unit = axis.axis.name, axis.axis.unit
        if axis.controller is not None:
            found.append((f"Controller of {name}", _law(axis.controller.source.name, axis.controller.params, unit)))
        if axis.model is not None:
            found.append((f"Model of {name}", _model(axis.model.source.name, axis.model.params, unit)))
    return found


def equations_html(parts: list[tuple[str, list[str]]]) -> str:
    """The same for a page."""
    return "".join(
        f'<h2 class=rds-part>{escape(title)}</h2><p class="rds-equation">{"<br>".join(map(escape, lines))}</p>'
        for title, lines in parts
    )


def _law(name: str, params: Mapping[str, Any], unit: str) -> list[str]:
    p = {key: float(value) for key, value in params.items() if isinstance(value, int | float)}
    if name == "p" and "Pgain" in p:
        return [f"u = {_sum((p['Pgain'], 'e'), (p.get('bias', 0.0), ''))} V,   e = r − y [{unit}]"]
    if name == "pid" and "Pgain" in p:
        terms = [(p["Pgain"], "e"), (p["Igain"], "∫e dt"), (p["Dgain"], "ė"), (p["FF0"], "r"), (p["FF1"], "ṙ")]
        terms += [(p["FF2"], "r̈"), (p["FF3"], "dr̈/dt"), (p["bias"], "")]
        return [
            f"u = {_sum(*terms)} V,   e = r − y [{unit}]",
            f"ė through 1/({_n(p['derivative_filter'])} s + 1)",
        ]
    if name == "modified-pid" and "Pgain" in p:
        weighted = f"{_n(p['Pgain'])} ({_n(p['b'])} r − y)"
        slope = f"{_n(p['Dgain'])} d/dt ({_n(p['c'])} r − y)"
        rest = f" + {_n(p['bias'])}" if p["bias"] else ""
        return [f"u = {weighted} + {_n(p['Igain'])} ∫(r − y) dt + {slope}{rest} V"]
    if name == "tracking" and "speed_pole" in p:
        inverse_gain, inertia = params["coefficients"][:2]
        return [f"u = {_n(inertia)} (ṙ {_signed(p['g1'])} (r − y)) + {_n(inverse_gain)} r V   [{unit}]"]
    if name == "tracking" and "g1" in p:
        lines = [f"u = (τ/K) (r̈ + ṙ/τ + {_n(p['g1'])} (r − y) {_signed(p['g2'])} (ṙ − v̂)) V"]
        coefficients = params.get("coefficients")
        if isinstance(coefficients, list | tuple) and len(coefficients) > 1:
            lines[0] = (
                f"u = {_n(coefficients[1])} (r̈ + {_n(p['g1'])} (r − y) {_signed(p['g2'])} (ṙ − v̂)) "
                f"+ {_n(coefficients[0])} ṙ V"
            )
        return [*lines, f"v̂ from the reduced-order observer with its pole at {_n(p['observer_pole'])} 1/s"]
    if name == "cascade" and "Kpp" in p:
        demand = f"{_sum((p['Kpp'], '(r − y)'), (p['speed_feedforward'], 'ṙ'))} {unit}/s"
        return [
            f"w_r = {f'r {unit}' if unit == SPINDLE_UNIT else demand}",
            f"i = {_sum((p['Kp'], '(w_r − w)'), (p['Ki'], '∫(w_r − w) dt'), (p['Kd'], 'd(w_r − w)/dt'))} A",
        ]
    if name == "relay" and "tune_effort" in p:
        effort, band = _n(p["tune_effort"]), _n(p["hysteresis"])
        return [f"u = ±{effort} V, changing over at e = ∓{band} {unit}, then PID by the rule {params['tune_type']}"]
    return [f"{name}: " + (", ".join(f"{key} = {_n(value)}" for key, value in p.items()) or "without params")]


def _model(name: str, params: Mapping[str, Any], unit: str) -> list[str]:
    p = {key: float(value) for key, value in params.items() if isinstance(value, int | float)}
    if name == "linear-axis" and {"tau", "K", "friction_plus", "friction_minus"} <= p.keys():
        return [
            f"{_n(p['tau'])} ẍ + ẋ = {_n(p['K'])} u − F   [{unit}/s, u in V]",
            f"F = {_n(p['friction_plus'])} {unit}/s while ẋ > 0, {_n(p['friction_minus'])} {unit}/s while ẋ < 0",
        ]
    return [f"{name}: " + (", ".join(f"{key} = {_n(value)}" for key, value in p.items()) or "without params")]


def _sum(*terms: tuple[float, str]) -> str:
    """The terms whose number is not 0, each with its sign."""
    said = ""
    for number, what in terms:
        if number:
            sign = ("−" if number < 0 else "") if not said else (" − " if number < 0 else " + ")
            said += f"{sign}{_n(abs(number))}{' ' + what if what else ''}"
    return said or "0"


def _signed(number: float) -> str:
    return f"{'−' if number < 0 else '+'} {_n(abs(number))}"


def _n(number: float) -> str:
    return f"{number:.4g}".replace("-", "−")
