"""The settings of one system: fields in groups; parameters that most leave alone are folded away."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import ipywidgets as widgets

from rds.panels.equipment.fields import SIZES
from rds.panels.equipment.state import Equipment
from rds.panels.interpolator.motion import MADE
from rds.panels.kit.field import FieldView

_GROUPS = (
    ("system", "mode"),
    ("shape", "shape_file", "path_file", *SIZES, "radius", "feed", "laps"),
    ("interpolator", "interpolator_file", *MADE),
    ("controller", "controller_file", "coupled"),
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
        self._controllers, self._models = _Folded("Parameters"), _Folded("Parameters of the model")
        at = 1 + next(i for i, names in enumerate(_GROUPS) if "controller" in names)
        after = 1 + next(i for i, names in enumerate(_GROUPS) if "model" in names)
        groups = self._groups
        self.widget = widgets.VBox(
            [*groups[:at], self._controllers.widget, *groups[at:after], self._models.widget, *groups[after:]]
        )
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
            more = self._equipment.of_signal if "shape" in names else []
            _fill(box, [self._view(name) for name in (*names, *more) if name in shown])
        choices = self._equipment.choices
        groups: tuple[tuple[_Folded, list[str]], ...] = (
            (self._controllers, self._equipment.parameters),
            (self._models, self._equipment.model_parameters),
        )
        for folded, names_of in groups:
            changed = [name for name in names_of if choices[name] != choices.fields[name].default]
            folded.show([self._view(name) for name in names_of], len(changed))


class _Folded:
    """Fields that most leave alone, folded away; the title says how many there are, and how many were changed."""

    def __init__(self, title: str):
        self._title = title
        self._box = _box()
        self.widget = widgets.Accordion([self._box], titles=(title,), selected_index=None)
        self.widget.add_class("rds-folded")

    def show(self, views: Sequence[FieldView], changed: int) -> None:
        """Show these, if there are any."""
        _fill(self._box, views)
        title = f"{self._title} ({len(views)}{f', {changed} changed' if changed else ''})"
        if self.widget.titles != (title,):
            self.widget.titles = (title,)
        self.widget.layout.display = "" if views else "none"


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
