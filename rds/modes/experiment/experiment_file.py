"""The tables of an experiment's file: what each key means, its unit, its range and what holds where it is not given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rds.bus.hub.bus_settings import BITRATE, DATA_BITRATE, RESTART
from rds.bus.modules.dialects import DEFAULT, dialect_names
from rds.controllers import controller_module, controller_names
from rds.core.integrate import SUBSTEPS
from rds.core.quantities import AnyValue, Choice, Declaration, Flag, Items, Parts, Quantity, Table, Text
from rds.core.registry import Registry
from rds.core.shared_quantities import DURATION, SAMPLE_PERIOD
from rds.models import model_module, model_names
from rds.modes import mode_names
from rds.modes.experiment.compensation import COMPENSATION
from rds.modes.loop.following_error import FOLLOWING_ERROR
from rds.network.network_file import NETWORK
from rds.references import signal_kinds, signal_options

AXIS_KEYS = ("reference", "signal", "controller", "model", "error_compensation", "following_error")
PATHS = Registry("reference", {"path": "rds.nc.run.path"})
"""Kinds of references that drive all axes of a run together. Each module gives `WORDS` (the table's keys),
`program(words, folder, machine, axes, T)`, `judged_path(result, program, T)`, and
`save_path_run(result, program, folder, title)`."""


def _controller(name: str) -> Table:
    return Table(f"controller {name}", controller_module(name).OPTIONS)


def _model(name: str) -> Table:
    return Table(f"model {name}", model_module(name).PARAMETERS)


_PARAMS = Table("values over those of the file's own `params`", others=AnyValue("parameter of the file"))
SIGNAL = Table("how the value changes over time", chosen_by="kind", parts=Parts(signal_kinds, signal_options))


def is_path(reference: Any) -> bool:
    """Whether a reference, as it was given, is one that all axes of the run follow together."""
    kind = reference.get("kind") if isinstance(reference, Mapping) else None
    return isinstance(kind, str) and kind in PATHS.modules


REFERENCE = Table(
    "what the axis is to follow; kind = path: what all axes of the run follow together",
    chosen_by="kind",
    parts=Parts(
        lambda: [*signal_kinds(), *PATHS.names()],
        lambda kind: PATHS.module(kind).WORDS if kind in PATHS.modules else signal_options(kind),
    ),
)
_CONTROLLER = Table(
    "a law of the library by name, or a student's file",
    {
        "file": Text("path of the .py file"),
        "params": _PARAMS,
        "coupled": Flag("one law for all axes of the run: reference, position and voltage are arrays", False),
    },
    needed=("file",),
    alone=True,
    chosen_by="name",
    parts=Parts(controller_names, _controller),
)
_MODEL = Table(
    "a model of the library by name, or a student's file, or a model file of `rds fit`",
    {
        "file": Text("path of the .py or .toml file"),
        "params": _PARAMS,
        "substeps": Quantity(
            "steps of Runge-Kutta's fourth-order method in each sample, for `derivatives`",
            *("", 1, 10_000),
            default=SUBSTEPS,
            whole=True,
        ),
    },
    needed=("file",),
    alone=True,
    chosen_by="name",
    parts=Parts(model_names, _model),
)
_NAME_OR_FILE = Text("name of the library, or path of a file")
_OF_AN_AXIS: Mapping[str, Declaration] = {
    "reference": AnyValue("what the axis is to follow, in its unit", (REFERENCE,)),
    "signal": AnyValue("voltage that drives the axis without a controller, V", (SIGNAL,)),
    "controller": AnyValue("the law that answers with a voltage", (_CONTROLLER, _NAME_OR_FILE)),
    "error_compensation": COMPENSATION,
    "following_error": FOLLOWING_ERROR,
    "model": AnyValue("what stands for the axis in simulation; by default the machine's own", (_MODEL, _NAME_OR_FILE)),
}
INTERFACE = Table(
    "the computer-system interface: what stands between the controller and the machine",
    {
        "saturation": Flag("the command voltage is limited to the converter's range", True),
        "quantization": Flag("the voltage takes the converter's levels, the position is whole encoder counts", True),
    },
)
TIMING = Table(
    "for the modes that run in real time",
    {
        "late": Choice("what happens to periods that passed while a sample was late", ("process", "discard")),
        "phase": Choice("what the due times follow after a late sample", ("keep", "ignore")),
        "stop_after": Quantity("late samples in a row that end the run; 0: never", "", 0, 10**9, whole=True),
        "late_limit": Quantity("late samples that the verdict allows", "", 0, 10**9, default=0, whole=True),
        "priority": Quantity("of SCHED_FIFO", "", 1, 99, default=80, whole=True),
        "cpu": Quantity("number of the processor to run on", "", 0, 4095, whole=True),
    },
)
BUS = Table(
    "keyword arguments of python-can's can.Bus; which there are depends on the interface",
    {
        "interface": Text("interface of python-can; rds is the built-in bus", "rds"),
        "channel": AnyValue("name or number of the channel"),
        "dialect": Choice("what the modules speak", dialect_names, DEFAULT),
        "bitrate": BITRATE,
        "data_bitrate": DATA_BITRATE,
        "restart_ms": RESTART,
        "faults": Text("on the built-in bus: a TOML file of faults to inject while the run goes on"),
        "cia402": AnyValue("the drives of dialect cia402", (Table("drives", others=AnyValue("setting of a drive")),)),
    },
    others=AnyValue("option of the interface"),
)
EXPERIMENT = Table(
    "An experiment: which axes of which machine, driven by what, in which mode.",
    {
        "title": Text("heading of the report; by default the file's name"),
        "machine": Text("a machine of the package, or the path of a machine file that ends in .toml", "mini-cnc"),
        "axis": AnyValue(
            "the axis that runs, or tables of single axes",
            (Text("name of the axis"), Table("tables of single axes", others=Table("of one axis", _OF_AN_AXIS))),
        ),
        "axes": Items("several axes in one loop, in place of axis", Text("name of an axis"), "axis names", least=1),
        "mode": Choice("mode of the run", mode_names, "simulation"),
        "duration": DURATION,
        "sample_period": SAMPLE_PERIOD,
        "compiled": Flag("simulate with numba where it can be", False),
        **_OF_AN_AXIS,
        "interface": INTERFACE,
        "timing": TIMING,
        "bus": BUS,
        "network": NETWORK,
    },
)
