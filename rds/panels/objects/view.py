"""The widgets over `Objects`: the object and its numbers on the left; its path on the right."""

from __future__ import annotations

from typing import Any

import ipywidgets as widgets

from rds.panels.kit.button import button
from rds.panels.kit.field import FieldView, check_mended
from rds.panels.kit.figure import FigureView
from rds.panels.kit.layout import columns, fields_group, row
from rds.panels.kit.notice import Notice
from rds.panels.objects.state import OF_ALL, Objects


class ObjectsView:
    """Everything of the panel of objects."""

    def __init__(self, shell: Any):
        self.shell = shell
        self.objects = Objects(shell.session)
        choices = self.objects.choices
        self.figure = FigureView()
        self.verdict = Notice()
        self.verdict.add_class("rds-verdict")
        self.verdict.say("making …")
        self.notice = Notice()
        self._views = {
            name: FieldView(choices, name, buttons=False if name == "points_file" else None) for name in choices.fields
        }
        self._form = fields_group([])
        folded = widgets.Accordion(
            [fields_group([self._views[name] for name in OF_ALL if name != "feed"])],
            titles=("Program: safe height, spindle",),
            selected_index=None,
        )
        folded.add_class("rds-folded")
        tip = "Write the part program and open it in the program panel"
        top = row(self._views["program"], button("Make the program", tip, self.make, self.notice, primary=True))
        top.layout.align_items = "flex-end"
        side = [fields_group([self._views["object"]]), self._form, folded]
        self.widget = columns(side, [top, self.notice, self.verdict, self.figure])
        choices.watch(self._chosen)
        self._arrange()
        shell.ticker.add(self._tick)

    def make(self) -> None:
        """What the button does."""
        shown = [*self.objects.names(), *OF_ALL, "program"]
        check_mended(self._views[name] for name in shown)
        self.notice.clear()
        name, replaced = self.objects.write()
        place = ", in place of the one made before," if replaced else ""
        self.notice.say(f"written as {name}{place} and open in the program panel", "good")
        if replaced:
            self.shell.session.say(f"{name} is written in place of the one made before")
        self.shell.open("program")

    def _chosen(self, name: str) -> None:
        self.notice.clear()  # it was about what was chosen before
        if name == "object":
            self._arrange()

    def _arrange(self) -> None:
        """Show the fields of the object that is chosen."""
        self._form.children = [self._views[name] for name in [*self.objects.names(), "feed"]]

    def _tick(self) -> None:
        if not self.objects.tick():
            return
        objects, found = self.objects, self.objects.latest
        for name, view in self._views.items():
            view.mark(objects.refusal if name == objects.wrong else "")
        if found is None or objects.refusal:
            said = objects.refusal
            if objects.wrong in [*objects.names(), "feed"]:  # whose field is in sight, and says it
                said = f"first mend what is refused: {self._views[objects.wrong].field.label}"
            self.verdict.say(said, "note" if objects.waits else "error")
            self.figure.clear()
            return
        self.verdict.say(found.sentence, "good")
        self.figure.draw(self.shell.session, self.shell.ticker, lambda: _picture(found))


def _picture(found: Any) -> Any:
    from rds.nc.paths.pictures import picture

    return picture(found.segments, found.said)
