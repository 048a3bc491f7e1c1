"""Equipment model and equipment control: choices of one system, and the experiment that they say.

The experiment is the same table that a TOML file would hold: what a panel runs, the command line repeats.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from rds.core.errors import InputError
from rds.machines import Axis, Machine, load_machine
from rds.session.choices import Choices
from rds.session.fields import Choice, Field, Number, Text
from rds.session.session import Session

USER = "user"  # the choice of something that the student wrote
MODES = {
    "model": {
        "simulation": "Simulation",
        "system-test": "System test",
        "model-validation": "Model validation",
    },
    "control": {"simulation": "Simulation", "emulation": "Emulation", "implementation": "Implementation"},
}
SHAPES = {"square": "Square", "triangle": "Triangle", "sinusoid": "Sinusoid", USER: "User-defined"}
CONTROLLERS = {
    "p": "Proportional",
    "pid": "PID",
    "modified-pid": "Modified PID",
    "tracking": "General tracking",
    USER: "User-defined",
}
_SPINDLE = "rev/min"
# first values that every axis of the mini CNC can follow: (amplitude, frequency) by what is driven
_FIRST = {"V": (2.0, 1.0), "mm": (5.0, 0.2), "°": (20.0, 0.2), _SPINDLE: (200.0, 0.5)}


@dataclass
class Equipment:
    """One system under test: `kind` is "model" (a voltage signal drives it) or "control" (a controller does)."""

    session: Session
    kind: str

    def __post_init__(self) -> None:
        self.machine: Machine = load_machine(self.session.machine)
        self.choices: Choices = self.session.choices(f"equipment {self.kind}", self._fields())
        self._fit_system()
        self.choices.watch(self._chosen)

    @property
    def axis(self) -> Axis:
        """The axis that is chosen."""
        return self.machine.axes[self.choices["system"]]

    @property
    def unit(self) -> str:
        """The unit of the amplitude: V of a voltage signal, else the axis's own."""
        return "V" if self.kind == "model" else self.axis.unit

    @property
    def parameters(self) -> list[str]:
        """The names of the controller's parameters among the choices."""
        return [name for name in self.choices.fields if name.startswith("controller.")]

    def table(self) -> dict[str, Any]:
        """The experiment, as the table of a TOML file."""
        chosen = self.choices
        table: dict[str, Any] = {
            "machine": self.session.machine,
            "axis": chosen["system"],
            "mode": chosen["mode"],
            "duration": chosen["duration"],
            "sample_period": chosen["sample_period"],
            "signal" if self.kind == "model" else "reference": self._shape(),
        }
        if self.kind == "control":
            table["controller"] = self._controller()
        if chosen["model"] == USER:
            table["model"] = {"file": self._file("model_file", "model")}
        if self.session.bus:
            table["bus"] = dict(self.session.bus)
        return table

    def _shape(self) -> dict[str, Any]:
        chosen = self.choices
        if chosen["shape"] == USER:
            return {"kind": "user", "file": self._file("shape_file", "signal")}
        shape = {"kind": chosen["shape"], "amplitude": chosen["amplitude"], "frequency": chosen["frequency"]}
        return shape | ({"offset": chosen["offset"]} if chosen["offset"] else {})

    def _controller(self) -> dict[str, Any]:
        chosen = self.choices
        if chosen["controller"] == USER:
            return {"file": self._file("controller_file", "controller")}
        given = {name.removeprefix("controller."): chosen[name] for name in self.parameters}
        return {"name": chosen["controller"]} | {name: value for name, value in given.items() if value is not None}

    def _file(self, name: str, what: str) -> str:
        if not self.choices[name]:
            raise InputError(f"name the file of your {what} (in {self.session.folder})")
        return str(self.choices[name])

    def _fields(self) -> Iterable[Field]:
        systems = {
            name: "Spindle" if axis.unit == _SPINDLE else f"{name} axis" for name, axis in self.machine.axes.items()
        }
        what = "voltage signal" if self.kind == "model" else "reference"
        yield Choice("system", "System", "which axis of the machine, or its spindle", next(iter(systems)), systems)
        yield Choice(
            "mode", "Mode", "what runs: a model, the real-time loop, or the machine", "simulation", MODES[self.kind]
        )
        yield Choice("shape", what.capitalize(), f"the form of the {what}", "sinusoid", SHAPES)
        yield Text(
            "shape_file",
            f"File of the {what}",
            f"a CSV file with columns of time [s] and value [{'V' if self.kind == 'model' else 'mm'}]",
            "",
            "signal.csv",
        )
        yield from self._sizes()
        yield Choice(
            "model",
            "Model",
            "what stands for the machine in simulation, and beside it",
            "default",
            {"default": "Default", USER: "User-defined"},
        )
        yield Text(
            "model_file",
            "File of the model",
            "a Python file with derivatives() or advance(), or a model file of `rds fit`",
            "",
            "my_model.py",
        )
        if self.kind == "control":
            yield Choice("controller", "Controller", "the law that answers with a voltage", "tracking", CONTROLLERS)
            yield Text(
                "controller_file", "File of the controller", "a Python file with control()", "", "my_controller.py"
            )
        yield Number("duration", "Final time", "how long it runs", 10.0, unit="s", above=0.0, high=3600.0)
        yield Number(
            "sample_period",
            "Sample period",
            "time from one sample to the next",
            self.machine.sample_period,
            unit="s",
            low=1e-4,
            high=1.0,
        )

    def _sizes(self, axis: Axis | None = None) -> Iterable[Field]:
        """Amplitude, frequency and offset, with the range and the first value that the system allows."""
        if self.kind == "model":
            unit, high, reach = "V", *([self.machine.converter.range] * 2)
        else:
            axis = axis or next(iter(self.machine.axes.values()))
            unit, (low, top) = axis.unit, axis.travel
            reach = max(abs(low), abs(top))
            high = top if unit == _SPINDLE else (top - low) / 2.0
        amplitude, frequency = _FIRST.get(unit, (1.0, 0.2))
        yield Number("amplitude", "Amplitude", "middle to peak", min(amplitude, high), unit=unit, low=0.0, high=high)
        yield Number("frequency", "Frequency", "periods per second", frequency, unit="Hz", above=0.0, high=1000.0)
        yield Number("offset", "Offset", "middle of the signal", 0.0, unit=unit, low=-reach, high=reach)

    def _chosen(self, name: str) -> None:
        if name in ("system", "controller"):
            self._fit_system()

    def _fit_system(self) -> None:
        """What the chosen system and controller allow."""
        self.choices.replace(each for each in self._sizes(self.axis) if each != self.choices.fields[each.name])
        if self.kind == "control":
            wanted = {each.name: each for each in self._parameter_fields()}
            self.choices.remove([name for name in self.parameters if name not in wanted])
            self.choices.replace(each for name, each in wanted.items() if self.choices.fields.get(name) != each)

    def _parameter_fields(self) -> Iterable[Field]:
        from rds.controllers import controller_module

        if self.choices["controller"] == USER:
            return
        options: Any = controller_module(self.choices["controller"]).OPTIONS
        if not isinstance(options, Mapping):
            return  # the tracking controller's poles have a panel of their own
        for name, option in options.items():
            meaning, _, unit = option.meaning.partition(", ")
            yield Number(
                f"controller.{name}",
                f"{name} ({meaning})",
                f"{option.meaning}; empty: tuned from the axis's data",
                None,
                unit=unit.partition(";")[0].replace("mm", self.axis.unit),
                low=option.at_least,
                above=option.more_than,
                optional=True,
            )
