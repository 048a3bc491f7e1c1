"""A button that says what is wrong instead of failing, and long work begun by one."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, TypeVar

import ipywidgets as widgets

from rds.core.errors import RdsError
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.session.task import Task

T = TypeVar("T")


def button(text: str, tip: str, act: Callable[[], Any], notice: Notice, primary: bool = False) -> widgets.Button:
    """A button that calls `act()`; what it refuses is said in `notice`."""
    made = widgets.Button(description=text, tooltip=tip, button_style="primary" if primary else "")

    made.on_click(lambda _: attempt(text, act, notice))
    return made


def attempt(what: str, act: Callable[[], Any], notice: Notice) -> None:
    """Call `act()`; what it refuses, and whatever else goes wrong in it, is said in `notice`."""
    try:
        act()
    except RdsError as error:
        notice.say(str(error), "error")
    except Exception as error:
        logging.getLogger(__name__).exception("%s failed", what)
        notice.say(f"{what} failed: {error}", "error")


def follow(bar: WorkBar, notice: Notice, begin: Callable[[], Task[T]], show: Callable[[T], Any]) -> None:
    """Begin work, unless some goes on already; `show(result)` at its end, or its error in `notice`."""
    if bar.busy:
        notice.say("wait until it is done, or stop it first", "warning")
        return
    task = begin()
    notice.clear()

    def ended() -> None:
        try:
            if task.stopped:
                notice.say("stopped", "warning")
            elif task.error is not None:
                raise task.error
            else:
                show(task.result)  # type: ignore[arg-type]
        except RdsError as error:
            notice.say(str(error), "error")
        except Exception as error:
            logging.getLogger(__name__).exception("%s failed", task.title)
            notice.say(f"{task.title} failed: {error}", "error")

    bar.follow(task, ended)


def row(*children: Any) -> widgets.HBox:
    """Controls side by side, which go on in the next line where there is no room."""
    box = widgets.HBox(list(children))
    box.add_class("rds-row")
    return box


def group(title: str, *children: Any) -> widgets.VBox:
    """Controls under a heading."""
    box = widgets.VBox([widgets.HTML(f"<h3>{title}</h3>"), *children])
    box.add_class("rds-group")
    return box


def columns(side: list[Any], main: list[Any]) -> widgets.HBox:
    """Settings at the left, what comes of them at the right."""
    left, right = widgets.VBox(side), widgets.VBox(main)
    left.add_class("rds-side")
    right.add_class("rds-main")
    box = widgets.HBox([left, right])
    box.add_class("rds-columns")
    return box
