"""An operator's hand on a program: run, hold, resume, home, stop, and the override of the feed."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import anywidget
import traitlets

from rds.core.errors import InputError
from rds.panels.kit.button import attempt, halt, order, run_order
from rds.panels.kit.field import FieldView
from rds.panels.kit.layout import row
from rds.panels.kit.notice import Notice
from rds.panels.kit.static_files import static
from rds.panels.kit.work_bar import WorkBar
from rds.panels.program.run import ProgramWork
from rds.panels.session.choices import Choices
from rds.panels.session.expired_orders import refusal

_OVERRIDE = "The override"


class Operator:
    """A row of buttons. `run()` is called for Run, `run_from()` for a run from the line that the cursor is in.

    `work` is what they act on, None when nothing runs.
    """

    def __init__(
        self, shell: Any, choices: Choices, notice: Notice, run: Callable[[], None], run_from: Callable[[], None]
    ):
        self._choices, self._notice = choices, notice
        self.work: ProgramWork | None = None
        self.bar = WorkBar(shell.ticker)
        tip = "Save the program and run it in the mode chosen"
        self.run_button = run_order(shell, tip, run, notice, choices)
        tip = "Run from the line that the cursor is in: up, across and down to where it begins"
        self.from_button = run_order(shell, tip, run_from, notice, choices, "Run from line")
        self.from_button.remove_class("rds-run")  # Ctrl+Enter runs all of it
        self.from_button.button_style = ""  # one button stands out
        self.step = FieldView(choices, "single_step")
        tip = "Come to rest on the path"
        self.hold_button = halt("Hold", tip, partial(self._do, "Hold", ProgramWork.hold), notice)
        self.resume_button, self.home_button = (
            order(shell, text, tip, partial(self._do, text, act), notice)
            for text, tip, act in (
                ("Resume", "Go on after a hold, M0, M1, a tool change or a single step", ProgramWork.resume),
                ("Home", "End the program where it is, go up and move home", ProgramWork.home),
            )
        )
        tip = f"{choices.fields['override'].tooltip} (0 to 200 %); arrow keys change it"
        self._in_time = shell.presence.in_time
        self.override = OverrideSlider(self._ask, value=choices["override"], tip=tip)
        choices.watch(self._chosen)
        buttons = [self.run_button, self.from_button, self.hold_button, self.resume_button, self.home_button]
        self.mode = FieldView(choices, "mode")
        self.mode.add_class("rds-program-mode")
        self.widget = row(*buttons, self.mode, self.step, self.override, self.bar)
        self.enable()

    def enable(self) -> None:
        """Only what has a sense now can be pressed."""
        work = self.work
        operable = work is not None and work.operable
        self.run_button.disabled = self.from_button.disabled = work is not None
        self.step.disabled = work is not None and not work.steps  # a run that was not begun with it rests nowhere
        held = operable and work is not None and work.held
        waits = work is not None and work.waits
        self.hold_button.disabled = not operable or held
        self.resume_button.disabled = not (held or waits)
        self.home_button.disabled = not operable
        self.override.moves = operable
        self.override.disabled = work is not None and not operable  # it begins with what was chosen

    def _do(self, what: str, act: Callable[[ProgramWork], None]) -> None:
        if (work := self.work) is not None:
            attempt(what, lambda: act(work), self._notice)
            self.enable()

    def _chosen(self, name: str) -> None:
        if name == "override":
            self.override.value = self._choices["override"]
        elif name == "single_step" and self.work is not None and self.work.steps:
            self._do("Single step", lambda work: work.step(bool(self._choices["single_step"])))

    def _ask(self, percent: float, ordered: bool) -> None:
        """So much feed: less at once, more only in time, as it would come unexpected later."""
        attempt(_OVERRIDE, lambda: self._set_override(percent, ordered), self._notice)

    def _set_override(self, percent: float, ordered: bool) -> None:
        work = self.work
        if work is not None:
            if not work.operable:
                raise InputError("the override of this run cannot be changed now: set it before the next one")
            if percent > self._choices["override"]:
                if not ordered:
                    raise InputError(refusal(_OVERRIDE, math.inf, moved=True))
                self._in_time(_OVERRIDE, moved=True)
            work.override(percent / 100.0)
        self._choices.set("override", percent)


class OverrideSlider(anywidget.AnyWidget):
    """More of the feed override, while something moves, is an order that may come late.

    `on_word(percent, ordered)` hears what is asked for; `ordered` is whether presence.js has let it go. The slider
    shows `value`, in per cent, which whoever hears sets. While it `moves`, more than that is only ordered.
    """

    _esm = traitlets.Unicode().tag(sync=True)
    value = traitlets.Float(100.0).tag(sync=True)
    moves = traitlets.Bool(False).tag(sync=True)
    disabled = traitlets.Bool(False).tag(sync=True)
    tip = traitlets.Unicode("").tag(sync=True)

    def __init__(self, on_word: Callable[[float, bool], None], **options: Any):
        super().__init__(_esm=static(__file__, "override.js"), **options)
        self._on_word = on_word
        self.on_msg(self._told)

    def _told(self, _: Any, content: Any, __: Any) -> None:
        """Anything else than a finite number of per cent changes nothing."""
        if not isinstance(content, dict) or content.get("kind") != "set":
            return
        percent, number = content.get("percent"), content.get("number")
        if isinstance(percent, int | float) and not isinstance(percent, bool) and math.isfinite(percent):
            self._on_word(float(percent), content.get("ordered") is True)
        self.send({"kind": "heard", "number": number})
