"""Jog: axes moved by hand, while a button is held or by a step, spindles turned, drives homed; and their limits."""

from __future__ import annotations

from html import escape
from typing import Any

import ipywidgets as widgets

from rds.core.errors import RdsError
from rds.panels.jog.axes import JogAxis, JogSpindle
from rds.panels.jog.hold import HoldButtons
from rds.panels.jog.state import Jog
from rds.panels.jog.turn import TurnButtons
from rds.panels.kit.button import attempt, follow, halt, order
from rds.panels.kit.field import FieldView, check_mended
from rds.panels.kit.html import Html
from rds.panels.kit.layout import columns, group, row
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.panels.page.still_here import StillHere

NAME = "jog"
TITLE = "Jog"
SUMMARY = "Move the axes and the spindle by hand, and see how far they are from their limits"
HELP = "machine-panel"
_NEAR = 0.05  # of the travel: from here on the limit is said to be near
_HINT = (
    "<p>Arrow keys move the axis whose button has the focus. Letting go, or leaving the page, stops it. "
    "A spindle turns until it is stopped, and no longer than this page is in sight.</p>"
)


def build(shell: Any) -> widgets.Widget:
    """The panel."""
    return JogView(shell, Jog(shell.session)).widget


class JogView:
    """The widgets over a `Jog`."""

    def __init__(self, shell: Any, jog: Jog):
        self.jog = jog
        self.notice, self.bar = Notice(), WorkBar(shell.ticker)
        self._here = StillHere()
        say = self.notice
        self._in_time = shell.presence.in_time
        tip = "Hold the axes where they are; nothing moves yet"
        self._take = order(shell, "Take the machine", tip, self.take, say, primary=True)
        self._free = halt("Let it go", "No voltage, and the machine is free for others", self.free, say)
        self._rest = halt("Stop", "Bring all axes and the spindle to rest", self.rest, say)
        self._home = order(shell, "Home", "All axes to zero, one after the other, Z first", jog.home, say)
        tip = "Let the drives look for it, one after the other"
        self._find = order(shell, "Find home", tip, self.find_home, say)
        self._holds = {name: self._hold(name) for name in jog.axes}
        self._turns = {name: self._turn(name) for name in jog.spindles}
        self._places = {name: Html() for name in (*jog.axes, *jog.spindles)}
        jog.choices.watch(lambda name: self._set_way())
        self._not_homed = Html()
        fields = [FieldView(jog.choices, "home_axis"), FieldView(jog.choices, "method")]
        self._homing = group("Homing of drives", *fields, row(self._find), self._not_homed)
        motion = ["way", "step", "speed", *(["spindle_speed"] if jog.spindles else [])]
        tip = "Move the axis to the position; Stop ends that"
        self._go = order(shell, "Go", tip, self.go, say)
        goal = [FieldView(jog.choices, name) for name in (("goal_axis", "goal") if jog.axes else ())]
        self._motion = {name: FieldView(jog.choices, name) for name in motion}
        self._goal = [*goal, self._motion["speed"]]
        side = [
            group("The machine", row(self._take, self._free), row(self._rest, self._home)),
            group("Motion", *self._motion.values()),
            *([group("To a position", *goal, row(self._go))] if goal else []),
            self._homing,
        ]
        rows = [
            row(Html(f"<b>{escape(name)}</b>"), buttons, self._places[name])
            for name, buttons in (self._holds | self._turns).items()
        ]
        for each in rows:
            each.add_class("rds-jog-axis")
        self.widget = columns(side, [self.bar, self.notice, *rows, Html(_HINT), self._here])
        self._shown_error = self._shown_homing = ""
        self._set_way()
        self._show()
        if not rows:
            attempt("jogging", jog.check, self.notice)
        shell.ticker.add(self._show)

    def take(self) -> None:
        """Take the machine."""
        self._shown_error = ""
        follow(self.bar, self.notice, self.jog.begin, lambda _: self.notice.say("the axes can be moved", "good"))

    def free(self) -> None:
        """Let it go."""
        self.jog.end()
        self.notice.say("the machine is free")

    def rest(self) -> None:
        """Stop everything."""
        self.jog.halt()
        for buttons in self._turns.values():
            buttons.forget()

    def go(self) -> None:
        """Move the axis that is chosen to the position."""
        check_mended(self._goal)
        self.notice.clear()  # what was refused before is over
        self.jog.go(self.jog.choices["goal_axis"], self.jog.choices["goal"])

    def find_home(self) -> None:
        """Home the axis that is chosen, or all."""
        which = self.jog.choices["home_axis"]
        self.jog.find_home(None if which == "all" else [which])

    def _hold(self, name: str) -> HoldButtons:
        def heard(kind: str, direction: int) -> None:
            try:
                if kind in ("hold", "step"):
                    check_mended([self._motion["speed"]])
                if kind == "hold":
                    self.jog.hold(name, direction)
                elif kind == "step":
                    self._in_time("The step")
                    self.jog.step(name, direction)
                else:
                    self.jog.rest()
                self.notice.clear()  # what was refused before is over
            except RdsError as error:
                self.notice.say(str(error), "error")

        return HoldButtons(heard, axis=name)

    def _turn(self, name: str) -> TurnButtons:
        def heard(kind: str, direction: int) -> None:
            try:
                if kind == "turn":
                    check_mended([self._motion["spindle_speed"]])
                    self._in_time(name)
                    self.jog.turn(name, direction)
                else:
                    self.jog.still(name)
            except RdsError as error:
                buttons.forget()
                self.notice.say(str(error), "error")

        buttons = TurnButtons(heard, spindle=name)
        return buttons

    def _set_way(self) -> None:
        for each in self._holds.values():
            each.by_step = self.jog.choices["way"] == "step"

    def _show(self) -> None:
        jog = self.jog
        if jog.ready and self._here.gone:  # or its axes would be held, and nobody else could have the machine
            jog.end()
            self.notice.say("no browser has shown this panel for a while: the machine was let go", "warning")
        ready, busy = jog.ready, bool(jog.homing)
        self._take.disabled, self._free.disabled = ready, not ready
        self._rest.disabled = not ready
        self._home.disabled = self._find.disabled = self._go.disabled = not ready or busy
        self._homing.layout.display = None if jog.finds_home else "none"
        left = ", ".join(name for name in jog.axes if name not in jog.homed and name not in jog.left_out)
        self._not_homed.value = f"Not homed since the machine was taken: {escape(left)}" if left else "All are homed."
        for name, each in (self._holds | self._turns).items():
            each.disabled = not ready or busy or name in jog.left_out
        for name, place in self._places.items():
            shown = self._place(name) if ready else self._idle(name)
            if place.value != shown:
                place.value = shown
        if jog.homing != self._shown_homing:
            self._shown_homing = jog.homing
            if jog.homing:
                self.notice.say(f"{jog.homing} looks for its home; Stop ends that")
            elif ready:
                self.notice.say(f"homed: {', '.join(sorted(jog.homed)) or 'no axis'}")
        if jog.error and jog.error != self._shown_error and not self.bar.busy:
            self._shown_error = jog.error
            self.notice.say(jog.error, "error")

    def _idle(self, name: str) -> str:
        """What holds of an axis or spindle while the machine is not taken."""
        axis = self.jog.axes.get(name)
        low, high = axis.travel if axis is not None else self.jog.spindles[name].speeds
        unit, what = (axis.unit, "travel") if axis is not None else ("rev/min", "speeds")
        return f'<span class="rds-jog-at">– {escape(unit)}</span> {what} {low:g} to {high:g} {escape(unit)}'

    def _place(self, name: str) -> str:
        jog = self.jog
        if name in jog.left_out:
            return escape(jog.left_out[name])
        if name in jog.spindles:
            return _turning(jog.spindles[name], jog.speeds.get(name, 0.0))
        if name not in jog.positions:
            return self._idle(name)
        return _standing(jog.axes[name], jog.positions[name])


def _standing(axis: JogAxis, position: float) -> str:
    """Position, a bar of the travel with it, and the distance to the nearer limit."""
    low, high = axis.travel
    left, end = min((position - low, "low"), (high - position, "high"))
    near = "⚠ " if left < _NEAR * (high - low) else ""
    bar = _bar(f"{position:.3f} {axis.unit}", position, low, high, "travel")
    return f"{bar} {near}{left:.3f} {escape(axis.unit)} to the {end} limit"


def _turning(spindle: JogSpindle, speed: float) -> str:
    """The measured speed, and a bar of those that are allowed with it."""
    return _bar(f"{speed:.0f} {spindle.unit}", speed, *spindle.speeds, "speeds")


def _bar(text: str, value: float, low: float, high: float, of: str) -> str:
    """A value with its place between two ends."""
    share = min(max((value - low) / (high - low), 0.0), 1.0)
    return (
        f'<span class="rds-jog-at">{escape(text)}</span>'
        f'<span class="rds-jog-end">{low:g}</span><span class="rds-jog-bar" role="img" '
        f'aria-label="{100 * share:.0f} % of the {of}"><i style="left:{100 * share:.2f}%"></i></span>'
        f'<span class="rds-jog-end">{high:g}</span>'
    )
