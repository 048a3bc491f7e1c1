"""What can be done with a run's files: its report opened, its table saved elsewhere, both sent by e-mail."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import ipywidgets as widgets

from rds.core.errors import RdsError
from rds.panels.kit.field import FieldView
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.results import Result
from rds.results.serve import server_of
from rds.session.email import check_address, mail_server, send_files
from rds.session.fields import Text
from rds.session.save_as import save_as
from rds.session.task import Stopped, Task


class ResultActions:
    """`writing()` while the files are being written, `offer(result, folder, sent)` when they are there, `clear()`."""

    def __init__(self, shell: Any):
        self._session = shell.session
        self._result: Result | None = None
        self._folder: Path | None = None
        self._sent: list[str] = []
        self.where = widgets.HTML()
        self.bar = WorkBar(shell.ticker)
        self.notice = Notice()
        self._rows = self._made()
        self.widget = widgets.VBox([self.where, self._rows, self.bar, self.notice])
        self.clear()

    def writing(self) -> None:
        """The run is over, and its files are still to come."""
        self.clear()
        self.where.value = "<p>its files are being written …</p>"

    def offer(self, result: Result, folder: Path, sent: Sequence[str]) -> None:
        """The files are in `folder`; those of the names `sent` go by e-mail, and the first of them is the report."""
        self._result, self._folder, self._sent = result, folder, list(sent)
        self.where.value = f"<p>Saved with its report in <code>{escape(str(folder))}</code>{self._link()}</p>"
        self._rows.layout.display = ""

    def clear(self) -> None:
        """There is nothing to save or send."""
        self._result = self._folder = None
        self.where.value = ""
        self._rows.layout.display = "none"
        self.notice.clear()

    def _link(self) -> str:
        report = self._folder / self._sent[0] if self._folder is not None else None
        if report is None or not report.is_file():  # of a run that was cut short
            return ""
        address = server_of(report.parent.parent).url(f"{report.parent.name}/{report.name}")
        return f' · <a href="{escape(address)}" target="_blank" rel="noopener">Open the report</a>'

    def _made(self) -> widgets.HBox:
        choices = self._session.choices(
            "results",
            [
                Text("save_as", "Save as", "a name that ends with .csv, .mat or .parquet", "", "e.g. first.csv"),
                Text(
                    "send_to", "E-mail to", "addresses, separated by commas", "", "e.g. me@example.edu", refuse=_refuse
                ),
            ],
        )
        save = widgets.Button(description="Save", tooltip="Save the result's table under this name, with its units")
        save.on_click(lambda _: self._save(str(choices["save_as"])))
        send = widgets.Button(description="Send", tooltip="Send the report and the table (CSV) by e-mail")
        send.on_click(lambda _: self._send(str(choices["send_to"])))
        rows = []
        for name, button in (("save_as", save), ("send_to", send)):
            row = widgets.HBox([FieldView(choices, name), button])
            row.add_class("rds-action")
            rows.append(row)
        box = widgets.HBox(rows)
        box.add_class("rds-row")
        return box

    def _save(self, name: str) -> None:
        if self._result is None or self.bar.busy:
            return
        result, folder = self._result, self._session.folder
        task = self._session.work("save", lambda task: f"saved as {save_as(result, folder, name)}")
        self.bar.follow(task, lambda: self._said(task))

    def _send(self, to: str) -> None:
        if self._result is None or self._folder is None or self.bar.busy:
            return
        files = [path for name in self._sent if (path := self._folder / name).is_file()]
        subject, folder = f"RDS: {self._folder.name}", self._session.folder
        text = f"Results of {self._folder.name}, sent from RDS.\n"

        def work(task: Task[str]) -> str:
            return send_files(mail_server(folder), to, subject, text, files, lambda: task.stopping)

        task = self._session.work("send", work)
        task.note = "sending"
        self.bar.follow(task, lambda: self._said(task))

    def _said(self, task: Any) -> None:
        if task.error is None:
            self.notice.say(task.result, "good")
        else:
            self.notice.say(str(task.error), "warning" if task.stopping else "error")
            if not isinstance(task.error, RdsError | Stopped):
                logging.getLogger(__name__).error("%s failed", task.title, exc_info=task.error)


def _refuse(text: str) -> None:
    for each in text.split(","):
        check_address(each)
