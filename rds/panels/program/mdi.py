"""Lines typed by hand and run at once (MDI), each after those before it: together they are a program to keep."""

from __future__ import annotations

from collections.abc import Callable

import ipywidgets as widgets

from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.core.types import Ending
from rds.panels.kit.button import run_order
from rds.panels.kit.html import Html
from rds.panels.kit.layout import row
from rds.panels.kit.notice import Notice
from rds.panels.program.run import ProgramWork
from rds.panels.program.state import Program
from rds.results import html

FILE = "mdi.ngc"  # in the folder, to be opened and edited as any other program
_SHOWN = 12  # lines
_WORDS = (
    "<p>One line of G-code, run at once: <code>G0 X10</code>, <code>G1 Y-5 F300</code>. Words hold as they do in a "
    f"program. The axes first go to where the line before has left off; the lines are kept in <code>{FILE}</code>.</p>"
)


class Mdi:
    """`ended(work)` is due when a run that `run(work)` was asked for is over."""

    def __init__(self, shell: object, program: Program, run: Callable[[ProgramWork], None], notice: Notice):
        self._program, self._run, self._notice = program, run, notice
        self._lines: list[str] = []
        self._tried = ""
        self._text = widgets.Text(placeholder="G0 X10", tooltip="A line of G-code", continuous_update=False)
        self.button = run_order(shell, "Run this line", self._go, notice, program.choices, "Run line")
        self.button.remove_class("rds-run")  # Ctrl+Enter is the program's
        self._kept = Html()
        self.widget = widgets.VBox([Html(_WORDS), row(self._text, self.button), self._kept])
        self._show()

    def ended(self, work: ProgramWork) -> None:
        """Keep the line of a run that came to its end, which the next one goes on from; one that moves nothing, too."""
        if work.file.name != FILE or not self._tried:
            return
        tried, self._tried = self._tried, ""
        moves_nothing = isinstance(work.error, InputError) and "nothing moves from line" in str(work.error)
        if moves_nothing or (work.result is not None and work.result.meta.get("ending") == Ending.DONE):
            self._lines.append(tried)
            self._text.value = ""
        if moves_nothing:
            self._notice.say(f"{tried} holds from now on; it moves nothing", "good")
        self._show()

    def _go(self) -> None:
        line = self._text.value.strip()
        if not line:
            raise InputError("type a line of G-code first, as in G0 X10")
        path = self._program.session.folder / FILE
        write_whole(path, "\n".join([*self._lines, line, "M2", ""]).encode())
        self._tried = line
        self._run(self._program.work_of(path, len(self._lines) + 1))

    def _show(self) -> None:
        rows = [[number, line] for number, line in enumerate(self._lines, start=1)][-_SHOWN:]
        self._kept.value = html.table(["line", "run so far"], rows) if rows else ""
