"""The s-plane with poles that are moved by hand, and curves that follow them: two small anywidgets of our own."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from typing import Any

import anywidget
import traitlets

from rds.panels.kit.static_files import static


class SPlane(anywidget.AnyWidget):
    """`poles` are shown; `on_move(name, place, done)` is called while one is dragged, and when it is let go (`done`).

    A pole is a mapping of `name`, `label` and its place `re`, `im` (1/s); one called "pair" has a conjugate.
    """

    _esm = traitlets.Unicode().tag(sync=True)
    poles: Any = traitlets.List([]).tag(sync=True)
    limit: Any = traitlets.List([]).tag(sync=True)  # points of the bound of what can be sampled, 1/s, upper half
    cloud: Any = traitlets.List([]).tag(sync=True)  # points of poles of the loop, 1/s
    refused = traitlets.Unicode("").tag(sync=True)  # why the pole cannot be where it is dragged to
    height = traitlets.Int(330).tag(sync=True)  # px

    def __init__(self, on_move: Callable[[str, complex, bool], None], **options: Any):
        super().__init__(_esm=static(__file__, "splane.js"), **options)
        self._on_move = on_move
        self.on_msg(self._told)

    def settled(self) -> None:
        """The pole is where `poles` says, wherever it was dragged to."""
        self.send({"kind": "settled"})

    def _told(self, _: Any, content: Any, __: Any) -> None:
        try:
            name, place = str(content["name"]), complex(float(content["re"]), float(content["im"]))
            done = content["done"] is True
        except (TypeError, KeyError, ValueError):
            logging.getLogger(__name__).warning("the page said what it never says: %.200r", content)
            return
        if isfinite(place.real) and isfinite(place.imag):
            self._on_move(name, place, done)


class Curves(anywidget.AnyWidget):
    """Charts side by side. Each is a mapping: title, x_label, y_label, series; log, equal, x_range, y_range, y_step."""

    _esm = traitlets.Unicode().tag(sync=True)
    charts: Any = traitlets.List([]).tag(sync=True)
    columns = traitlets.Int(2).tag(sync=True)
    height = traitlets.Int(230).tag(sync=True)  # px of each

    def __init__(self, **options: Any):
        super().__init__(_esm=static(__file__, "curves.js"), **options)


def series(x: Any, y: Any, name: str = "", color: str = "", **look: Any) -> Mapping[str, Any]:
    """One curve; numbers to five digits, which is more than a screen shows. NaN leaves a gap."""
    found = (
        {"x": _rounded(x), "y": _rounded(y)} | ({"name": name} if name else {}) | ({"color": color} if color else {})
    )
    return found | look


def _rounded(values: Sequence[float]) -> list[float | None]:
    return [float(f"{value:.5g}") if isfinite(value) else None for value in map(float, values)]
