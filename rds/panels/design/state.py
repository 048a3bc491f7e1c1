"""Design: the poles of the tracking controller, what follows from them, and the file that is written of it.

Numbers are those of `rds.identification.robustness.tracking_design`, files those of
`rds design tracking`; here are only choices.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.machines import Machine, load_machine
from rds.panels.design.fields import AXIS, LIBRARY, MODEL_FILE, PAIR, fields
from rds.panels.equipment.build import Builds, Checked
from rds.panels.session.choices import Choices
from rds.panels.session.session import Session
from rds.panels.session.task import Task

if TYPE_CHECKING:
    from rds.core.types import Model
    from rds.identification.fit.design import Linear
    from rds.identification.robustness.draws import Spread
    from rds.identification.robustness.tracking_design import LoopDraws, TrackingDesign

DRAWS = 200  # of the cloud
PANEL = "design"


@dataclass(frozen=True)
class DesignedAxis:
    """What is designed for: its linear part, and the model that the design is tried on."""

    linear: Linear
    model: Model


class Design:
    """The choices of the panel and the design that they say. `now()` takes milliseconds, `cloud()` is a Task."""

    def __init__(self, session: Session):
        self.session = session
        self.machine: Machine = load_machine(session.machine)
        self.choices: Choices = session.choices(PANEL, fields(self.machine))
        self.builds = Builds()
        self._axis: tuple[tuple[str, int], DesignedAxis] | None = None

    @property
    def shown(self) -> list[str]:
        """The names of the choices that matter for what is chosen, in order."""
        idle = {AXIS} if self.choices["source"] == MODEL_FILE else {"model_file"}
        idle |= {"first", "second"} if self.choices["kind"] == PAIR else {"real", "imaginary"}
        return [name for name in self.choices.fields if name not in idle]

    @property
    def poles(self) -> tuple[complex, complex]:
        """The two poles that are chosen, 1/s."""
        chosen = self.choices
        if chosen["kind"] == PAIR:
            return complex(chosen["real"], chosen["imaginary"]), complex(chosen["real"], -chosen["imaginary"])
        return complex(chosen["first"]), complex(chosen["second"])

    def axis(self) -> DesignedAxis:
        """The axis that is chosen, read again when its file has changed. InputError where it cannot be designed for."""
        path = self._model_path()
        key = (str(path or self.choices[AXIS]), _stamp(path))
        if self._axis is None or self._axis[0] != key:
            self._axis = key, from_file(path) if path is not None else from_machine(self.machine, self.choices[AXIS])
        return self._axis[1]

    def now(self) -> TrackingDesign:
        """The design for what is chosen. InputError that says why poles will not do, or the axis."""
        return self.with_poles(self.poles, self.choices["observer"])

    def with_poles(self, poles: tuple[complex, complex], observer_pole: float) -> TrackingDesign:
        """The design for other poles, which are not chosen yet; InputError that says why they will not do."""
        from rds.identification.robustness.tracking_design import tracking_design

        axis = self.axis()
        return tracking_design(
            axis.linear,
            model=axis.model,
            sample_period=self.choices["sample_period"],
            poles=poles,
            observer_pole=observer_pole,
            voltage_range=self.machine.converter.range,
        )

    def preview(self, name: str, place: complex) -> TrackingDesign:
        """The design with the pole called `name` ("pair", "first", "second", "observer") at `place`, 1/s.

        InputError that says why it cannot be there. Nothing is chosen by it.
        """
        return self._placed(name, place)[0]

    def move(self, name: str, place: complex) -> TrackingDesign:
        """Choose that place for a pole, and give the design; InputError as `preview`, and then nothing has moved."""
        made, values = self._placed(name, place)
        for each, value in values.items():
            self.choices.set(each, value)
        return made

    def _placed(self, name: str, place: complex) -> tuple[TrackingDesign, dict[str, float]]:
        poles, observer = self.poles, float(self.choices["observer"])
        values = {name: place.real}
        if name == PAIR:
            poles = complex(place.real, abs(place.imag)), complex(place.real, -abs(place.imag))
            values = {"real": place.real, "imaginary": abs(place.imag)}
        elif name in ("first", "second"):
            poles = (complex(place.real), poles[1]) if name == "first" else (poles[0], complex(place.real))
        elif name == "observer":
            observer = place.real
        else:
            raise InputError(f"there is no pole {name!r}; there are pair, first, second and observer")
        made = self.with_poles(poles, observer)
        return made, {each: self.choices.fields[each].check(value) for each, value in values.items()}

    def limit(self) -> np.ndarray:
        """Points (n, 2) of the bound of what this sample period can hold stable, upper half of the s-plane, 1/s."""
        from rds.identification.robustness.tracking_design import sampled_limit

        linear = self.axis().linear
        angles = np.linspace(0.0, np.pi / 2 - 1e-3, 91)
        size = sampled_limit(linear.tau, linear.K, self.choices["sample_period"], angles)
        return np.column_stack([-size * np.cos(angles), size * np.sin(angles)])

    def spread(self) -> Spread:
        """What the axis may be: τ and K within ± their per cent, and up to the delay that is chosen."""
        from rds.identification.robustness.draws import Spread

        linear, chosen = self.axis().linear, self.choices
        values = np.array([linear.tau, linear.K, 0.0])
        width = values * np.array([chosen["spread_tau"], chosen["spread_K"], 0.0]) / 100.0
        high = values + width + np.array([0.0, 0.0, chosen["delay"] / 1e3])
        return Spread(
            ("tau", "K", "delay"), values, {"tau": "s", "K": "(mm/s)/V", "delay": "s"}, None, values - width, high
        )

    def cloud(self, design: TrackingDesign) -> Task[LoopDraws]:
        """Begin to look at `design` over what the axis may be."""
        spread = self.spread()
        return self.session.work("robustness", lambda task: design.cloud(spread, DRAWS))

    def file(self, name: str) -> Path:
        """Where a controller called `name` goes in the session's folder; InputError for what is no such name."""
        name = name.strip()
        path = self.session.folder / name
        if not name or path.suffix != ".py" or path.name != name:
            raise InputError(f"name the controller's file, such as my_tracking.py, not {name!r}")
        return path

    def write(self, name: str, replace: bool = False) -> Path:
        """Write the design as a controller's file; InputError where one is there already, unless `replace`."""
        from rds.identification.fit.design import write_tracking

        path = self.file(name)
        if path.exists() and not replace:
            raise InputError(f"{path.name} is there already; replace it, or choose another name")
        self.now()  # says why, where it cannot be
        return write_tracking(
            path,
            self.axis().linear,
            sample_period=self.choices["sample_period"],
            poles=[*self.poles],
            observer_pole=self.choices["observer"],
            voltage_range=self.machine.converter.range,
        )

    def keep_picture(self, png: bytes) -> Path:
        """Write a picture beside the controller's file, under its name with a number that none has yet."""
        file, number = self.file(self.choices["file"]), 1
        while (path := file.with_name(f"{file.stem}-{number}.png")).exists():
            number += 1
        return write_whole(path, png)

    def check(self, path: Path) -> Task[Checked]:
        """Begin the check of a written file, as `rds check` does it."""
        T = self.choices["sample_period"]
        return self.session.work("check", lambda task: self.builds.check("controller", path, T, task.pulse))

    def try_it(self, path: Path) -> None:
        """Choose the file, the axis and the sample period in Equipment control."""
        from rds.panels.equipment.fields import USER
        from rds.panels.equipment.state import Equipment

        control = Equipment(self.session, "control").choices
        if self.choices["source"] == LIBRARY:
            control.set("system", self.choices[AXIS])
        control.set("controller", USER)
        control.set("controller_file", path.name)
        control.set("sample_period", self.choices["sample_period"])

    def watch(self, watcher: Callable[[str], None]) -> Callable[[], None]:
        """Call `watcher(name)` after each change of a choice; the answer ends that."""
        return self.choices.watch(watcher)

    def _model_path(self) -> Path | None:
        if self.choices["source"] == LIBRARY:
            return None
        name = str(self.choices["model_file"]).strip()
        if not name:
            raise InputError(f"name the model file, as Save model in Data writes it (in {self.session.folder})")
        return self.session.folder / name


def from_machine(machine: Machine, name: str) -> DesignedAxis:
    """An axis of a machine, by the model that its file gives it."""
    from rds.identification.fit.design import linear_axis_of_machine
    from rds.models import library_model

    table = dict(machine.axis(name).model)
    return DesignedAxis(linear_axis_of_machine(machine, name), library_model(table.pop("name"), **table))


def from_file(path: Path) -> DesignedAxis:
    """The axis of a model file. A student's structure stands for its τ and K alone: its code is not run here."""
    from rds.identification.fit.design import linear_axis_of
    from rds.identification.fit.model_file import read_model
    from rds.identification.fit.run_model import run_model
    from rds.models import library_model

    file = read_model(path)
    linear = linear_axis_of(file)
    if file.is_student:
        return DesignedAxis(linear, library_model("linear-axis", tau=linear.tau, K=linear.K))
    return DesignedAxis(linear, run_model(file))


def _stamp(path: Path | None) -> int:
    try:
        return path.stat().st_mtime_ns if path is not None else 0
    except OSError:
        return 0
