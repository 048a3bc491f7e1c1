"""Script: a machine from a configuration script (NCC) that is written or pasted here, judged and drawn as it stands."""

from __future__ import annotations

from html import escape
from typing import Any

import ipywidgets as widgets

from rds.core.errors import InputError
from rds.machines.configuration import verdict
from rds.machines.machine import Machine
from rds.machines.ncc import machine_of_script, machine_text_of_script, read_script, script_of_machine
from rds.panels.kit.button import button
from rds.panels.kit.field import FieldView
from rds.panels.kit.figure import FigureView
from rds.panels.kit.html import Html
from rds.panels.kit.layout import columns, group, row
from rds.panels.kit.notice import Notice
from rds.panels.machine.configuration import NEXT_STEP, write_machine_text
from rds.panels.machine.state import MachineState
from rds.panels.session.fields import Choice, Text

_FILE = Text("file", "Machine file", "A file of your folder, which every mode takes as its machine", "my-script.toml")
_TIP = "A line for each word: RF01 a link, RF02 limits, RF03 an assembly error; BUILD at the end"
_SCRIPT = Text("script", "Script", _TIP, longest=65536, refuse=lambda text: None)
_REST = Choice(
    "rest",
    "Encoders, models, spindle",
    "What a script does not say: encoders, models, limits of planned motion, spindle and converter",
    "machine",
    {"machine": "of the machine at Modules", "chosen": "usual values"},
)
_EMPTY = "no script stands here yet: write one, or begin with that of the machine chosen at Modules"


class ScriptView:
    """The script, and what it makes."""

    def __init__(self, shell: Any, state: MachineState):
        self.session, self.state = shell.session, state
        self._ticker, self._figure = shell.ticker, FigureView()
        self.notice, self._found = Notice(), Html()
        self.choices = shell.session.choices("script", [_SCRIPT, _REST, _FILE])
        self.text = widgets.Textarea(
            self.choices["script"],
            rows=12,
            tooltip=_TIP,
            continuous_update=False,
            layout=widgets.Layout(width="100%"),
        )
        self.text.observe(self._typed, "value")
        self._write = button("Write machine", "Write the machine's file", self.write, self.notice, primary=True)
        of = "The links of the machine chosen at Modules, as a script"
        side = [
            group(
                "The script",
                row(
                    button("Script of the machine", of, self.take, self.notice),
                    button("Check", "Whether the script makes a machine", self.check, self.notice),
                ),
            ),
            group("The machine", FieldView(self.choices, "rest"), FieldView(self.choices, "file"), row(self._write)),
        ]
        head = Html("<p>From the tool (LN1) to the work (the last link); # is what the link's joint changes.</p>")
        self.widget = columns(side, [self.notice, head, self.text, self._found, self._figure])
        self._write.disabled = True
        self._of = ""  # the machine at Modules with which the script was judged
        self.notice.say(_EMPTY)
        self.choices.watch(self._changed)
        state.choices.watch(lambda name: self._of_another_machine())

    def take(self) -> None:
        """Begin with the script of the machine that is chosen."""
        self.text.value = script_of_machine(self.state.machine)
        self.check()

    def check(self) -> None:
        """Judge and draw what the script makes. InputError for a script that is wrong, with its line."""
        self._write.disabled = True
        self._found.value = ""
        self._figure.clear()
        if not self.text.value.strip():
            self.notice.say(_EMPTY)
            return
        self._of = self.state.choices["machine"]
        machine = machine_of_script(read_script(self.text.value), "machine", self._before())
        found = verdict(machine)
        self._write.disabled = not found.ok
        if found.ok:
            self.notice.say("this script makes a machine", "good")
        else:
            self.notice.say("\n".join(fault.text for fault in found.faults), "error")
        marks = {True: "✔", False: "✘", None: "–"}
        lines = "".join(f"<li>{marks[check.passed]} {escape(check.text)}</li>" for check in found.checks)
        self._found.value = f"<ul class='rds-verdict'>{lines}</ul>"

        def draw() -> Any:
            from rds.machines.picture import picture

            return picture(machine)

        self._figure.draw(self.session, self._ticker, draw, "The links with their frames, and where the tip can be")

    def write(self) -> None:
        """Write the file."""
        script, before = read_script(self.text.value), self._before()
        path = write_machine_text(
            self.session.folder, self.choices["file"], lambda name: machine_text_of_script(script, name, before)
        )
        self.state.offer(path)
        self.notice.say(f"wrote {path.name}: every mode takes it as its machine. {NEXT_STEP}", "good")

    def _before(self) -> Machine | None:
        return self.state.machine if self.choices["rest"] == "machine" else None

    def _typed(self, change: Any) -> None:
        try:
            self.choices.set("script", change["new"])
        except InputError as error:
            self.notice.say(str(error), "error")
            self._write.disabled = True

    def _changed(self, name: str) -> None:
        if name == "script" and self.text.value != self.choices["script"]:
            self.text.value = self.choices["script"]
        if name in ("script", "rest"):  # what was judged is another machine
            self._write.disabled = True

    def _of_another_machine(self) -> None:
        """What was judged with the machine at Modules is another one with another machine there."""
        if self.choices["rest"] == "machine" and self._of != self.state.choices["machine"]:
            self._write.disabled = True
