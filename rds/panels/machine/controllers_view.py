"""Controllers: the tuning of one module read, set, saved, and had from a recorded step by Ziegler and Nichols."""

from __future__ import annotations

from typing import Any

import ipywidgets as widgets

from rds.bus.modules.oacs.tuning import ADVICE, quality
from rds.core.errors import InputError
from rds.panels.kit.button import button, follow, order
from rds.panels.kit.field import FieldView, check_mended
from rds.panels.kit.figure import FigureView
from rds.panels.kit.html import Html
from rds.panels.kit.layout import columns, group, row
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.panels.machine.state import MachineState
from rds.panels.session.fields import Text
from rds.results import html

_FILE = Text("file", "Tuning file", "A file of your folder, to save to and to read from", "tuning.toml")


class ControllersView:
    """One module at a time."""

    def __init__(self, shell: Any, state: MachineState):
        self.state, self._session = state, shell.session
        self.notice, self.bar, self.figure = Notice(), WorkBar(shell.ticker), FigureView()
        files = shell.session.choices("tuning file", [_FILE])
        self._files = files
        self._which = widgets.Dropdown(description="Module", tooltip="The module that is tuned")
        self._which.observe(self._chosen, "value")
        say = self.notice
        gains = [FieldView(state.tuning, name) for name in _GAINS]
        others = [FieldView(state.tuning, name) for name in state.tuning.fields if name not in _GAINS]
        self._tuning = [*gains, *others]
        self._steps = [FieldView(state.choices, name) for name in ("step", "period", "settled")]
        rest = widgets.Box(others)
        rest.add_class("rds-fields")
        more = widgets.Accordion([rest], titles=("Limits and times",))
        more.add_class("rds-folded")
        side = [
            group(
                "Controller",
                self._which,
                *gains,
                more,
                row(
                    button("Set", "Send these to the module, all at once", self.tune, say, primary=True),
                    button("Read", "Take what the module told at the last scan", self.read, say),
                ),
            ),
            group("Step response", *self._steps),
            group(
                "Keep",
                FieldView(files, "file"),
                row(
                    button("Save", "Write the fields to the file", self.save, say),
                    button("Load", "Fill the fields from the file", self.load, say),
                ),
            ),
        ]
        acts = row(
            order(shell, "Step", "Step the set point, record and plot the response", self.step, say),
            button("Ziegler-Nichols", "Gains from the last response, put into the fields", self.suggest, say),
        )
        rows = [[name, *words] for name, words in ADVICE.items()]
        advice = html.table(["raise", "rise time", "overshoot", "settling time", "steady error"], rows)
        table = Html(f"<details><summary>By trial and error: what a gain does</summary>{advice}</details>")
        self.widget = columns(side, [acts, self.bar, self.notice, self.figure, table])
        self.refresh()

    def refresh(self) -> None:
        """Other modules are known."""
        options = [(words, number) for number, words in self.state.describing().items()]
        if options != list(self._which.options):  # else what was typed for a module stays
            numbers, chosen = [number for _, number in options], self._which.value
            self._which.options = options  # which leaves none of them chosen
            self._which.value = chosen if chosen in numbers else next(iter(numbers), None)
        self._which.disabled = not options
        if not options:
            self.notice.say("no module with a controller is known: scan a bus whose modules speak oacs", "warning")
        else:
            self.notice.clear()

    def tune(self) -> None:
        """Set the tuning."""
        check_mended(self._tuning)
        follow(
            self.bar,
            self.notice,
            lambda: self.state.tune(self._number()),
            lambda set_: self.notice.say(f"in force: {set_['controller']}, {_words(set_)}", "good"),
        )

    def read(self) -> None:
        """What the module told."""
        self.state.load_tuning(self._number())

    def step(self) -> None:
        """Record a response."""
        check_mended(self._steps)
        follow(self.bar, self.notice, lambda: self.state.step(self._number()), self._responded)

    def suggest(self) -> None:
        """Gains by table 11."""
        gains = self.state.suggest(self._number())
        self.notice.say(f"{_words(gains)}: press Set to use them", "good")

    def save(self) -> None:
        """To a file."""
        check_mended(self._tuning)
        self.notice.say(f"wrote {self.state.save_tuning(self._number(), self._files['file']).name}", "good")

    def load(self) -> None:
        """From a file."""
        self.state.read_tuning(self._files["file"])
        self.notice.say(f"read {self._files['file']}: press Set to use it", "good")

    def _responded(self, result: Any) -> None:
        from rds.panels.design.step_plot import plot

        self.figure.show(plot(result), self._session)
        name = result.axes[0]
        notes = "\n".join(map(str, result.meta.get("notes") or ()))
        measured = quality(result, name).words(result.units[f"{name}_measured"])
        said = [notes or "the axis reached the point", measured]
        if self.state.kept is not None:
            said.append(f"recorded in {self.state.kept.name}")
        self.notice.say("\n".join(said), "warning" if notes else "good")

    def _chosen(self, change: Any) -> None:
        if change["new"] is not None:
            self.state.load_tuning(change["new"])

    def _number(self) -> int:
        if self._which.value is None:
            raise InputError("no module with a controller is known: scan a bus whose modules speak oacs")
        return int(self._which.value)


_GAINS = ("controller", "Kp", "Ki", "Kd")


def _words(values: Any) -> str:
    return ", ".join(f"{name} = {values[name]:.5g}" for name in _GAINS[1:])
