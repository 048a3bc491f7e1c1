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
        at = 1 + next(i for i, names in enumerate(_GROUPS) if "controller" in names)
        self.widget = widgets.VBox([*self._groups[:at], self._folded, *self._groups[at:]])
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
        # the parts stay in their places, so that nothing that is being typed elsewhere is drawn anew
        for box, names in zip(self._groups, _GROUPS, strict=True):
            _fill(box, [self._view(name) for name in names if name in shown])
        parameters = self._equipment.parameters
        _fill(self._parameters, [self._view(name) for name in parameters])
        self._folded.titles = (f"Parameters ({len(parameters)})",)
        self._folded.layout.display = "" if parameters else "none"


def _box() -> widgets.Box:
    box = widgets.Box([], layout={"display": "none"})
    box.add_class("rds-group")
    box.add_class("rds-fields")
    return box


def _fill(box: widgets.Box, views: Iterable[widgets.Widget]) -> None:
    children = tuple(views)
    if box.children != children:
        box.children = children
        box.layout.display = "" if children else "none"
