"""Code as a tab of a panel: the folder's files, the editor, what the check found, Run, and the versions."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from html import escape
from typing import Any

import ipywidgets as widgets

from rds.core.errors import InputError
from rds.panels.code.advice import told
from rds.panels.code.editor import CodeEditor
from rds.panels.code.state import Code
from rds.panels.code.versions import Version, change_sentence, changes
from rds.panels.equipment.build import Checked
from rds.panels.kit.button import attempt, button
from rds.panels.kit.file_import import FileImport
from rds.panels.kit.html import Html
from rds.panels.kit.layout import row
from rds.panels.kit.notice import Notice
from rds.panels.session.file_params import file_params

_MOST = 30  # versions that are offered
_NOW = "now"  # the choice of the text as it is, among the versions


class CodeView:
    """The files of some roles, one of which is in sight. `run(role, name)` runs what is chosen with this file."""

    def __init__(self, shell: Any, codes: Mapping[str, Code], run: Callable[[str, str], Any], run_button: Any):
        """`run_button` is the one that stands beside the editor: made by the panel, pressed here by Ctrl-Enter."""
        self.shell, self.codes, self._run = shell, dict(codes), run
        self.role = next(iter(self.codes))
        self._loading = False
        self.on_good: Callable[[], Any] = lambda: None  # when the file in sight has no fault any more
        self.notice = Notice()  # what the check says
        self.said = Notice()  # what was done with files
        label = f"code of the {self.role}"
        self.editor = CodeEditor(lambda: attempt("run", self.press, self.said), self._dropped, label=label)
        self.editor.observe(lambda change: self._typed(change["new"]), "text")
        roles = [(role.capitalize(), role) for role in self.codes]
        self.roles = widgets.ToggleButtons(options=roles, tooltips=[f"your {role}" for role in self.codes], tooltip="")
        self.roles.layout.display = "" if len(roles) > 1 else "none"
        self.roles.observe(lambda change: self._turn(change["new"]), "value")
        self.list = widgets.Dropdown(tooltip="Your files in this folder", options=[])
        self.list.observe(self._chosen, "value")
        self.name = widgets.Text(placeholder="name.py", tooltip="A name for the new file; empty: one is given")
        tip = "Copy a file from this computer into the folder; you can also drop it on the editor"
        self.bring = FileImport("Import", tip, self._take, self.said, ".py")
        new = button("New", "Begin a file that works and explains itself", self._new, self.said)
        self.run_button = run_button
        bar = row(self.roles, self.list, self.run_button, new, self.bring, self.name)
        bar.add_class("rds-code-bar")
        self.which = widgets.Dropdown(description="Version", tooltip="The text of an earlier run", options=[])
        self.which.layout.width = "min(100%, 520px)"
        self.which.observe(lambda change: self._compare(), "value")
        tip = "Put this version's text into the editor; the text that is there now can be had back by Ctrl-Z"
        self.back = button("Back to this version", tip, self._go_back, self.said)
        self.difference = Html()
        self._versions: list[Version] = []
        history = widgets.Accordion(
            [widgets.VBox([row(self.which, self.back), self.difference])], titles=("Versions",), selected_index=None
        )
        history.add_class("rds-folded")
        self.history = history
        self.widget = widgets.VBox([bar, self.notice, self.editor, self.said, history])
        self._show()
        shell.ticker.add(self._tick)

    @property
    def code(self) -> Code:
        """The one in sight."""
        return self.codes[self.role]

    def open(self, role: str, name: str) -> None:
        """Show this file of the folder, if it is there and not shown already; say so where it cannot be edited here."""
        code = self.codes.get(role)
        if code is None or not (code.session.folder / name).is_file():
            return
        if name == code.file.name and role == self.role:
            return
        if name != code.file.name:
            try:
                code.open(name)
            except InputError as error:
                self.said.say(str(error), "error")
                return
        if role != self.role:
            self.roles.value = role
        else:
            self._show()

    def turn(self, role: str) -> None:
        """Show the code of this role."""
        self.roles.value = role

    def refresh(self) -> None:
        """As the files lie in the folder now."""
        attempt("the file", self._take_over, self.said)
        self._list_files()
        self._list_versions()

    def _take_over(self) -> None:
        """What another program has written into the file in sight."""
        if self.code.file.refresh():
            self._show()

    def shows(self, files: Sequence[Checked]) -> bool:
        """Whether one of these has a fault, and is in sight."""
        return any(each.path == self.code.file.path and not each.ok for each in files)

    def show_checked(self, files: Sequence[Checked]) -> None:
        """What the check before a run found: go to the first fault of the file in sight."""
        for found in files:
            if found.path == self.code.file.path and not found.ok:
                self._found(found)
                self.editor.go(next((mark.line for mark in found.marks if mark.fault and mark.line), 1))

    def press(self) -> None:
        """Run with the file in sight."""
        self.said.clear()
        self.code.edit(self.editor.text)
        self.code.file.save()  # of a template that nobody has touched
        self._list_files()
        self._run(self.role, self.code.file.name)

    def _typed(self, text: str) -> None:
        if self._loading:
            return
        try:
            self.code.edit(text)
        except Exception as error:
            self.said.say(str(error), "error")
            self._show()

    def _tick(self) -> None:
        for role, code in self.codes.items():
            found = code.tick()
            if found is not None and role == self.role:
                self._found(found)

    def _found(self, found: Checked) -> None:
        if found.text != self.code.file.text:  # typed since
            return
        params = [each.name for each in file_params(self.code.file.path)]
        self.editor.mark(told(mark, found.text, params) for mark in found.marks)
        self.editor.words = self.code.words()
        self.notice.say(verdict(found), "good" if found.ok else "error")
        if found.ok:
            self.on_good()
        self._list_files()

    def _show(self) -> None:
        code = self.code
        self._loading = True
        try:
            self.editor.show(code.file.name, code.file.text, code.words())
            self.editor.label = f"code of the {self.role}, {code.file.name}"
        finally:
            self._loading = False
        self._list_files()
        self._list_versions()
        name = code.file.name
        if code.file.is_new:
            self.notice.say(f"a {self.role} to begin with: change what you like, and run it; it is kept as {name}")
        else:
            self.notice.say(f"{name} is checked while you type; Ctrl+Enter runs it")

    def _list_files(self) -> None:
        code = self.code
        options = tuple(
            (f"{name} (new)" if code.file.is_new and name == code.file.name else name, name) for name in code.files()
        )
        self._loading, before = True, self._loading
        try:
            if self.list.options != options:
                self.list.options = options
            self.list.value = code.file.name
        finally:
            self._loading = before

    def _chosen(self, change: Any) -> None:
        if self._loading or not change["new"] or change["new"] == self.code.file.name:
            return
        self._do("open", lambda: self.code.open(str(change["new"])))

    def _turn(self, role: str) -> None:
        self.role = role
        self.said.clear()
        self._show()

    def _new(self) -> None:
        self._do("new file", lambda: self.code.new(self.name.value))
        self.name.value = ""

    def _take(self, name: str, content: bytes) -> None:
        kept = self.code.take(name, content)
        self._show()
        self.said.say(f"{name} is in your folder now" + ("" if kept == name else f", as {kept}"), "good")

    def _dropped(self, name: str, content: bytes) -> None:
        attempt("drop", partial(self._take, name, content), self.said)

    def _do(self, what: str, act: Callable[[], Any]) -> None:
        self.said.clear()
        attempt(what, act, self.said)
        self._show()

    # versions

    def _list_versions(self) -> None:
        self._versions = self.code.versions()
        options: list[tuple[str, Any]] = [("as it is now, against the last run", _NOW)]
        for number, each in enumerate(self._versions[:_MOST]):
            older = self._versions[number + 1].text if number + 1 < len(self._versions) else ""
            when = time.strftime("%d %b %H:%M:%S", time.localtime(each.when))
            options.append((f"{when}  {each.run}  ({change_sentence(older, each.text) if older else 'first'})", number))
        title = f"Versions ({len(self._versions)})"
        if self.history.titles != (title,):
            self.history.titles = (title,)
        self.history.layout.display = "" if self._versions else "none"
        if self.which.options != tuple(options):
            self.which.options = options
            self.which.value = _NOW
        self._compare()

    def _compare(self) -> None:
        """What is in the chosen version that was not in the one before, or in the text and not in the last version."""
        chosen = self.which.value
        self.back.disabled = chosen in (_NOW, None)
        if not self._versions or chosen is None:
            self.difference.value = ""
        elif chosen == _NOW:
            self.difference.value = changes_html(changes(self._versions[0].text, self.code.file.text))
        else:
            older = self._versions[chosen + 1].text if chosen + 1 < len(self._versions) else ""
            self.difference.value = changes_html(changes(older, self._versions[chosen].text))

    def _go_back(self) -> None:
        version = self._versions[int(self.which.value)]
        self.code.edit(version.text)
        self._loading = True
        try:
            self.editor.text = version.text
        finally:
            self._loading = False
        self._list_versions()
        self.said.say(f"{self.code.file.name} is as it was when {version.run} ran", "good")


def verdict(found: Checked) -> str:
    """What the check found in one short line: the faults themselves stand at their lines."""
    faults = [mark for mark in found.marks if mark.fault]
    if not faults:
        return (
            f"{found.path.name}: the {found.role} keeps its interface{''.join(f'; {note}' for note in found.notes[:1])}"
        )
    where = [f"line {mark.line}" for mark in faults if mark.line]
    count = f"{len(faults)} fault{'s' if len(faults) > 1 else ''}"
    return f"{found.path.name}: {count}{': ' if where else ''}{', '.join(where[:4])}"


def changes_html(rows: list[tuple[str, str]]) -> str:
    """Lines that are new, gone and around them, told by their signs and not by colour alone."""
    if not rows:
        return "<p>Nothing has changed.</p>"
    parts = []
    for sign, text in rows:
        if sign == "@":
            parts.append("<span>…</span>")
        else:
            kind = {"+": ' class="new"', "-": ' class="gone"'}.get(sign)
            tag = "b" if kind else "span"
            parts.append(f"<{tag}{kind or ''}>{escape(sign)} {escape(text)}</{tag}>")
    return f'<pre class="rds-code-changes">{"".join(parts)}</pre>'
