"""The settings of one system: fields in groups; parameters that most leave alone are folded away."""

from __future__ import annotations

from collections.abc import Iterable

import ipywidgets as widgets

from rds.panels.kit.field import FieldView
from rds.session.equipment import Equipment

_GROUPS = (
    ("system", "mode"),
    ("shape", "shape_file", "amplitude", "frequency", "offset"),
    ("controller", "controller_file"),
    ("model", "model_file"),
    ("duration", "sample_period"),
)
_BUTTONS = ("model",)  # choices shown as buttons; the others are lists


class EquipmentSettings:
    """The left column. `refused` names the fields that will not do as they are."""

    def __init__(self, equipment: Equipment):
        self._equipment = equipment
        self._views: dict[str, FieldView] = {}
        self._groups = [_box() for _ in _GROUPS]
        self._parameters = _box()
        self._folded = widgets.Accordion([self._parameters], titles=("Parameters",), selected_index=None)
        self._folded.add_class("rds-folded")
        self.widget = widgets.VBox([])
        self.widget.add_class("rds-side")
        equipment.choices.watch(lambda name: self._arrange())
        self._arrange()

    @property
    def refused(self) -> list[str]:
        """The labels of the fields in sight that hold what will not do."""
        return [self._views[name].field.label for name in self._equipment.shown if self._view(name).refused]

    def _view(self, name: str) -> FieldView:
        if name not in self._views:
            view = FieldView(self._equipment.choices, name, buttons=name in _BUTTONS)
            self._views[name] = view
        return self._views[name]

    def _arrange(self) -> None:
        """Show the fields that matter for what is chosen."""
        for name in [name for name in self._views if name not in self._equipment.choices]:
            self._views.pop(name).close()
        shown = self._equipment.shown
        parts: list[widgets.Widget] = []
        for box, names in zip(self._groups, _GROUPS, strict=True):
            _fill(box, [self._view(name) for name in names if name in shown])
            if box.children:
                parts.append(box)
            if "controller" in names and self._equipment.parameters:
                self._fold(parts)
        if tuple(parts) != self.widget.children:
            self.widget.children = parts

    def _fold(self, parts: list[widgets.Widget]) -> None:
        names = self._equipment.parameters
        _fill(self._parameters, [self._view(name) for name in names])
        title = f"Parameters ({len(names)})"
        if self._folded.titles != (title,):
            self._folded.titles = (title,)
        parts.append(self._folded)


def _box() -> widgets.Box:
    box = widgets.Box([])
    box.add_class("rds-group")
    box.add_class("rds-fields")
    return box


def _fill(box: widgets.Box, views: Iterable[widgets.Widget]) -> None:
    children = tuple(views)
    if box.children != children:
        box.children = children
