"""Logged data in a sitting: describe a file, fit a model to it, validate the model on another file."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rds.core.errors import InputError
from rds.identification.fit.fit import METHODS
from rds.identification.logs.tables import endings
from rds.identification.structures import SIMULATION_ERROR
from rds.panels.session.choices import Choices
from rds.panels.session.fields import Choice, Field, Several, Text, labels
from rds.panels.session.session import Session
from rds.panels.session.task import Task

if TYPE_CHECKING:
    from rds.identification.fit.estimate import Estimate
    from rds.identification.logs.describe import Description
    from rds.identification.logs.log import Log
    from rds.identification.validate.validate import Validation

STRUCTURES = {
    "axis": "Axis (τ, K, friction)",
    "axis-mass": "Axis in mass form (M, F_v, F_c)",
    "axis-inertia": "Axis that turns, in inertia form (J, B, T_c)",
    "spindle": "Spindle (first order)",
    "user": "Own file",
}
_METHODS = {"step": "Step response", "frequency": "Frequency response"}
OPTIONS = {
    "viscous": "viscous friction",
    "stribeck": "Stribeck friction",
    "offset": "offset",
    "dead-zone": "dead zone",
    "delay": "delay",
    "backlash": "backlash",
}
LISTED = 200  # runs, the latest; others are named by hand


@dataclass
class DataState:
    """What is chosen, and what was found last. Each step is a Task; its result is kept here when it is over."""

    session: Session

    def __post_init__(self) -> None:
        self.choices: Choices = self.session.choices("data", _fields())
        self.description: Description | None = None
        self.estimate: Estimate | None = None
        self.validation: Validation | None = None
        self.fitted: tuple[Log, ...] = ()
        self._unwritten: str | None = None  # the model file that was named when the last fit ended, until it is written

    def files(self) -> list[str]:
        """Files of the folder that may hold logged data, and its latest runs, by their way from the folder."""
        folder = self.session.folder
        found = [path for path in _entries(folder) if path.suffix.lower() in endings() and _may_be_log(path)]
        runs = [run.folder for run in self.session.runs(LISTED)]
        return [str(path.relative_to(folder)) for path in [*found, *runs]]

    def path(self, name: str, what: str) -> Path:
        """A file that was named; InputError if none was."""
        if not name:
            raise InputError(f"name {what} (in {self.session.folder})")
        return self.session.folder / name

    def describe(self) -> Task[Description]:
        """Read the chosen file and say what it holds."""
        path, mapping = self.path(self.choices["file"], "a file with logged data"), self._map()

        def work(task: Task[Description]) -> Description:
            from rds.identification.logs.describe import describe

            self.description = describe(path, mapping, lambda done, of: task.advance(done, of, "reading"))
            return self.description

        return self.session.work(f"describe {path.name}", work, own_code=True)

    def map_text(self) -> str:
        """The map beside the chosen file, which may be wrong; empty where there is none, or another one is named."""
        from rds.identification.logs.guess import map_path

        if not self.choices["file"] or self.choices["map"]:
            return ""
        try:
            return map_path(self.session.folder / self.choices["file"]).read_text(encoding="utf-8", errors="replace")
        except OSError:
            return ""

    def keep_map(self, text: str) -> Path:
        """Write `text` as the map beside the chosen file, after it was tried; InputError says what is wrong in it."""
        from rds.core.atomic import write_whole
        from rds.identification.logs.guess import map_path
        from rds.identification.logs.map import LogMap

        path = map_path(self.path(self.choices["file"], "a file with logged data"))
        before = path.read_bytes() if path.exists() else None
        write_whole(path, text.encode())
        try:
            LogMap.read(path)
        except InputError:
            if before is None:
                path.unlink()
            else:
                write_whole(path, before)
            raise
        return path

    def fit(self) -> Task[Estimate]:
        """Estimate the chosen structure's parameters from the chosen file."""
        path, mapping = self.path(self.choices["file"], "a file with logged data"), self._map()
        name = self.choices["structure"]
        if name == "user":
            name = str(self.path(self.choices["structure_file"], "the file of your model"))
        method, options = self.choices["method"] or None, tuple(self.choices["options"])

        def work(task: Task[Estimate]) -> Estimate:
            from rds.identification.fit.fit import fit
            from rds.identification.fit.missing_options import with_hint
            from rds.identification.logs.read_log import read_log
            from rds.identification.structures.structures import structure

            made = structure(name, options)
            task.note = "reading"
            logs = read_log(path, mapping)
            given: dict[str, Any] = {}
            if (method or made.default_method) == SIMULATION_ERROR:
                given["progress"] = lambda done, of: task.advance(done, of, "fitting")
            task.note = "fitting"
            self.estimate = with_hint(fit(logs, made, method, given), logs)
            self.fitted = tuple(logs)
            self._unwritten = str(self.choices["model"])
            return self.estimate

        return self.session.work(f"fit {path.name}", work, own_code=True)

    def write_model(self) -> Path:
        """Write the last estimate as a model file; InputError if there is none, or the file is another thing."""
        from rds.identification.fit.model_file import write_model

        if self.estimate is None:
            raise InputError("there is no estimate yet: fit first")
        path = self.path(self.choices["model"], "the model file to write")
        if path.suffix != ".toml":
            raise InputError("a model file is TOML; give it a name that ends in .toml", str(path))
        written = write_model(path, self.estimate)
        self._unwritten = None
        return written

    def model_to_use(self) -> Path:
        """The model file that is named; written first if it is not there. InputError if it is not of the last fit."""
        path = self.path(self.choices["model"], "the model file")
        self._refuse_another(path)
        return path if path.exists() else self.write_model()

    def _refuse_another(self, path: Path) -> None:
        if self._unwritten == self.choices["model"] and path.exists():
            raise InputError(
                f"{path.name} is from before the last fit; Save model writes the new one over it, "
                "or name another file to keep both"
            )

    def validate(self) -> Task[Validation]:
        """Validate the model file (or the last estimate, where none is named) on the chosen validation log."""
        path = self.path(self.choices["validation_file"], "a file with other data than those of the fit")
        model: Any = self.session.folder / self.choices["model"] if self.choices["model"] else self.estimate
        if isinstance(model, Path):
            self._refuse_another(model)
        if model is None or (isinstance(model, Path) and not model.exists()):
            if self.estimate is None:
                raise InputError("there is no model: fit one, or name a model file that exists")
            model = self.estimate
        mapping = self._map() if path == self.session.folder / self.choices["file"] else None

        def work(task: Task[Validation]) -> Validation:
            from rds.identification.logs.read_log import read_log
            from rds.identification.validate.validate import validate

            task.note = "reading"
            logs = read_log(path, mapping)
            task.note = "validating"
            self.validation = validate(model, logs)
            return self.validation

        return self.session.work(f"validate on {path.name}", work, own_code=True)

    def _map(self) -> Path | None:
        name = self.choices["map"]
        return self.session.folder / name if name else None


