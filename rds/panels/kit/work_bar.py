"""Progress of long work, with the time that it will still take and a stop button."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import monotonic
from typing import Any, Protocol

import ipywidgets as widgets

from rds.panels.kit.ticker import Ticker

_SECONDS = 1.0  # between two showings, as the seconds left are counted: each costs kernel and page two messages


class Work(Protocol):
    """What can be watched: a Task of the session, or what wraps a run."""

    @property
    def share(self) -> float | None:
        """0 to 1, or None where nobody knows."""
        ...

    @property
    def seconds_left(self) -> float | None:
        """s."""
        ...

    @property
    def done(self) -> bool:
        """Whether it is over."""
        ...

    @property
    def note(self) -> str:
        """What it does now."""
        ...

    def stop(self) -> None:
        """Ask it to end."""
        ...


class WorkBar(widgets.HBox):
    """Hidden until `follow(work, ended)`; when the work is over it calls `ended()` once, and hides again.

    `locks` are the buttons that cannot be pressed meanwhile.
    """

    def __init__(self, ticker: Ticker):
        self.locks: Sequence[widgets.Button] = ()
        self._bar = widgets.FloatProgress(value=0.0, min=0.0, max=1.0, tooltip="")
        self._bar.add_class("rds-progress")
        self._text = widgets.Label("", tooltip="")
        self.stop_button = widgets.Button(
            description="Stop", icon="", button_style="warning", tooltip="End it; what was recorded is kept"
        )
        self.stop_button.on_click(lambda _: self._stop())
        super().__init__([self._bar, self._text, self.stop_button])
        self.add_class("rds-work")
        self.layout.display = "none"
        self._ticker = ticker
        self._work: Any = None
        self._stopped_in: str | None = None  # what it was doing when it was asked to end
        self._shown_at, self._shown_note = 0.0, ""  # s, of the monotonic clock
        self._ended: Callable[[], None] | None = None
        self._end: Callable[[], None] | None = None

    @property
    def busy(self) -> bool:
        """Whether it follows something that is not over."""
        return self._work is not None

    def follow(self, work: Work, ended: Callable[[], None]) -> None:
        """Show the progress of `work` until it is over."""
        self._work, self._ended, self._stopped_in = work, ended, None
        self.layout.display = ""
        self.stop_button.disabled = False
        self._lock(True)
        self._show(work)
        self._look()
        if self._work is not None:
            self._end = self._ticker.add(self._look)

    def _stop(self) -> None:
        if self._work is not None:
            self.stop_button.disabled = True
            self._stopped_in = self._work.note
            self._text.value = "stopping"
            self._work.stop()

    def _look(self) -> None:
        work = self._work
        if work is None:
            return
        if work.note != self._shown_note or monotonic() - self._shown_at >= _SECONDS:
            self._show(work)
        if work.done:
            ended, self._work = self._ended, None
            self.layout.display = "none"
            if self._end is not None:
                self._end()
            self._lock(False)
            if ended is not None:
                ended()

    def _show(self, work: Work) -> None:
        self._shown_at, self._shown_note = monotonic(), work.note
        share, left = work.share, work.seconds_left
        self._bar.value = share or 0.0
        if self._stopped_in is not None:  # after it has stopped there may be files to write, which are no share of it
            self._text.value = "stopping" if work.note == self._stopped_in else work.note
        else:
            parts = [work.note, "" if share is None else f"{share:.0%}", "" if left is None else f"{left:.0f} s left"]
            self._text.value = ", ".join(filter(None, parts)) or "working"

    def _lock(self, on: bool) -> None:
        for button in self.locks:
            button.disabled = on
