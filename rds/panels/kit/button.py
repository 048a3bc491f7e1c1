"""A button that says what is wrong instead of failing, and long work begun by one."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, Protocol, TypeVar

import ipywidgets as widgets

from rds.core.errors import RdsError
from rds.modes import load_mode
from rds.panels.kit.notice import Notice as Line
from rds.panels.kit.work_bar import WorkBar
from rds.panels.session.choices import Choices
from rds.panels.session.task import Task

T = TypeVar("T")
_ORDER = "rds-order"  # what static/presence.js lets go only in time
_MAY_ORDER = "rds-may-order"  # what it gives up where something that stops is pressed after it
WAIT = "wait until it is done, or stop it first"


class Notice(Protocol):
    """Where something is said: the `Notice` of a panel, or the page."""

    def say(self, text: str, kind: str = "note") -> None:
        """Show `text`; kind is note, good, warning or error."""
        ...


def button(text: str, tip: str, act: Callable[[], Any], notice: Notice, primary: bool = False) -> widgets.Button:
    """A button that calls `act()`; what it refuses is said in `notice`."""
    made = widgets.Button(description=text, tooltip=tip, button_style="primary" if primary else "")
    made.on_click(lambda _: attempt(text, act, notice))
    return made


def order(
    shell: Any, text: str, tip: str, act: Callable[[], Any], notice: Notice, primary: bool = False
) -> widgets.Button:
    """A button that moves the machine: a press that comes late, because the page was busy, is refused."""

    def in_time() -> None:
        if _ORDER in made._dom_classes:
            shell.presence.in_time(text)
        act()

    made = button(text, tip, in_time, notice, primary)
    made.add_class(_ORDER)
    made.add_class(_MAY_ORDER)
    return made


def run_order(
    shell: Any, tip: str, act: Callable[[], Any], notice: Notice, choices: Choices, text: str = "Run"
) -> widgets.Button:
    """The Run button: an order in those modes in which something moves."""

    def follow_mode(name: str) -> None:
        if name == "mode":
            (made.remove_class if not load_mode(str(choices["mode"])).moves_machine else made.add_class)(_ORDER)

    made = runs(order(shell, text, tip, act, notice, primary=True))
    follow_mode("mode")
    choices.watch(follow_mode)
    return made


def runs(button: widgets.Button) -> widgets.Button:
    """The button that Ctrl+Enter presses on its panel (static/keys.js)."""
    button.add_class("rds-run")
    button.tooltip = f"{button.tooltip} (Ctrl+Enter; Escape stops)"
    return button


def halt(text: str, tip: str, act: Callable[[], Any], notice: Notice) -> widgets.Button:
    """A button that brings the machine to rest: it waits for nothing, and no order pressed before it comes after it."""
    made = button(text, tip, act, notice)
    made.add_class("rds-halt")
    return made


def attempt(what: str, act: Callable[[], Any], notice: Notice) -> None:
    """Call `act()`; what it refuses, and whatever else goes wrong in it, is said in `notice`."""
    try:
        act()
    except Exception as error:
        say_error(what, error, notice)


def say_error(what: str, error: BaseException, notice: Notice) -> None:
    """Say in `notice` why `what` did not succeed. What nobody has foreseen goes to the log as well."""
    if isinstance(error, RdsError):
        notice.say(str(error), "error")
        return
    logging.getLogger(__name__).error("%s failed", what, exc_info=error)
    notice.say(f"{what} failed: {error or type(error).__name__}", "error")


def is_free(bar: WorkBar, notice: Line) -> bool:
    """Whether `bar` follows nothing. A press that comes while it does, or before the browser locks, is answered."""
    if bar.busy:
        notice.say(WAIT, "warning")
    return not bar.busy


def follow(
    bar: WorkBar,
    notice: Line,
    begin: Callable[[], Task[T]],
    show: Callable[[T], Any],
    stopped: str = "stopped",
    failed: Callable[[], Any] | None = None,
) -> None:
    """Begin work, unless some goes on already; `show(result)` at its end, or its error in `notice`.

    What `begin()` refuses is raised; `stopped` is said of work that was stopped, and `failed()` shows more of an error.
    """
    if not is_free(bar, notice):
        return
    task = begin()
    notice.say("")
    watch(bar, notice, task, show, stopped, failed)


def watch(
    bar: WorkBar,
    notice: Line,
    task: Task[T],
    show: Callable[[T], Any],
    stopped: str = "stopped",
    failed: Callable[[], Any] | None = None,
) -> None:
    """As `follow`, for work that goes on already."""

    def ended() -> None:
        notice.take_back(WAIT)
        if task.stopped:
            notice.say(stopped, "warning")
        elif task.error is not None:
            if task.stopping and isinstance(task.error, RdsError):  # what came of being stopped is no fault
                notice.say(str(task.error), "warning")
            else:
                say_error(task.title, task.error, notice)
            if failed is not None:
                failed()
        else:
            attempt(task.title, lambda: show(task.result), notice)  # type: ignore[arg-type]

    bar.follow(task, ended)
