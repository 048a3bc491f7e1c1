"""The tables of an assignment's file: what each key means, its unit, its range, its default."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from math import inf

from rds.core.quantities import AnyValue, Choice, Declaration, Flag, Items, Parts, Quantity, Table, Tables, Text
from rds.core.shared_quantities import FEED_RATE
from rds.grading.criteria import KINDS
from rds.grading.sandbox.limits import Limits
from rds.modes.experiment.experiment_file import EXPERIMENT, SIGNAL

READERS: Mapping[str, str] = {
    "controller": "rds.grading.cases.control",
    "model": "rds.grading.cases.model",
    "interpolator": "rds.grading.cases.segment",
    "functions": "",
}
SELF_CHECKS = ("visible", "blind", "off")
FEEDBACKS = ("visible", "all")
MOST_RUNS = 1000
_POSITION = Items("one position for each axis, mm", Quantity("position", "mm"), "a list of positions", least=1)
_POINTS = Quantity("points", "", 0.0, 1e9, default=0.0)


def _criterion(kind: str) -> Table:
    module = KINDS.module(kind)
    return Table(module.MEANING, getattr(module, "OPTIONS", {}))


_TEST = Table(
    "a test of a function",
    {
        "function": Text("its name"),
        "args": AnyValue("list of its arguments"),
        "expected": AnyValue("what it must return"),
        "tolerance": Quantity("how far numbers may be off, in the unit of the answer", "", 0.0, 1e300, default=0.0),
    },
    needed=("function", "expected"),
)
_CRITERION: Mapping[str, Declaration] = {
    "name": Text("name of the criterion"),
    "title": Text("heading; by default the name"),
    "case": Text("the case in which it is measured"),
    "cases": Items(
        "the cases in which it is measured", Text("name of a case"), "a list of the names of cases", least=1
    ),
    "points": Quantity("what it earns at most", "points", 0.0, 1e6),
    "weight": Quantity("factor of the points", "", 0.0, 1e6, default=1.0),
    "unit": Text("unit of full and none"),
    "full": Quantity("value that earns all points"),
    "none": Quantity("value that earns none"),
    "partial": AnyValue(
        'points between full and none: "linear", or a share of the points',
        (Choice("in proportion", ("linear",)), Quantity("share of the points", "", 0.0, 1.0)),
    ),
    "visible": Flag("students see it", True),
    "requires": AnyValue(
        "criteria that must have earned points", (Text("name"), Items("names", Text("name"), "names"))
    ),
    "test": Tables("tests of functions", _TEST),
}
CRITERION = Table(
    "a criterion",
    {"kind": Choice("what is measured", KINDS.names), **_CRITERION},
    needed=("name", "kind", "points", "full", "none"),
    chosen_by="kind",
    parts=Parts(KINDS.names, _criterion),
)
_CASE = Table(
    "a case: a run of the submission",
    {
        **EXPERIMENT.keys,
        "name": Text("name of the case"),
        "title": Text("heading; by default the name"),
        "runs": Quantity("plants that are drawn for each student", "", 1, MOST_RUNS, default=1, whole=True),
        "visible": Flag("students see it", True),
        "coupled": Flag("one law for all axes", False),
        "noise": Quantity("standard deviation of the measured value, in the axis's unit", "", 0.0, 1e9, default=0.0),
        "plant": Choice("what stands for the machine", ("model", "machine"), "model"),
        "params": Table("values over those of the submission's own `params`", others=AnyValue("parameter")),
        "vary": Table(
            "ranges from which each student's plant is drawn",
            others=AnyValue('range: "±10 %", "±0.001", or [lowest, highest]'),
        ),
        "disturbance": Table(
            "voltage beside the controller's",
            {
                "start": Quantity("when it begins", "s", 0.0, default=0.0, infinite=True),
                "end": Quantity("when it ends; by default with the run", "s", 0.0, default=inf, infinite=True),
            },
            chosen_by="kind",
            parts=SIGNAL.parts,
        ),
        "program": Text("file of a part program"),
        "log": Text("file of logged data"),
        "map": Text("map of the logged data"),
        "segment": Table(
            "what is interpolated",
            {
                "kind": Choice("form of the segment", ("line", "arc"), "line"),
                "start": _POSITION,
                "end": _POSITION,
                "centre": _POSITION,
                "feed_rate": FEED_RATE,
                "clockwise": Flag("which way round an arc goes", False),
                "plane": AnyValue("two axes by index", default=[0, 1]),
            },
            needed=("start", "end", "feed_rate"),
        ),
    },
    needed=("name",),
)
LATE = Table(
    "what is lost by handing in late",
    {
        "percent_per_day": Quantity("lost for each day", "% of the points", 0.0, 100.0, default=0.0),
        "grace_hours": Quantity("delay that costs nothing", "h", 0.0, 1e4, default=0.0),
        "cap_percent": Quantity("most that is lost", "% of the points", 0.0, 100.0, default=100.0),
        "zero_after_days": Quantity("delay after which nothing is left", "days", 0.0, default=inf, infinite=True),
        "free_days": Quantity("late days that a student may spend here", "days", 0, 366, default=0, whole=True),
    },
)


def _limit(name: str, default: float) -> Quantity:
    meaning = f"limit of the sandbox: {name.replace('_', ' ')}"
    if isinstance(default, int):
        return Quantity(meaning, "", 1, 1 << 40, default=default, whole=True)
    return Quantity(meaning, "s", 0.01, 86_400.0, default=default)


ASSIGNMENT = Table(
    "An assignment: what students hand in, the cases that it is run in, the criteria that it is graded by.",
    {
        "title": Text("heading; by default the folder's name"),
        "kind": Choice("what students hand in", tuple(READERS)),
        "machine": Text("a machine of the package, or a file in the assignment's folder", "mini-cnc"),
        "files": AnyValue("names that the file may have", (Text("name"), Items("names", Text("name"), "names"))),
        "due": AnyValue("when it is due: date, time and time zone"),
        "secret": Text("8 characters or more that students do not know: their plants are drawn from it"),
        "solution": Text("file of the solution"),
        "template": Text("file of the template"),
        "handout": Text("file that is handed out"),
        "self_check": Choice("what students can check themselves", SELF_CHECKS, "visible"),
        "feedback": Choice("what a feedback page shows", FEEDBACKS, "visible"),
        "limits": Table("limits of the sandbox", {f.name: _limit(f.name, f.default) for f in fields(Limits)}),  # type: ignore[arg-type]
        "late": LATE,
        "hidden": Table(
            "what a hand-out leaves out",
            {"criteria": Quantity("hidden criteria", "", 0, 10**9, default=0, whole=True), "points": _POINTS},
        ),
        "case": Tables("cases", _CASE),
        "criterion": Tables("criteria", CRITERION, least=1),
    },
    needed=("kind", "secret", "criterion"),
)
