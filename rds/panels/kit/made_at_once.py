"""Widgets that are made together are told to the page together, each as it is in the end.

ipywidgets tells the page of a widget as soon as it is made, then of each change, and gives each widget a layout and a
style of its own. A panel was up to 954 messages, of which the page, its server and the kernel have a third to do now.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import get_ident
from typing import Any
from uuid import uuid4
from weakref import ref

import ipywidgets as widgets
from ipywidgets.widgets import widget as inner

_LOOKS = ("layout", "style")  # what most widgets have as ipywidgets makes it
# ipywidgets' own, which another version may keep elsewhere: then each widget is told as it is made, as always
_instances: dict[str, widgets.Widget] = getattr(inner, "_instances", {})
_IS_KNOWN = hasattr(inner, "_instances") and hasattr(widgets.Widget, "_widget_construction_callback")


class _Waiting:
    """Stands for a widget's channel to the page until that is opened; keeps what is said to the page meanwhile."""

    kernel = True  # ipywidgets asks whether there is one

    def __init__(self) -> None:
        self.comm_id = uuid4().hex
        self.said: list[tuple[Any, Any]] = []

    def send(self, data: Any, buffers: Any = None) -> None:
        """A change is in the state that the channel opens with."""
        if data["method"] == "custom":
            self.said.append((data["content"], buffers))

    def on_msg(self, heard: Callable[..., Any]) -> None:
        """The page knows nothing of the widget yet."""

    def close(self) -> None:
        """The page never hears of it."""


class _Shared:
    """The channel of a layout or style that is still as ipywidgets makes it: that of one which nobody changes."""

    kernel = True

    def __init__(self, mine: widgets.Widget, shared: widgets.Widget) -> None:
        self._mine, self._shared = ref(mine), shared
        self.comm_id = shared.model_id

    def send(self, data: Any, buffers: Any = None) -> None:
        """It was changed: from here on it has a channel of its own."""
        mine = self._mine()
        if mine is None:
            return
        mine.comm = mine._model_id = None
        mine.open()
        for owner in list(_instances.values()):  # a user may have given it to another widget too
            for name in _LOOKS:
                if owner._trait_values.get(name) is mine:
                    owner.send_state(name)

    def on_msg(self, heard: Callable[..., Any]) -> None:
        """The page says nothing to a layout or style."""

    def close(self) -> None:
        """ipywidgets has forgotten the shared one with it."""
        _remember(self._shared)


_ORIGINALS: dict[type, widgets.Widget] = {}  # of each kind of layout and style, the one that is shared
_waiting: dict[int, widgets.Widget] | None = None  # those that are being made, by their id()
_thread = 0  # which makes them: what another one makes beside it is told as always


@contextmanager
def made_at_once() -> Iterator[None]:
    """Within it no message is sent for the widgets that are made; at its end one for each, and for what it shows."""
    global _waiting, _thread
    if _waiting is not None or not _IS_KNOWN:
        yield
        return
    _waiting, _thread, before = {}, get_ident(), widgets.Widget._widget_construction_callback
    widgets.Widget.on_widget_constructed(_wait)
    try:
        yield
    finally:
        try:
            for each in list(_waiting.values()):
                _open(each)
            while _waiting:  # what was made by looking at them
                _open(next(iter(_waiting.values())))
        finally:
            _waiting = None
            widgets.Widget.on_widget_constructed(before)


def _wait(widget: widgets.Widget) -> None:
    if _waiting is None or get_ident() != _thread:
        return
    if widget.comm is None and widget._model_id is None:
        widget.comm = _Waiting()
        _waiting[id(widget)] = widget


def _open(widget: widgets.Widget) -> None:
    """Tell the page of a widget, and before it of those that it names."""
    assert _waiting is not None
    if _waiting.pop(id(widget), None) is None or not isinstance(channel := widget.comm, _Waiting):
        return  # told already, or closed
    for name in widget.keys:
        value = getattr(widget, name)
        if name in _LOOKS and isinstance(value, widgets.Widget) and _share(value):
            continue
        for named in _named(value):
            _open(named)
    widget.comm = None
    widget.open()  # with the same identifier
    for content, buffers in channel.said:
        widget.send(content, buffers)


def _named(value: Any) -> Iterator[widgets.Widget]:
    if isinstance(value, widgets.Widget):
        yield value
    elif isinstance(value, list | tuple):
        for each in value:
            yield from _named(each)
    elif isinstance(value, dict):
        yield from _named(list(value.values()))


def _share(look: widgets.Widget) -> bool:
    """Whether a layout or style that the page has not heard of is as all are that nobody has changed."""
    assert _waiting is not None
    if id(look) not in _waiting:
        return False
    original = _ORIGINALS.get(type(look))
    if original is None or original.comm is None:  # or the user has closed all widgets
        original = _ORIGINALS[type(look)] = type(look)()
        _open(original)
    if look.get_state() != original.get_state():
        return False
    del _waiting[id(look)]
    _instances.pop(look.model_id, None)
    look.comm = _Shared(look, original)
    _remember(original)
    return True


def _remember(widget: widgets.Widget) -> None:
    if widget.comm is not None:
        _instances[widget.model_id] = widget
