"""Imports point one way, and what is heavy is imported by who needs it. Proved from the source, then by running."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import rds

ROOT = Path(rds.__file__).parent

# Which rooms each room may import, besides itself.
ALLOWED: dict[str, set[str]] = {
    "core": set(),
    "models": {"core"},
    "controllers": {"core"},
    "interpolators": {"core", "results"},  # see ONLY
    "signals": {"core"},
    "interface": {"core"},
    "machines": {"core"},
    "motion": {"core", "machines", "results"},  # see ONLY
    "nc": {"core", "machines", "motion", "results"},  # see ONLY
    "programs": {"core", "machines", "motion", "nc", "runtime", "modes", "experiment", "results", "reports"},
    "paths": {"core", "results"},  # see ONLY
    "checks": {"core"},
    "spread": {"core", "runtime"},  # see ONLY
    "bus": {"core", "machines", "models", "runtime", "results"},  # see ONLY
    "runtime": {"core", "interface", "machines"},
    "modes": {"core", "interface", "runtime", "bus"},
    "results": {"core", "runtime"},  # see ONLY
    "reports": {"core", "results", "bus"},
    "logs": {"core", "machines", "results", "bus", "motion", "spread"},  # see ONLY; files read in a process apart
    "identification": {
        *("core", "machines", "results", "models", "motion", "signals", "logs"),
        *("controllers", "checks"),  # what a model file is for: a design, a check
    },
    "validation": {"core", "results", "models", "logs", "identification"},
    "experiment": {
        *("core", "controllers", "models", "signals", "machines", "runtime", "modes", "results", "bus"),
        *("logs", "identification", "validation"),  # model files, and what a validation proves
    },
    "grading": {
        *("core", "checks", "interface", "models", "controllers", "interpolators", "signals", "machines", "runtime"),
        *("modes", "motion", "nc", "paths", "programs", "results", "reports", "experiment", "identification"),
        *("logs", "validation"),
        *("robustness", "spread"),
    },
    "robustness": {
        *("core", "models", "controllers", "runtime", "modes", "results", "experiment", "identification", "spread"),
    },
}
# Of some rooms, only these modules.
ONLY = {
    ("bus", "models"): {"rds.models.machine_axis"},  # the machine's own axis, behind the bus
    ("bus", "runtime"): {"rds.runtime.scheduling"},  # hub and machine are on time as well
    # what a [bus] table may say
    ("experiment", "bus"): {"rds.bus.bus_settings", "rds.bus.dialects", "rds.bus.fault_file"},
    ("interpolators", "results"): {"rds.results", "rds.results.figure"},  # their tables and pictures
    ("nc", "results"): {"rds.results.atomic", "rds.results.figure"},  # compiled programs, pictures
    ("paths", "results"): {"rds.results.figure"},  # pictures
    ("bus", "results"): {"rds.results"},  # what modules record on board comes up as a result
    ("reports", "bus"): {"rds.bus.frames", "rds.bus.logs"},  # which frames are commands and answers; their logs
    # what a log holds
    ("logs", "bus"): {"rds.bus", "rds.bus.frames", "rds.bus.decode", "rds.bus.logs", "rds.bus.mf4_later"},
    ("identification", "controllers"): {"rds.controllers.tracking", "rds.controllers.design"},
    ("motion", "results"): {"rds.results.figure"},  # what all plots share
    ("spread", "runtime"): {"rds.runtime.scheduling"},  # a worker ends with who started it
    ("results", "runtime"): {"rds.runtime.record"},  # a killed run reopens from its record
}
LAZY = [("results", "runtime"), ("motion", "results"), ("modes", "bus")]  # inside functions only
TOP = {"__main__", "cli", "commands", "console"}


def imports(path: Path) -> list[tuple[str, bool]]:
    """The modules of rds that a file imports, and whether at its top."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    inside = {
        id(node)
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef)
        for node in ast.walk(function)
    }
    found = []
    for node in ast.walk(tree):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            module = node.module or ""
            names = [f"{module}.{alias.name}" for alias in node.names] if module in ("rds", *_packages()) else [module]
        found += [(name, id(node) not in inside) for name in names if name.partition(".")[0] == "rds"]
    return found


