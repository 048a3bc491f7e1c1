"""Bus: what goes over it now, decoded; and what it must carry at worst, with everybody's response times."""

from __future__ import annotations

from html import escape
from typing import Any

from rds.core.errors import InputError
from rds.core.shared_quantities import SAMPLE_PERIOD
from rds.panels.kit.button import button, follow
from rds.panels.kit.field import FieldView, check_mended
from rds.panels.kit.html import Html
from rds.panels.kit.layout import columns, group, row
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.panels.machine.monitor import BusMonitor, parse_filter
from rds.panels.machine.state import MachineState
from rds.panels.session.fields import Number, Text
from rds.results import html

_FILTER = Text(
    "filter",
    "Show only",
    "Identifiers (0x020), ranges (0x020-0x07F) or parts of names, separated by commas",
    "",
    placeholder="everything",
    longest=200,
    refuse=lambda text: void(parse_filter(text)),
)
_LOAD = (
    Number("bitrate", "Bit rate", "Of the bus", 1_000_000, unit="bit/s", low=10_000, high=1_000_000, whole=True),
    Number.of(SAMPLE_PERIOD, "period", "Sample period", 0.001),
    Number("answer", "Modules answer within", "From a command's arrival", 0.0, unit="s", low=0.0, high=0.1),
)
_FIRST = (
    "<p>Listen shows each kind of frame here while it comes: how often, from whom, and what it says. Analyse works out "
    "the load of the bus, and the worst response time of each frame beside its deadline, before anything runs.</p>"
)
_EVERY = 3  # ticks of 0.1 s between two tables


def void(_: Any) -> None:
    """Nothing, of what was only tried."""


class BusView:
    """The monitor, and the load."""

    def __init__(self, shell: Any, state: MachineState):
        self.session, self.state, self.monitor = shell.session, state, BusMonitor()
        self.notice, self.bar = Notice(), WorkBar(shell.ticker)
        self.choices = shell.session.choices("bus", [_FILTER, *_LOAD])
        self.live, self.load = Html(_FIRST), Html()
        for each in (self.live, self.load):
            each.add_class("rds-scroll")
        self.live.add_class("rds-monitor")
        say = self.notice
        self._pause = button("Pause", "Keep what is shown; the bus goes on", self.pause, say)
        self._listen = button(
            "Listen", "Show what goes over the bus, until Stop; it only listens", self.listen, say, True
        )
        self._end = button("Stop", "Stop listening", self.monitor.end, say)
        self._task: Any = None
        self._ticks = 0
        self._fields = [FieldView(self.choices, name) for name in ("bitrate", "period", "answer")]
        self._filter = FieldView(self.choices, "filter")
        tip = "Load and worst-case response times of this machine in this dialect"
        side = [
            group("Monitor", self._filter, row(self._listen, self._pause, self._end)),
            group("Load at worst", *self._fields, row(button("Analyse", tip, self.analyse, say))),
        ]
        self.widget = columns(side, [self.bar, self.notice, self.live, self.load])
        self._enable()
        shell.ticker.add(self._tick)

    def listen(self) -> None:
        """Begin."""
        if self._task is not None:
            return
        check_mended([self._filter])
        interface, channel = self.state.bus
        work = self.monitor.watch(interface, channel, **self.session.bus_options)
        self._task = self.session.work("bus monitor", work, self.monitor.end)
        self.notice.clear()
        self._enable()

    def pause(self) -> None:
        """Keep or go on."""
        self.monitor.paused = not self.monitor.paused
        self._enable()

    def analyse(self) -> None:
        """The bus at worst."""
        check_mended(self._fields)
        machine, dialect = self.state.machine, self.state.choices["dialect"]
        bitrate, period, answer = (self.choices[name] for name in ("bitrate", "period", "answer"))

        def work(task: Any) -> Any:
            from rds.bus.analysis.analysis_report import analyse

            return analyse(machine, bitrate, period, dialect=dialect, response_time=answer)

        follow(self.bar, self.notice, lambda: self.session.work("bus analysis", work), self._show_load)

    def _show_load(self, analysis: Any) -> None:
        if self.live.value == _FIRST:
            self.live.value = ""
        rows = [
            [
                each.name,
                each.identifier_text,
                each.sender,
                each.period * 1e3,
                each.transmission * 1e6,
                each.response * 1e6,
                each.deadline * 1e6,
                ("✔\u00a0" if each.verdict == "met" else "✖\u00a0") + each.verdict,
            ]
            for each in analysis.rows
        ]
        heads = ["message", "identifier", "sender", "every [ms]", "takes [µs]", "answers by [µs]", "due by [µs]", ""]
        title = f"{analysis.title}: {analysis.load_percent:.1f} % load, {analysis.worst_load_percent:.1f} % at worst"
        self.load.value = _bar(analysis.worst_load_percent) + html.table(heads, rows, title, analysis.assumed)
        if analysis.met:
            self.notice.say("every message keeps its deadline", "good")
        else:
            self.notice.say("not every message keeps its deadline: raise the bit rate or the sample period", "warning")

    def _tick(self) -> None:
        task = self._task
        self._ticks += 1
        if task is None or (self._ticks % _EVERY and not task.done):
            return
        if self.monitor.view is not None and not self.monitor.paused:
            self._show_live()
        if task.done:
            self._task = None
            self._enable()
            if task.error is not None:
                self.notice.say(f"{task.error}; is a machine there? Look at Modules", "error")

    def _show_live(self) -> None:
        view = self.monitor.view
        assert view is not None
        try:
            lines, more = self.monitor.lines(self.choices["filter"])
        except InputError as error:
            self.notice.say(str(error), "error")
            return
        rows = [[x.identifier, x.name, x.count, x.rate, x.load, x.data, x.signals] for x in lines]
        heads = ["identifier", "message", "frames", "frames/s", "load [%]", "data", "means"]
        left = f"and {more} more identifiers: say above which are to be shown" if more else ""
        sign = "" if view.healthy else "⚠ "
        said = f"<p>{sign}{escape(self.monitor.headline)}</p>"
        self.live.value = (
            said
            + _bar(view.snapshot.load)
            + (html.table(heads, rows, note=left) if rows else "<p>no frame that is to be shown goes over the bus</p>")
        )

    def _enable(self) -> None:
        going = self._task is not None
        self._listen.disabled, self._pause.disabled, self._end.disabled = going, not going, not going
        self._pause.description = "Go on" if self.monitor.paused else "Pause"


def _bar(percent: float) -> str:
    """The load as a bar, read out as a meter."""
    share = min(max(percent, 0.0), 100.0)
    return (
        f'<meter class="rds-load" min="0" max="100" low="60" high="80" optimum="0" value="{share:.1f}" '
        f'aria-label="bus load {percent:.1f} %"></meter>'
    )
