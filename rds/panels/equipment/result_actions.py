"""What can be done with a run's files: its report opened, its table saved elsewhere, both sent by e-mail."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape
from pathlib import Path
from typing import Any, Protocol

import ipywidgets as widgets

from rds.core.errors import InputError
from rds.panels.kit.button import button, follow, say_error
from rds.panels.kit.field import FieldView, check_mended
from rds.panels.kit.html import Html
from rds.panels.kit.layout import row
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.panels.session.email import check_addresses, mail_server, send_files
from rds.panels.session.fields import Text
from rds.panels.session.save_as import save_as
from rds.panels.session.task import Task
from rds.results import Result
from rds.results.serve import server_of


class Saved(Protocol):
    """A run that is over, and whose pictures and reports may be still to come."""

    folder: Path

    @property
    def written(self) -> bool:
        """Whether nothing more comes."""
        ...

    @property
    def unwritten(self) -> BaseException | None:
        """Why pictures and reports could not be made."""
        ...


class ResultActions:
    """`writing()` when the loop is over, `follow(...)` once its tables are there, `offer(...)` all files; `clear()`."""

    def __init__(self, shell: Any):
        self._session, self._ticker = shell.session, shell.ticker
        self._end: Callable[[], None] = lambda: None  # of waiting for pictures and reports
        self._result: Result | None = None
        self._folder: Path | None = None
        self._sent: list[str] = []
        self.where = Html()
        self.bar = WorkBar(shell.ticker)
        self.notice = Notice()
        self._views: dict[str, FieldView] = {}
        self._rows = self._made()
        self.widget = widgets.VBox([self.where, self._rows, self.bar, self.notice])
        self.clear()

    def writing(self) -> None:
        """The run is over, and its files are still to come."""
        self.clear()
        self.where.value = "<p>its files are being written …</p>"

    def offer(self, result: Result, folder: Path, sent: Sequence[str]) -> None:
        """The files are in `folder`; those of the names `sent` go by e-mail, and the first of them is the report."""
        self._take(result, folder, sent)
        self.where.value = f"<p>Saved with its report in <code>{escape(str(folder))}</code>{self._link()}</p>"

    def follow(self, result: Result, run: Saved, sent: Sequence[str]) -> None:
        """As `offer`, once the pictures and the report are there; the table can be saved elsewhere at once."""
        if run.written and run.unwritten is None:
            self.offer(result, run.folder, sent)
            return
        self._take(result, run.folder, sent)
        where = f"<code>{escape(str(run.folder))}</code>"
        self.where.value = f"<p>Its tables are in {where}; pictures and report follow …</p>"

        def look() -> None:
            if run.written:
                self.offer(result, run.folder, sent)
                if run.unwritten is not None:
                    say_error("the report", run.unwritten, self.notice)

        self._end = self._ticker.add(look)

    def _take(self, result: Result, folder: Path, sent: Sequence[str]) -> None:
        self._end()
        self._result, self._folder, self._sent = result, folder, list(sent)
        self._rows.layout.display = ""

    def clear(self) -> None:
        """There is nothing to save or send."""
        self._end()
        self._result = self._folder = None
        self.where.value = ""
        self._rows.layout.display = "none"
        self.notice.clear()

    def _link(self) -> str:
        report = self._folder / self._sent[0] if self._folder is not None else None
        if report is None or not report.is_file():  # of a run that was cut short
            return ""
        return f" · {report_link(report)}"

    def _made(self) -> widgets.HBox:
        choices = self._session.choices(
            "results",
            [
                Text("save_as", "Save as", "a name that ends with .csv, .mat or .parquet", "", "e.g. first.csv"),
                Text(
                    "send_to",
                    "E-mail to",
                    "addresses, separated by commas",
                    "",
                    "e.g. me@example.edu",
                    refuse=check_addresses,
                ),
            ],
        )
        saved = "Save the result's table under this name, with its units"
        sent = "Send the report and the table (CSV) by e-mail"
        actions = []
        for name, press in (
            ("save_as", button("Save", saved, lambda: self._save(str(choices["save_as"])), self.notice)),
            ("send_to", button("Send", sent, lambda: self._send(str(choices["send_to"])), self.notice)),
        ):
            self._views[name] = FieldView(choices, name)
            action = widgets.HBox([self._views[name], press])
            action.add_class("rds-action")
            actions.append(action)
        return row(*actions)

    def _save(self, name: str) -> None:
        if (result := self._result) is None:
            return
        check_mended([self._views["save_as"]])

        def work(_: Task[str]) -> str:
            return f"saved as {save_as(result, self._session.folder, name)}"

        follow(self.bar, self.notice, lambda: self._session.work("saving", work), self._succeeded)

    def _send(self, to: str) -> None:
        if self._folder is None:
            return
        check_mended([self._views["send_to"]])
        files = [path for name in self._sent if (path := self._folder / name).is_file()]
        if not files:
            raise InputError(f"nothing is there to send: {', '.join(self._sent)} are gone from {self._folder}")
        subject, folder = f"RDS: {self._folder.name}", self._session.folder
        text = f"Results of {self._folder.name}, sent from RDS.\n"

        def work(task: Task[str]) -> str:
            task.note = "sending"
            return send_files(mail_server(folder), to, subject, text, files, lambda: task.stopping)

        follow(self.bar, self.notice, lambda: self._session.work("sending", work), self._succeeded)

    def _succeeded(self, sentence: str) -> None:
        self.notice.say(sentence, "good")


def report_link(report: Path) -> str:
    """A link, as HTML, that opens a report in the folder of a run."""
    address = server_of(report.parent.parent).url(f"{report.parent.name}/{report.name}")
    return f'<a href="{escape(address)}" target="_blank" rel="noopener">Open the report</a>'
