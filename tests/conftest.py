"""What tests of whole runs share: a place of their own, and proof that they leave nothing behind."""

from __future__ import annotations

import ast
import contextlib
import gc
import os
import re
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import typer.testing
from hypothesis import settings

from rds.bus.tools.mf4 import put_off_asammdf
from rds.core.run_text import STUDENT_MODULE

# Tests run side by side, and so do their many processes: numpy's threads would only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Texts are compared without colours, which these ask for; typer reads them once, and also GITHUB_ACTIONS.
os.environ.pop("FORCE_COLOR", None)
os.environ["_TYPER_FORCE_DISABLE_TERMINAL"] = "1"
put_off_asammdf()  # as our programs do: seconds of each worker
# ... and of each process that a test starts; see there
os.environ["PYTHONPATH"] = os.pathsep.join(
    filter(None, (str(Path(__file__).parent / "quick_can"), os.environ.get("PYTHONPATH")))
)

# Typer builds all commands of `rds` for each line that a test types, at 0.1 s: here once, as each program does.
if build := getattr(typer.testing, "_get_command", None):
    typer.testing._get_command = cache(build)

# A shell that runs the tests in the background has them ignore Ctrl-C, and nohup the end of a terminal; so would all
# that they start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

# Random input is the same every time, and of 40 examples where a test does not say how many it needs;
# `make test ARGS=--hypothesis-profile=search` goes on looking for trouble, with 100 new ones each time.
settings.register_profile("same", deadline=None, derandomize=True, max_examples=40)
settings.register_profile("search", deadline=None)
settings.load_profile("same")

pytest_plugins = ["compiled_first", "held_up", "skipped"]

gc.disable()  # until all tests are collected, which is garbage at the end of the run only

HERE = Path(__file__).parent
PANELS, REALTIME = "panels", "realtime"  # kinds of tests that run one by one
POLITE = 10  # niceness of the others
MARK = "pytest.mark.realtime"
BROWSER = {  # fixtures of tests/panels/conftest.py
    "app",
    "browser",
    "new_page",
    "new_page_for_all",
    "open_page",
    "page_for_all",
    "same_page",
    "second_app",
    "start_app",
}
# They wait for modules' heartbeats or run short and may be late, and follow the panels: both lanes take as long.
SECOND = ("/oacs/", "/safety/", "/test_readme.py", "/test_notebooks.py", "/test_demo.py")
LINGER = 20.0  # s that a machine, a hub or a target may take to notice that it is not needed any more


