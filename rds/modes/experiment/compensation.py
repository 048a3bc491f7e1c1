"""Error compensation by the host: what an axis misses is added to the values that are sent next (oacs-thesis, 7.2).

"The error compensation module uses the sensor feedback data and compares the expected machine position with the actual
position", and corrects "the next set of values" by what it has found. The thesis gives no equation; here

    c[k+1] = c[k] + (T/τ) (r[k] - y[k]),   |c| at most `most`,   and the axis's controller follows r + c

with the programmed position r and the measured one y: a deviation that stays (lag, friction, an error of a drive) goes
with the time constant τ. What changes faster than τ is the controller's own work. The recorded reference is r, so that
following and contour error stay those of what was programmed; c is the signal `compensation`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from rds.core.quantities import Quantity, Table
from rds.core.types import Controller, Reference
from rds.machines import Axis
from rds.modes.loop.commands import Command
from rds.modes.loop.laws import broken, told_values

NAME = "compensation"
COMPENSATION = Table(
    "what the axis misses is added to its reference, with a time constant (oacs-thesis, 7.2)",
    {
        "time": Quantity("time constant with which a deviation that stays is taken out", "s", 1e-3, 1e3, default=0.2),
        "most": Quantity("largest compensation", "axis unit", above=0.0, default=1.0),
    },
)


@dataclass(frozen=True)
class _Compensated:
    """The law of `inner` after a reference that is moved; the state is the inner one, and the compensation."""

    inner: Controller
    gain: float  # of a sample
    most: float
    axis: str
    command: tuple[str, str]  # what `inner` hands out, and its unit

    def control(self, t: float, r: Reference, y: float, state: Any, params: Any) -> Any:
        inner, names = self.inner, tuple(self.inner.signals)
        own, c = state
        answer = inner.control(t, Reference(r.position + c, r.velocity, r.acceleration), y, own, params)
        tells = bool(names) and inner.observe is None
        if not isinstance(answer, tuple | list) or len(answer) != 2 + tells:
            raise broken(answer, t, self.axis, inner, self.command)
        after = min(max(c + self.gain * (r.position - y), -self.most), self.most)
        if inner.observe is not None:
            return answer[0], (answer[1], after)
        values = told_values(answer[2], names, t, self.axis, inner) if tells else ()
        return answer[0], (answer[1], after), {**dict(zip(names, values, strict=True)), NAME: c}

    def observe(self, y: float, state: Any, following: Any, params: Any) -> Sequence[float]:
        assert self.inner.observe is not None
        return [*self.inner.observe(y, state[0], following[0], params), state[1]]


def compensated(controller: Controller, T: float, time: float, most: float, axis: Axis, command: Command) -> Controller:
    """The controller of an axis with error compensation: time constant in s, largest compensation in the axis's unit.

    `command` is what the controller hands out.
    """
    law = _Compensated(controller, T / time, most, axis.name, (command.quantity, command.unit(axis.unit)))
    return replace(
        controller,
        control=law.control,
        initial_state=(controller.initial_state, 0.0),
        source=replace(controller.source, name=f"{controller.source.name} with error compensation"),
        signals={**controller.signals, NAME: axis.unit},
        observe=None if controller.observe is None else law.observe,
    )