def _packages() -> list[str]:
    return [f"rds.{room}" for room in ALLOWED]


FILES = {room: sorted((ROOT / room).rglob("*.py")) for room in ALLOWED}


@pytest.mark.parametrize("room", ALLOWED)
def test_imports_point_one_way(room: str) -> None:
    for path in FILES[room]:
        for module, at_top in imports(path):
            other = module.split(".")[1] if "." in module else ""
            if other == room:
                continue
            place = f"{path.relative_to(ROOT.parent)} imports {module}"
            assert other in ALLOWED[room], place
            only = ONLY.get((room, other))
            assert only is None or module.removesuffix(".Result") in only, place
            assert not (at_top and (room, other) in LAZY), f"{place} at its top"


def test_nothing_imports_what_is_on_top() -> None:
    for path in ROOT.rglob("*.py"):
        if {path.stem, path.relative_to(ROOT).parts[0]} & {*TOP, "panels"}:
            continue
        for module, _ in imports(path):
            assert not {*TOP, "panels"} & set(module.split(".")[1:2]), f"{path} imports {module}"


def test_the_rooms_with_rules_exist() -> None:
    assert set(ALLOWED) <= {path.parent.name for path in ROOT.glob("*/__init__.py")}


HEAVY = (
    "can",
    "ipywidgets",
    "pandas",
    "scipy",
    "control",
    "matplotlib",
    "numba",
    "pyarrow",
    "IPython",
    "rich",
    "typer",
    "skimage",
    "shapely",
    "PIL",
)


def loaded(code: str, folder: Path | None = None) -> set[str]:
    """The modules that are loaded in a fresh interpreter after `code`."""
    program = f"{code}\nimport sys, json; print(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=folder)
    return set(json.loads(done.stdout.splitlines()[-1]))


def test_importing_rds_is_light() -> None:
    new = loaded("import rds") - loaded("")
    assert {name for name in new if name.startswith("rds")} == {"rds"}
    assert len(new) < 25, sorted(new)


def test_the_recorder_of_a_run_does_without_numpy() -> None:
    """It is a process more of every real-time run, and starts the target."""
    assert not {*HEAVY, "numpy"} & loaded("import rds.runtime.recorder")


@pytest.mark.parametrize(
    "code",
    [
        "import rds.core.types, rds.core.contracts, rds.core.errors, rds.core.clock, rds.core.registry",
        "import rds.core.options, rds.core.load, rds.core.adapt, rds.core.integrate",
        "import rds.models, rds.models.linear_axis, rds.models.ode, rds.models.student",
        "import rds.controllers, rds.controllers.tracking, rds.controllers.pid",
        "import rds.interface, rds.machines, rds.signals, rds.checks, rds.runtime.loop, rds.runtime.timing",
        "import rds; rds.Experiment; rds.Result; rds.sinusoid; rds.open_result",
        "from rds.paths import arc, line, outline, part_program, path_of_points, picture, read_points, spiral_cone",
    ],
)
def test_nothing_heavy_is_imported(code: str) -> None:
    assert not set(HEAVY) & loaded(code)


def test_a_simulation_of_a_student_s_file_imports_nothing_heavy(tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text(
        "def control(t, r, y, state, params):\n    return 10.0 * (r.position - y), state\n"
    )
    (tmp_path / "e.toml").write_text(
        'axis = "X"\nduration = 0.1\n[reference]\nkind = "sinusoid"\namplitude = 1.0\nfrequency = 1.0\n'
        '[controller]\nfile = "law.py"\n'
    )
    code = "import rds\nresult = rds.Experiment.from_toml('e.toml').run()\nassert len(result) == 100\nresult.metrics"
    assert not set(HEAVY) & loaded(code, tmp_path)


def test_the_words_of_the_core_need_not_even_numpy() -> None:
    assert "numpy" not in loaded("import rds.core.types, rds.core.contracts, rds.core.errors, rds.core.clock")
