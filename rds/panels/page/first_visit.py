"""The first visit: an axis follows a sine, simulated by the machine's own model, and its error is drawn beside it.

Nothing has to be pressed. The page asks for the samples once it is in sight; they are simulated then, beside the page.
"""

from __future__ import annotations

from typing import Any

import anywidget
import numpy as np
import traitlets

from rds.modes import SIMULATION
from rds.panels.kit.static_files import static
from rds.panels.session.session import Session
from rds.panels.session.task import Task

RATE = 50  # samples a second that are shown
_REFERENCE = {"kind": "sinusoid", "amplitude": 5.0, "frequency": 0.5}
_PERIODS = 2  # simulated; the last one is shown, again and again


class FirstVisit(anywidget.AnyWidget):
    """Empty until the page asks; then one period of time (s), reference, measured and error (mm)."""

    _esm = traitlets.Unicode().tag(sync=True)
    axis = traitlets.Unicode("").tag(sync=True)
    unit = traitlets.Unicode("").tag(sync=True)

    def __init__(self, session: Session, ticker: Any):
        super().__init__(_esm=static(__file__, "first_visit.js"))
        self._session, self._ticker = session, ticker
        self._rows: np.ndarray | None = None
        self._task: Task[tuple[str, str, np.ndarray]] | None = None
        self.on_msg(self._asked)

    def _asked(self, _: Any, content: Any, __: Any) -> None:
        """The page is in sight."""
        if content != {"kind": "here"}:
            return
        if self._rows is not None:
            self._deliver(self._rows)
        elif self._task is None:
            machine = self._session.machine
            self._task = self._session.work("first sight", lambda _: first_sight(machine))
            self._end = self._ticker.add(self._look)

    def _look(self) -> None:
        task = self._task
        if task is None or not task.done:
            return
        self._end()
        if task.result is not None:  # a machine whose first axis cannot follow it shows nothing
            self.axis, self.unit, self._rows = task.result
            self._deliver(self._rows)

    def _deliver(self, rows: np.ndarray) -> None:
        self.send({"kind": "rows"}, [np.ascontiguousarray(rows, dtype="<f8").tobytes()])


def first_sight(machine: str) -> tuple[str, str, np.ndarray]:
    """The first axis of the machine under proportional control, simulated: its name, unit and one period's rows.

    A row is time (s), reference, measured, error.
    """
    from rds.machines import load_machine
    from rds.modes.experiment.experiment import Experiment

    name, axis = next(iter(load_machine(machine).axes.items()))
    seconds = _PERIODS / float(_REFERENCE["frequency"])  # type: ignore[arg-type]
    words = {"axis": name, "mode": SIMULATION, "duration": seconds, "sample_period": 0.001}
    table = words | {"machine": machine, "reference": _REFERENCE, "controller": {"name": "p"}}
    result = Experiment.from_table(table).run()
    last = result["time"] >= seconds * (1.0 - 1.0 / _PERIODS)
    reference, measured = result[f"{name}_reference"][last], result[f"{name}_measured"][last]
    time = result["time"][last] - result["time"][last][0]
    return name, axis.unit, np.column_stack([time, reference, measured, reference - measured])[:: 1000 // RATE]
