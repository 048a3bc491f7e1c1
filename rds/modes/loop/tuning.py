"""Parameters of a controller that may be changed while it runs, as channels of live values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import isfinite
from typing import Any

from rds.core.quantities import Quantity
from rds.core.types import Controller
from rds.core.values import own_copy
from rds.modes.loop.live_values import Channel

_ANY = Quantity("parameter of control()")


class Tuning:
    """The live parameters of one controller, `owner` being the axis ("X"), or "controller" if it drives several.

    `params` is what the law is called with; `set` changes it in place.
    """

    def __init__(self, owner: str, controller: Controller, unit: str = "mm"):
        self.params: dict[str, Any] = own_copy(dict(controller.params), "params", controller.source.path)
        self._retune = controller.retune
        self._values: dict[str, float] = {}
        self.channels: list[Channel] = []
        self._owner = owner
        options = controller.tunable if controller.retune is not None else _numbers(controller.params)
        for name, option in options.items():
            value = self.params[name]
            self._values[name] = float(value)
            self.channels.append(Channel.of(option, f"{owner}.{name}", float(value), unit))

    def actions(self) -> dict[str, Callable[[float], None]]:
        """What a new value does, by channel."""
        return {f"{self._owner}.{name}": partial(self._set, name) for name in self._values}

    def verify(self, values: Mapping[str, float]) -> None:
        """InputError if these values will not do together."""
        if self._retune is not None:
            self._retune({name: values[f"{self._owner}.{name}"] for name in self._values})

    def _set(self, name: str, value: float) -> None:
        self._values[name] = value
        self.params.update({name: value} if self._retune is None else self._retune(self._values))


def _numbers(params: Mapping[str, Any]) -> dict[str, Quantity]:
    """The plain numbers among a student's parameters."""
    return {name: _ANY for name, value in params.items() if isinstance(name, str) and _is_number(value)}


def _is_number(value: Any) -> bool:
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
    except OverflowError:  # an int of hundreds of digits
        return False
