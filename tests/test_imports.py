"""Imports point one way, and what is heavy is imported by who needs it. Proved from the source, then by running."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import NamedTuple

import pytest

import rds
from rds.core import extras

ROOT = Path(rds.__file__).parent

# Which rooms each room may import, besides itself. Four folders are floors of their own: they stand above what else is
# in their room.
ALLOWED: dict[str, set[str]] = {
    "core": set(),
    "models": {"core"},
    "controllers": {"core"},
    "references": {"core"},
    "checks": {"core"},
    "machines": {"core"},
    "results": {"core", "modes"},  # see ONLY
    "interpolators": {"core", "machines", "results"},  # see ONLY
    "nc": {"core", "interpolators", "machines"},
    "bus": {"core", "machines", "models", "results", "network"},  # see ONLY
    "network": {"core"},
    "modes": {"core", "machines", "models", "bus", "network"},
    "results.reports": {"core", "results", "bus"},  # see ONLY
    "network.loops": {
        *("core", "network", "controllers", "models", "machines", "modes", "modes.experiment", "results", "bus"),
    },
    "identification": {
        *("core", "machines", "models", "references", "results", "bus"),  # see ONLY
        *("controllers", "checks", "modes"),  # what a model file is for: a design, a check
    },
    "modes.experiment": {
        *("core", "controllers", "models", "references", "machines", "modes", "results", "bus"),  # see ONLY
        *("network", "identification"),  # model files, and what a validation proves
    },
    "identification.robustness": {
        *("core", "controllers", "models", "machines", "results", "identification", "modes", "modes.experiment"),
    },
    "nc.run": {
        "bus",  # see ONLY
        *("core", "machines", "interpolators", "nc", "modes", "modes.experiment", "results", "results.reports"),
    },
    "jobs": {
        *("core", "machines", "bus", "modes", "modes.experiment", "nc.run"),  # see ONLY
    },
    "grading": {
        *("core", "checks", "models", "controllers", "references", "interpolators", "machines", "nc", "nc.run"),
        *("modes", "modes.experiment", "results", "results.reports"),
        *("identification", "identification.robustness"),
    },
}
# Of some rooms, only these modules.
ONLY = {
    # the machine's own axes behind the bus, and the profile by which a drive moves one
    ("bus", "models"): {"rds.models.machine_axis", "rds.models.stepper_axis", "rds.models.profile_drive"},
    # what a [bus] table may say; and what the modules that are there offer after an exchange
    ("modes.experiment", "bus"): {
        *("rds.bus.hub.bus_settings", "rds.bus.modules.dialects", "rds.bus.medium.fault_file"),
        *("rds.bus.modules.oacs.events", "rds.bus.modules.oacs.offers", "rds.bus.tools.link"),
    },
    ("bus", "network"): {"rds.network.clocks"},  # hosts keep the clocks of nodes together
    # methods A, B and C are those of nodes on a serial line and on CAN; distributed modules move by themselves
    ("nc.run", "bus"): {
        *(f"rds.bus.modules.dcs.{name}" for name in ("buffers", "build", "commands", "host", "methods", "port")),
        *("rds.bus.modules.segments", "rds.bus.modules.server_process", "rds.bus.hub.bus_settings"),
        "rds.bus.hub.command",  # no other run moves the axes meanwhile
        *("rds.bus.modules.dcs", "rds.bus.modules.motion_course", "rds.bus.modules.drift", "rds.bus.tools.link"),
        *(
            f"rds.bus.modules.rds.{name}"
            for name in ("frames", "module", "motion_frames", "motion_host", "motion_port")
        ),
        *("rds.bus.modules.rds", "rds.bus.medium.bits"),
        *(
            f"rds.bus.modules.oacs.{name}"
            for name in ("codes", "messages", "module", "module_data", "pid", "module_group")
        ),
    },
    ("jobs", "bus"): {"rds.bus.hub.runtime_folder"},  # where the user's sockets are
    ("interpolators", "results"): {"rds.results"},  # their tables
    ("bus", "results"): {"rds.results"},  # what modules record on board comes up as a result
    # which frames are commands and answers; their logs
    ("results.reports", "bus"): {"rds.bus.modules.rds.frames", "rds.bus.tools.logs", "rds.bus.tools.log_formats"},
    # what a log holds
    ("identification", "bus"): {
        *("rds.bus.modules.rds.frames", "rds.bus.tools.decode", "rds.bus.tools.logs", "rds.bus.tools.mf4"),
        "rds.bus.tools.log_formats",
    },
    ("identification", "controllers"): {
        *("rds.controllers.tracking", "rds.controllers.design"),
        # the law of a run of one's own, which closes the loop around the model that is judged
        *("rds.controllers.controller_module", "rds.controllers.library_controller"),
    },
    # a killed run reopens from its record; how a mode's response is drawn
    ("results", "modes"): {"rds.modes", "rds.modes.process.record"},
    # what the mode of a result says of its data; how a run of it begins
    ("identification", "modes"): {"rds.modes", "rds.modes.loop.mode", "rds.modes.parts.start"},
}
# inside functions only
LAZY = [("results", "modes"), ("modes", "bus"), ("results.reports", "bus")]
TOP = {"__main__", "cli", "panels"}


class Imported(NamedTuple):
    """An import statement, and where it stands."""

    node: ast.Import | ast.ImportFrom
    in_function: bool
    for_types: bool  # in the body of `if TYPE_CHECKING`
    at_head: bool  # in nothing, not even a condition


@cache
def _statements(path: Path) -> list[Imported]:
    """All imports of a file. Only statements hold statements: expressions, which are most of a file, are not walked."""
    found = []
    tree = ast.parse(path.read_text(encoding="utf-8"))
    todo: list[tuple[ast.AST, bool, bool]] = [(tree, False, False)]
    heads = {id(node) for node in tree.body}
    while todo:
        node, inside, typed = todo.pop()
        if isinstance(node, ast.Import | ast.ImportFrom):
            found.append(Imported(node, inside, typed, id(node) in heads))
        inside = inside or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        checks = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        for name in ("body", "orelse", "finalbody", "handlers", "cases"):
            part = getattr(node, name, ())
            if isinstance(part, list):  # that of a lambda is an expression
                todo += [(inner, inside, typed or (checks and name == "body")) for inner in part]
    return found


def imports(path: Path) -> list[tuple[str, bool]]:
    """The modules of rds that a file imports, and whether at its top."""
    found = []
    for node, in_function, *_ in _statements(path):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            assert node.level == 0, f"{path}: relative import"
            module = node.module or ""
            names = [f"{module}.{alias.name}" for alias in node.names] if module in _packages() else [module]
        found += [(name, not in_function) for name in names if name.partition(".")[0] == "rds"]
    return found


def imported_when_running(path: Path) -> set[str]:
    """The files of rds that a file imports, also inside functions, but not for type checking alone."""
    names = []
    for node, _, for_types, _ in _statements(path):
        if for_types:
            continue
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        else:
            inner = [f"{node.module}.{alias.name}" for alias in node.names]
            names += [name if name in MODULES else str(node.module) for name in inner]
    return {name for name in names if MODULES.get(name, path) != path}


@cache
def _packages() -> set[str]:
    return {".".join(path.parent.relative_to(ROOT.parent).parts) for path in ROOT.rglob("__init__.py")}


def room_of(module: str) -> str:
    """The room, or the floor of one, that a module stands in: "nc.run" for rds.nc.run.judge, "" for rds itself."""
    names = module.split(".")[1:3]
    return ".".join(names) if ".".join(names) in ALLOWED else names[0] if names else ""


def _module(path: Path) -> str:
    return ".".join(path.relative_to(ROOT.parent).with_suffix("").parts).removesuffix(".__init__")


# but for the script that makes the logs of the package: it runs experiments as a user does
SOURCES = sorted(path for path in ROOT.rglob("*.py") if _module(path) != "rds.identification.data.make")
MODULES = {_module(path): path for path in SOURCES}
FILES = {room: [path for module, path in MODULES.items() if room_of(module) == room] for room in ALLOWED}


@pytest.mark.parametrize("room", ALLOWED)
def test_imports_point_one_way(room: str) -> None:
    for path in FILES[room]:
        for module, at_top in imports(path):
            other = room_of(module)
            if other == room:
                continue
            place = f"{path.relative_to(ROOT.parent)} imports {module}"
            assert other in ALLOWED[room], place
            only = ONLY.get((room, other))
            assert only is None or any(module == name or module.startswith(f"{name}.") for name in only), place
            assert not (at_top and (room, other) in LAZY), f"{place} at its top"


def test_the_rules_themselves_point_one_way() -> None:
    """But for what is imported inside functions alone."""
    graph = {room: {other for other in others if (room, other) not in LAZY} for room, others in ALLOWED.items()}
    tuple(TopologicalSorter(graph).static_order())


def test_no_files_import_each_other_in_a_circle() -> None:
    """Imports inside functions count: who reads one file of a circle has to read them all."""
    graph = {module: imported_when_running(path) for module, path in MODULES.items()}
    try:
        tuple(TopologicalSorter(graph).static_order())
    except CycleError as error:
        circle = " <- ".join(error.args[1])
        pytest.fail(f"these files import each other in a circle: {circle}; move what two of them share to a third file")


@pytest.mark.parametrize(
    ("line", "counts"),
    [
        ("from rds.core.errors import InputError", True),
        ("import rds.core.errors", True),
        ("from rds.core import errors", True),
        ("def f():\n    from rds.core.errors import InputError", True),
        ("if TYPE_CHECKING:\n    from rds.core.errors import InputError", False),
        ("if TYPE_CHECKING:\n    pass\nelse:\n    from rds.core.errors import InputError", True),
    ],
)
def test_the_imports_that_count_for_circles(tmp_path: Path, line: str, counts: bool) -> None:
    (tmp_path / "a.py").write_text(line)
    assert imported_when_running(tmp_path / "a.py") == ({"rds.core.errors"} if counts else set())


def test_nothing_imports_what_is_on_top() -> None:
    for path in ROOT.rglob("*.py"):
        if {path.stem, path.relative_to(ROOT).parts[0]} & TOP:
            continue
        for module, _ in imports(path):
            assert not TOP & set(module.split(".")[1:2]), f"{path} imports {module}"
    for path in (ROOT / "panels").rglob("*.py"):
        for module, _ in imports(path):
            assert not module.startswith("rds.cli"), f"{path} imports {module}"


def test_every_room_has_rules() -> None:
    assert {path.parent.name for path in ROOT.glob("*/__init__.py")} == {*ALLOWED, "cli", "panels"} - {
        name for name in ALLOWED if "." in name
    }


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
    assert not {*HEAVY, "numpy"} & loaded("import rds.modes.process.recorder")


@pytest.mark.parametrize(
    "code",
    [
        "import rds.core.types, rds.core.contracts, rds.core.errors, rds.core.clock, rds.core.registry",
        "import rds.core.options, rds.core.load, rds.core.adapt, rds.core.integrate",
        "import rds.models, rds.models.linear_axis, rds.models.ode, rds.models.student",
        "import rds.controllers, rds.controllers.tracking, rds.controllers.pid",
        "import rds.machines, rds.references, rds.checks, rds.modes.loop.loop, rds.modes.process.timing",
        "import rds; rds.Experiment; rds.Result; rds.sinusoid; rds.open_result",
        "from rds.nc.paths import arc, line, outline, part_program, path_of_points, picture, read_points, spiral_cone",
    ],
)
def test_nothing_heavy_is_imported(code: str) -> None:
    assert not set(HEAVY) & loaded(code)


def test_what_an_installation_may_lack_is_imported_late() -> None:
    """At the head of a file it would end commands that do without it, with a traceback."""
    may = {"numba": "nc/language/fast_lane_", "distributed": "core/parallel/remote.py", "pylti1p3": "grading/lti/"}
    optional = {module for module, (extra, _) in extras._PACKAGES.items() if extra}
    for path in ROOT.rglob("*.py"):
        place = path.relative_to(ROOT).as_posix()
        for node in (each.node for each in _statements(path) if each.at_head):
            names = [each.name for each in node.names] if isinstance(node, ast.Import) else [node.module or ""]
            for package in {name.partition(".")[0] for name in names} & optional:
                assert place.startswith(("panels/", may.get(package, "panels/"))), f"{place} imports {package}"


def test_modules_of_unix_are_imported_by_what_makes_grades_alone() -> None:
    """Windows has none of them, and no sandbox; what a batch has made in a container is read there, too."""
    unix = ("fcntl", "resource", "pwd", "grp", "termios", "tty")
    for path in ROOT.rglob("*.py"):
        place = path.relative_to(ROOT).as_posix()
        heads = [each.node for each in _statements(path) if each.at_head and isinstance(each.node, ast.Import)]
        if {name.name for node in heads for name in node.names} & set(unix):
            assert place.startswith(("grading/sandbox/", "grading/batch/scratch.py", "core/parallel/remote.py")), place
    missing = f"import sys, subprocess, tempfile, IPython\nfor name in {unix}: sys.modules[name] = None\n"
    loaded(missing + "import rds.panels.grading.panel, rds.grading.exports.export, rds.grading.review.best")


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
