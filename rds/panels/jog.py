"""Jog: axes moved by hand, while a button is held or by a step; where they are, and how far from their limits."""

from __future__ import annotations

from html import escape
from typing import Any

import ipywidgets as widgets

from rds.core.errors import RdsError
from rds.panels.hold import HoldButtons
from rds.panels.kit.button import button, columns, follow, group, row
from rds.panels.kit.field import FieldView
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.session.jog import Jog
from rds.session.jog_axes import JogAxis

NAME = "jog"
TITLE = "Jog"
SUMMARY = "Move the axes by hand, and see how far they are from their limits"
HELP = "machine-panel"
_NEAR = 0.05  # of the travel: from here on the limit is said to be near


def build(shell: Any) -> widgets.Widget:
    """The panel."""
    return JogView(shell, Jog(shell.session)).widget


class JogView:
    """The widgets over a `Jog`."""

    def __init__(self, shell: Any, jog: Jog):
        self.jog = jog
        self.notice, self.bar = Notice(), WorkBar(shell.ticker)
        say = self.notice
        self._take = button(
            "Take the machine", "Hold the axes where they are; nothing moves yet", self.take, say, primary=True
        )
        self._free = button("Let it go", "Zero volts, and the machine is free for others", self.free, say)
        self._rest = button("Stop", "Bring all axes to rest", jog.rest, say)
        self._home = button("Home", "All axes to zero, one after the other, Z first", jog.home, say)
        self._holds = {name: self._hold(name) for name in jog.axes}
        self._places = {name: widgets.HTML() for name in jog.axes}
        jog.choices.watch(lambda name: self._set_way())
        step = FieldView(jog.choices, "step")
        side = [
            group("The machine", row(self._take, self._free), row(self._rest, self._home)),
            group("Motion", FieldView(jog.choices, "way"), step, FieldView(jog.choices, "speed")),
        ]
        axes = [row(widgets.HTML(f"<b>{escape(name)}</b>"), self._holds[name], self._places[name]) for name in jog.axes]
        for each in axes:
            each.add_class("rds-jog-axis")
        hint = "<p>Arrow keys move the axis whose button has the focus. Letting go, or leaving the page, stops it.</p>"
        self.widget = columns(side, [self.bar, self.notice, *axes, widgets.HTML(hint)])
        self._was_ready, self._shown_error = False, ""
        self._set_way()
        self._show()
        if not jog.axes:
            self.notice.say(
                "no axis of this machine can be jogged: none has a position and a model with tau and K", "error"
            )
        shell.ticker.add(self._show)

    def take(self) -> None:
        """Take the machine."""
        self._shown_error = ""
        follow(self.bar, self.notice, self.jog.begin, lambda _: self.notice.say("the axes can be moved", "good"))

    def free(self) -> None:
        """Let it go."""
        self.jog.end()
        self.notice.say("the machine is free")

    def _hold(self, name: str) -> HoldButtons:
        def heard(kind: str, direction: int) -> None:
            try:
                if kind == "hold":
                    self.jog.hold(name, direction)
                elif kind == "step":
                    self.jog.step(name, direction)
                else:
                    self.jog.rest()
            except RdsError as error:
                self.notice.say(str(error), "error")

        return HoldButtons(heard, axis=name)

    def _set_way(self) -> None:
        for each in self._holds.values():
            each.by_step = self.jog.choices["way"] == "step"

    def _show(self) -> None:
        ready = self.jog.ready
        self._take.disabled, self._free.disabled = ready, not ready
        self._rest.disabled = self._home.disabled = not ready
        for name, place in self._places.items():
            self._holds[name].disabled = not ready
            shown = _place(self.jog.axes[name], self.jog.positions.get(name) if ready else None)
            if place.value != shown:
                place.value = shown
        if self.jog.error and self.jog.error != self._shown_error and not self.bar.busy:
            self._shown_error = self.jog.error
            self.notice.say(self.jog.error, "error")


def _place(axis: JogAxis, position: float | None) -> str:
    """Position, a bar of the travel with it, and the distance to the nearer limit."""
    low, high = axis.travel
    if position is None:
        return f'<span class="rds-jog-at">– {escape(axis.unit)}</span> travel {low:g} to {high:g}'
    share = min(max((position - low) / (high - low), 0.0), 1.0)
    left, end = min((position - low, "low"), (high - position, "high"))
    near = "⚠ " if left < _NEAR * (high - low) else ""
    return (
        f'<span class="rds-jog-at">{position:.3f} {escape(axis.unit)}</span>'
        f'<span class="rds-jog-end">{low:g}</span><span class="rds-jog-bar" role="img" '
        f'aria-label="{100 * share:.0f} % of the travel"><i style="left:{100 * share:.2f}%"></i></span>'
        f'<span class="rds-jog-end">{high:g}</span> {near}{left:.3f} {escape(axis.unit)} to the {end} limit'
    )
