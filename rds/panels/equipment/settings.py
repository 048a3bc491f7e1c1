"""The settings of one system: fields in groups; parameters that most leave alone are folded away."""

from __future__ import annotations

import ipywidgets as widgets

from rds.panels.equipment.fields import FERROR, PREFIX, SIZES
from rds.panels.equipment.parameters import FoldedFields, Parameters, box_of_fields, count_changed, fill
from rds.panels.equipment.state import Equipment
from rds.panels.interpolator.motion import MADE, OWN
from rds.panels.kit.field import FieldView

_GROUPS = (
    ("system", "mode"),
    ("shape", "shape_file", "path_file", *SIZES, "radius", "feed", "laps"),
    ("interpolator", *OWN, *MADE),
    ("controller", "controller_file", "coupled"),
    ("model", "model_file"),
    ("duration", "sample_period", FERROR),
)
_BUTTONS = ("model",)  # choices shown as buttons; the others are lists


class EquipmentSettings:
    """The left column. `refused` names the fields that will not do as they are."""

    def __init__(self, equipment: Equipment):
        self._equipment = equipment
        self._views: dict[str, FieldView] = {}
        self._groups = [box_of_fields() for _ in _GROUPS]
        self.parameters, self._models = Parameters(equipment), FoldedFields("Parameters of the model")
        at = 1 + next(i for i, names in enumerate(_GROUPS) if "controller" in names)
        after = 1 + next(i for i, names in enumerate(_GROUPS) if "model" in names)
        groups = self._groups
        self.widget = widgets.VBox(
            [*groups[:at], self.parameters.widget, *groups[at:after], self._models.widget, *groups[after:]]
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
            slider = name.startswith(PREFIX)
            view = FieldView(self._equipment.choices, name, buttons=name in _BUTTONS, slider=slider)
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
            fill(box, [self._view(name) for name in (*names, *more) if name in shown])
        of_model = self._equipment.model_parameters
        self._models.show([self._view(name) for name in of_model], count_changed(self._equipment.choices, of_model))
        self.parameters.show([self._view(name) for name in self._equipment.parameters])
