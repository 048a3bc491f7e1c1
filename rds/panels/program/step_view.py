"""A program line by line, at rest: the line as it is executed, the words in force after it, where the tool then is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from html import escape

import ipywidgets as widgets

from rds.core.errors import InputError, RdsError
from rds.nc.stepping import Step, steps
from rds.panels.kit.button import button
from rds.panels.kit.html import Html
from rds.panels.kit.layout import row
from rds.panels.kit.notice import Notice
from rds.panels.program.state import Program
from rds.results import html

MOST = 10_000  # lines that one press goes on by
_SHOWN = 8  # of the lines before
_WORDS = (
    "<p>Nothing moves here: each press executes one line of the program, as it is in the editor. Lines that move "
    "nothing are told, too.</p>"
)


class StepView:
    """`at(step)` is told where the program is, None when it is left; `caret()` gives the line of the cursor."""

    def __init__(self, program: Program, at: Callable[[Step | None], None], caret: Callable[[], int]):
        self._program, self._at, self._caret = program, at, caret
        self._steps: Iterator[Step] | None = None
        self._text = ""  # that is stepped through
        self._taken: list[Step] = []
        self.notice = Notice()
        tip = "Execute the next line; the first one to begin with"
        self.next_button = button("Next line", tip, self._next, self.notice)
        self.next_button.button_style = "primary"
        tip = "Go on until the line that the cursor is in"
        buttons = [
            self.next_button,
            button("To the cursor", tip, self._to_cursor, self.notice),
            button("From the start", "Forget all that was executed", self.leave, self.notice),
        ]
        self._shown = Html()
        self.widget = widgets.VBox([Html(_WORDS), row(*buttons), self.notice, self._shown])
        self._show()

    def leave(self) -> None:
        """Back before the first line."""
        self._steps, self._taken = None, []
        self.notice.clear()
        self._show()

    def _next(self) -> None:
        self._go(lambda step: True)

    def _to_cursor(self) -> None:
        wanted = self._caret()
        self._go(lambda step: step.line >= wanted and not step.depth)

    def _go(self, enough: Callable[[Step], bool]) -> None:
        """Execute lines until it is enough, passing over those that a branch or a definition leaves out."""
        text = self._program.text
        self.notice.clear()
        if self._steps is None or self._text != text.text:
            if self._steps is not None:
                self.notice.say("the text has changed: from the first line again", "warning")
            path, machine = text.on_disk(), self._program.machine
            setup = self._program.setup().on(machine, path)
            tools = setup.tool_list()
            self._steps = steps(path, tools=tools, parameters=setup.parameters, options=setup.options)
            self._text, self._taken = text.text, []
        try:
            for _ in range(MOST):
                step = next(self._steps, None)
                if step is None:
                    self.notice.say("the program is over: its last line has been executed", "good")
                    break
                if step.skipped:
                    continue
                self._taken = [*self._taken[-_SHOWN:], step]
                if enough(step):
                    break
            else:
                self.notice.say(f"{MOST} lines were executed; press again to go on", "note")
        except RdsError as error:
            self._steps = None  # it ends at its fault, and not as a program that is over
            said = str(error).replace(str(text.on_disk()), text.name)
            raise InputError(said) from error
        finally:
            self._show()

    def _show(self) -> None:
        step = self._taken[-1] if self._taken else None
        self._shown.value = "<p>Before the first line.</p>" if step is None else _step_html(step) + _before(self._taken)
        self._at(step)


def _step_html(step: Step) -> str:
    modes = step.modes
    unit = "in" if "G20" in modes.words else "mm"
    units = [*[unit] * 3, *["°"] * 3]
    rows = [
        (f'<tr><th scope="row">{axis} <small>{of}</small></th><td class="rds-dro">{value:.3f}</td></tr>')
        for axis, value, of in zip("XYZABC", step.position, units, strict=True)
        if axis in "XYZ" or value
    ]
    tool = f"T{modes.tool}" if modes.tool else "no tool"
    words = [*modes.words, f"F{modes.feed:g}", f"S{modes.speed:g}", tool]
    chips = " ".join(f"<code>{escape(word)}</code>" for word in words)
    changed = ", ".join(f"{name} = {value:g}" for name, value in step.changed.items())
    place = f"Line {step.line}" + (f", {step.depth} calls deep" if step.depth else "")
    return (
        f'<p class="rds-state" role="status"><b>{place}</b> <code>{escape(step.text)}</code></p>'
        f'<table class="rds-positions">{"".join(rows)}</table>'
        f"<p>Active modes: {chips}</p>" + (f"<p>Parameters: {escape(changed)}</p>" if changed else "")
    )


def _before(taken: list[Step]) -> str:
    rows = [[step.line, step.text, *(f"{value:.3f}" for value in step.position[:3])] for step in reversed(taken[:-1])]
    return html.table(["line", "executed before", "X", "Y", "Z"], rows) if rows else ""
