"""A slider for a number: one value each time that it is let go."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import anywidget
import traitlets

from rds.panels.kit.static_files import static
from rds.panels.session.fields import Number

_TIMES = 4.0  # how far a slider goes where a number may be anything: so many times what it is


class Slider(anywidget.AnyWidget):
    """`on_value(number)` hears what it was dragged to; `show(field, value)` says what it stands at."""

    _esm = traitlets.Unicode().tag(sync=True)
    value = traitlets.Float(0.0).tag(sync=True)
    low = traitlets.Float(0.0).tag(sync=True)
    high = traitlets.Float(1.0).tag(sync=True)
    label = traitlets.Unicode("").tag(sync=True)
    disabled = traitlets.Bool(False).tag(sync=True)

    def __init__(self, on_value: Callable[[float], None]):
        super().__init__(_esm=static(__file__, "slider.js"))
        self._on_value = on_value
        self.on_msg(self._told)

    def show(self, field: Number, value: float | None) -> None:
        """Stand at `value`; its ends stay where they are while that is between them. Hidden where there is none."""
        self.layout.display = "none" if value is None else ""
        if value is None:
            return
        label = f"{field.label}, slider"
        if label != self.label or not self.low <= value <= self.high:
            low, high = reach(field, value)
            with self.hold_sync():
                self.label, self.low, self.high, self.value = label, low, high, float(value)
        else:
            self.value = float(value)

    def _told(self, _: Any, content: Any, __: Any) -> None:
        value = content.get("value") if isinstance(content, dict) and content.get("kind") == "set" else None
        if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
            self._on_value(float(f"{value:.4g}"))


def reach(field: Number, value: float) -> tuple[float, float]:
    """The ends of the slider: as far as four times the value, within the field's range."""
    far = _TIMES * abs(value) or 1.0
    low, high = max(field.low, field.above), field.high
    return max(low, 0.0 if value >= 0.0 else -far), min(high, far if value >= 0.0 else 0.0)