def _fields() -> Iterable[Field]:
    yield Text(
        "file", "File with logged data", "CSV, MAT, Parquet, a bus log, or the folder of a run", "", "e.g. log.csv"
    )
    yield Text("map", "Map of its columns", "TOML file; empty: FILE.map.toml beside it, or guessed", "", "by itself")
    yield Choice("structure", "Structure", "which model is fitted", "axis", STRUCTURES)
    yield Text("structure_file", "Own file", "a Python file with derivatives() and params", "", "e.g. my_model.py")
    yield Several("options", "With", "what else the structure has (axis only)", [], OPTIONS, least=0)
    yield Choice(
        "method", "Method", "how it is fitted", "", {"": "The structure's own"} | labels(METHODS.names(), _METHODS)
    )
    yield Text(
        "model", "Model file", "the fitted model is written here; every mode takes it", "fitted.toml", "fitted.toml"
    )
    yield Text("validation_file", "Validate on", "a file with other data than those of the fit", "", "e.g. other.csv")


def _may_be_log(path: Path) -> bool:
    """Whether it is a file, and not what a run has made of a part program."""
    from rds.nc.compiled_file import is_ours

    try:
        return path.is_file() and (path.suffix.lower() != ".dat" or not is_ours(path))
    except OSError:
        return False


def _entries(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError:
        return []