def pytest_xdist_auto_num_workers() -> int:
    """Two more than there are processors: the two kinds that run one by one wait for most of their time."""
    return len(os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else range(os.cpu_count() or 1)) + 2


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Side by side, what runs one by one begins first, as it ends last; then the files with the most tests."""
    if not hasattr(config, "workerinput"):
        return
    sizes = Counter(group_of(item.nodeid) for item in items)
    first = (REALTIME, PANELS)
    rank = {group: (group not in first, -sizes[group], group) for group in sizes}
    items.sort(key=lambda item: rank[group_of(item.nodeid)])


def pytest_collection_finish() -> None:
    """What was collected is half a million objects, which no later collection of garbage goes through; and those that
    tests make are gone through less often: a twentieth of what they compute.
    """
    gc.freeze()
    gc.set_threshold(10_000, 20, 20)
    gc.enable()


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Files side by side; those that wait for real time one after the other, and those in a browser: beside each other
    they starve. (pytest-xdist's own groups need names of tests that pytest 9.2 does not let it change.)
    """
    from xdist.scheduler import LoadScopeScheduling  # type: ignore[import-untyped]

    config.option.loadscopereorder = False  # the order is that of the collection

    class FilesOrGroups(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return group_of(nodeid)

    return FilesOrGroups(config, log)


def group_of(nodeid: str) -> str:
    """What a test runs one by one with: those in a browser, those that wait for real time, or those of its file."""
    path, name = nodeid.partition("[")[0].split("::")[:2]
    if "/panels/" in path and name in _in_a_browser(path):
        return PANELS
    if name not in _waiting_for_real_time(path):
        return path
    return PANELS if any(part in path for part in SECOND) else REALTIME


@cache
def _body(path: str) -> list[ast.stmt]:
    return ast.parse((HERE.parent / path).read_text(encoding="utf-8")).body


@cache
def _waiting_for_real_time(path: str) -> frozenset[str]:
    """The functions and classes of a file that are marked `realtime`: all of them where the file itself is."""
    if MARK not in (HERE.parent / path).read_text(encoding="utf-8"):
        return frozenset()
    named = [node for node in _body(path) if isinstance(node, ast.FunctionDef | ast.ClassDef)]
    is_all = any(MARK in ast.unparse(node) for node in _body(path) if node not in named)
    return frozenset(node.name for node in named if is_all or MARK in ast.unparse(node))


@cache
def _in_a_browser(path: str) -> frozenset[str]:
    """The tests and fixtures of a file that have a page, or `rds app`, from the panels' fixtures or by others of the
    file. What a file makes once for several tests, of which one is in a browser, takes the others along.
    """
    needs, is_shared = {}, set()
    for node in _body(path):
        if isinstance(node, ast.FunctionDef):
            marks = "".join(map(ast.unparse, node.decorator_list))
            used = re.findall(r"'(\w+)'", marks) if "usefixtures" in marks else []
            needs[node.name] = {argument.arg for argument in node.args.args} | set(used)
            if "fixture" in marks and "scope=" in marks:
                is_shared.add(node.name)
    found: set[str] = set()
    while True:
        more = {name for name, used in needs.items() if used & (BROWSER | found)}
        more |= {used for name in more for used in needs[name] & is_shared}
        if more <= found:
            return frozenset(found)
        found |= more


@pytest.fixture(scope="session", autouse=True)
def own_runtime_directory(worker_id: str) -> Iterator[None]:
    """Tests side by side do not see each other's buses."""
    if worker_id == "master":
        yield
        return
    with tempfile.TemporaryDirectory(prefix="rds", dir="/tmp") as runtime, pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", runtime)
        yield


@pytest.fixture(autouse=True)
def politeness(request: pytest.FixtureRequest, worker_id: str) -> None:
    """Side by side, a test that only computes gives way to those that wait for real time or for a browser."""
    is_served_first = group_of(request.node.nodeid) in (PANELS, REALTIME)
    if worker_id != "master" and not is_served_first and hasattr(os, "nice") and os.nice(0) < POLITE:
        os.nice(POLITE - os.nice(0))  # for good: a worker that took a file gets no test of the other kinds any more


@pytest.fixture(autouse=True)
def ordinary_scheduling() -> Iterator[None]:
    """No test leaves this process real-time: all that it starts later would keep the computer to itself."""
    yield
    if hasattr(os, "sched_getscheduler") and (scheduler := os.sched_getscheduler(0)) != os.SCHED_OTHER:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        pytest.fail(f"the process of the tests was left with scheduling policy {scheduler}")


@pytest.fixture(scope="module", autouse=True)
def forgotten_laws() -> Iterator[None]:
    """What a file has loaded of students' code is no module any more when the next one begins: with the 20,000 that a
    worker loads, loading one more takes four times as long, and to pack one for another process a hundred times.
    """
    before = set(sys.modules)
    yield
    for name in [name for name in sys.modules if name.startswith(STUDENT_MODULE) and name not in before]:
        del sys.modules[name]


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Path]:
    """A directory to run in, and a runtime directory that no other run shares.

    Fails the test that leaves a process or a ring in shared memory behind.
    """
    runtime = Path(tempfile.mkdtemp(prefix="rds", dir="/tmp"))  # short, because a socket's path is
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(runtime))
    monkeypatch.chdir(tmp_path)
    rings = set(_rings())
    yield tmp_path
    for process, command in _processes(runtime).items():
        # they would stay some seconds, for the next run or a host that comes back: no need to wait for that
        if "rds.bus.hub.hub" in command or "--exit-with-stdin" in command:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGTERM)
    deadline = time.monotonic() + LINGER
    while (left := _processes(runtime)) and time.monotonic() < deadline:
        time.sleep(0.05)
    for process in left:
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)
    shutil.rmtree(runtime, ignore_errors=True)
    forgotten = _forgotten(rings)
    deadline = time.monotonic() + LINGER
    while forgotten and time.monotonic() < deadline:  # or of another run on this computer, about to begin or to end
        time.sleep(0.1)
        forgotten = [ring for ring in _forgotten(rings) if ring in forgotten]
    assert not left, f"left running: {left}"
    assert not forgotten, f"left in shared memory: {forgotten}"


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[dict[str, Any]]]:
    """With what each bus of this process was opened; python-can's virtual one knows no bit rate."""
    import can

    calls: list[dict[str, Any]] = []
    real = can.Bus

    def bus(**options: Any) -> Any:
        calls.append(options)
        return real(**{key: value for key, value in options.items() if key != "bitrate"})

    monkeypatch.setattr(can, "Bus", bus)
    yield calls


def _rings() -> list[str]:
    """What runs share with their hosts: rings, and live values beside them."""
    return [str(path) for path in Path("/dev/shm").glob("rds-*.*") if path.suffix in (".ring", ".live")]


def _forgotten(before: set[str]) -> list[str]:
    return [ring for ring in _rings() if ring not in before and not _is_mapped(ring)]


def _is_mapped(ring: str) -> bool:
    """Whether a process, of whichever test or user, still has it."""
    for maps in Path("/proc").glob("[0-9]*/maps"):
        with contextlib.suppress(OSError):
            if ring in maps.read_text():
                return True
    return False


def _processes(runtime: Path) -> dict[int, str]:
    """Processes that have this runtime directory in their environment, but for this one and what is ending."""
    found = {}
    for environ in Path("/proc").glob("[0-9]*/environ"):
        number = int(environ.parent.name)
        with contextlib.suppress(OSError):
            if number != os.getpid() and str(runtime).encode() in environ.read_bytes():
                command = (environ.parent / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
                if command:
                    found[number] = command
    return found
