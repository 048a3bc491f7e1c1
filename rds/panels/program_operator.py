"""An operator's hand on a program: run, hold, resume, home, stop, and the override of the feed."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import ipywidgets as widgets

from rds.panels.kit.button import attempt, halt, order, run_order
from rds.panels.kit.field import FieldView
from rds.panels.kit.layout import row
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.session.choices import Choices
from rds.session.program_run import ProgramWork

_STEP = 5  # % of the override's slider


class Operator:
    """A row of buttons. `run()` is called for Run; `work` is what they act on, None when nothing runs."""

    def __init__(self, shell: Any, choices: Choices, notice: Notice, run: Callable[[], None]):
        self._choices, self._notice = choices, notice
        self.work: ProgramWork | None = None
        self.bar = WorkBar(shell.ticker)
        tip = "Save the program and run it in the mode chosen"
        self.run_button = run_order(shell, tip, run, notice, choices)
        tip = "Come to rest on the path"
        self.hold_button = halt("Hold", tip, partial(self._do, "Hold", ProgramWork.hold), notice)
        self.resume_button, self.home_button = (
            order(shell, text, tip, partial(self._do, text, act), notice)
            for text, tip, act in (
                ("Resume", "Go on after a hold, M0, M1 or a tool change", ProgramWork.resume),
                ("Home", "End the program where it is, go up and move home", ProgramWork.home),
            )
        )
        field = choices.fields["override"]
        self.override = widgets.IntSlider(
            int(choices["override"]),
            0,
            200,
            _STEP,
            description="Override [%]",
            tooltip=f"{field.tooltip} (0 to 200 %); arrow keys change it",
            style={"description_width": "90px"},
        )
        self.override.observe(self._overridden, "value")
        buttons = [self.run_button, self.hold_button, self.resume_button, self.home_button]
        self.mode = FieldView(choices, "mode")
        self.mode.add_class("rds-program-mode")
        self.widget = row(self.mode, *buttons, self.override, self.bar)
        self.enable()

    def enable(self) -> None:
        """Only what has a sense now can be pressed."""
        work = self.work
        operable = work is not None and work.operable
        self.run_button.disabled = work is not None
        held = operable and work is not None and work.held
        status = work.status() if operable and work is not None else None
        waits = status is not None and status.state.name in ("STOP", "TOOL")
        self.hold_button.disabled = not operable or held
        self.resume_button.disabled = not (held or waits)
        self.home_button.disabled = not operable

    def _do(self, what: str, act: Callable[[ProgramWork], None]) -> None:
        if (work := self.work) is not None:
            attempt(what, lambda: act(work), self._notice)
            self.enable()

    def _overridden(self, change: Any) -> None:
        self._choices.set("override", change["new"])
        if self.work is not None and self.work.operable:
            self._do("Override", lambda work: work.override(change["new"] / 100.0))
