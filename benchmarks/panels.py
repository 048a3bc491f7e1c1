"""The page in a browser: until it can be used, until it answers, what its strip costs, what it does to the loop."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.axis import experiment
from benchmarks.figures import Figure
from rds.panels.session.saving import is_being_saved
from rds.results import Result, open_result

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
SECONDS = 20.0  # of each emulation
ROUNDS = 3
_TICKS = os.sysconf("SC_CLK_TCK")
_HOLD = """() => new Promise((done) => {
    const began = performance.now();
    [...document.querySelectorAll('button')].find((each) => each.innerText === 'Hold' && each.offsetParent).click();
    const look = () => [...document.querySelectorAll('.rds-state')].some((each) => /Line 2 held/.test(each.innerText))
        ? done(performance.now() - began) : requestAnimationFrame(look);
    look();
})"""
_RUNNING = "[...document.querySelectorAll('.rds-state')].some((each) => /Line 2 runs/.test(each.innerText))"
_SCENE = "document.querySelector('.rds-scene').dataset"
_RUNS = 160  # short simulations one after the other, to see whether anything grows in a hundred
_SETTLED = 60  # of them, before it is looked at first: until then the browser still compiles what is called often
_BARE = """import ipywidgets
ipywidgets.IntSlider(description="bare")"""


def run() -> list[Figure]:
    """Figures, or the reason why there are none."""
    if CHROMIUM is None:
        return [Figure("the page in a browser", note="no Chromium: apt-get install chromium")]
    from playwright.sync_api import sync_playwright

    opened, bare, first, answered, there, pictures, costs, in_motion = [], [], [], [], [], [], [], []
    main_thread, occupied, beside, moving, alone, grown, held = [], [], [], [], [], [], []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        for attempt in range(-1, ROUNDS):  # the first start only brings the files into memory
            with tempfile.TemporaryDirectory() as folder:
                kept = {"equipment control": {"mode": "emulation", "duration": SECONDS}}
                Path(folder, "session.json").write_text(json.dumps(kept))
                with _app(folder) as (url, server, began):
                    page = browser.new_page(viewport={"width": 1280, "height": 800})
                    page.goto(url)
                    page.wait_for_selector(".rds-nav button")
                    taken = time.perf_counter() - began
                    if attempt < 0:
                        continue
                    opened.append(taken)
                    bare.append(_bare_page(browser))
                    for title in ("Equipment control", "Program", "Design"):  # none of them has been opened yet
                        at_once, whole = _answer(page, title)
                        first.append(at_once)
                        there.append(whole)
                    answered += [_answer(page, title)[1] for title in ("Program", "Main menu", "Design")]
                    page.click('.rds-nav button:text-is("Equipment control")')
                    result, cost = _live(page, server, Path(folder))
                    costs.append(cost)
                    beside.append(_p99(result))
                    result, passed, cost, used, busy = _animated(page, server, Path(folder))
                    pictures.append(passed)
                    in_motion.append(cost)
                    main_thread.append(used)
                    occupied.append(busy)
                    moving.append(_p99(result))
                    if attempt == ROUNDS - 1:
                        grown = _growth(page, server, Path(folder))
                    held += _held(page)
                    page.close()
            alone.append(_p99(experiment(SECONDS).run("emulation")))
        browser.close()
    return [
        Figure("from `rds app` to the first panel", "s", tuple(opened), 6.0),
        Figure("from `voila` to a bare page with one slider, in the same rounds", "s", tuple(bare)),
        Figure("a press that opens a panel for the first time, to its title", "ms", tuple(first), 100.0),
        Figure("the same, to the panel", "ms", tuple(there)),
        Figure("a press that goes to a panel that is open, to the panel", "ms", tuple(answered), 100.0),
        Figure("from Hold to its confirmation, both cores busy", "ms", tuple(held), 500.0),
        Figure("from one picture of the machine in motion to the next", "ms", tuple(pictures), 100.0),
        Figure("kernel, live strip of a run at 10 Hz", "% of a core", tuple(costs), 2.0),
        Figure("kernel, with the machine in motion too", "% of a core", tuple(in_motion), 3.0),
        Figure("main thread of the browser, with the machine in motion too", "% of a core", tuple(main_thread), 30.0),
        Figure("its tasks, with their waits for a core and for the pictures", "% of the time", tuple(occupied)),
        Figure(f"memory of the kernel that {_RUNS - _SETTLED} runs leave, after {_SETTLED}", "kB a run", grown[:1]),
        Figure(f"memory of the page that {_RUNS - _SETTLED} runs leave, after {_SETTLED}", "kB a run", grown[1:2]),
        Figure("of that, data: without the machine code that the browser makes of scripts", "kB a run", grown[2:], 1.0),
        Figure("lateness of the loop at 99 %, with the page", "µs", tuple(beside)),
        Figure("lateness of the loop at 99 %, with the machine in motion too", "µs", tuple(moving)),
        Figure("lateness of the loop at 99 %, without", "µs", tuple(alone)),
    ]


@contextmanager
def _app(folder: str) -> Iterator[tuple[str, int, float]]:
    began = time.perf_counter()
    command = [sys.executable, "-m", "rds", "app", folder, "--no-browser"]
    server = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True)
    assert server.stderr is not None
    try:
        for line in server.stderr:
            if found := re.search(r"http://127\.0\.0\.1\S+token=\S+", line):
                yield found.group(0), server.pid, began
                return
        raise RuntimeError("rds app did not start")
    finally:
        os.killpg(server.pid, signal.SIGTERM)
        server.wait(20)


def _answer(page: Any, title: str) -> tuple[float, float]:
    """ms from a press to the panel's title in sight, and to the panel itself, seen from within the page."""
    answered, there = page.evaluate(
        """(title) => new Promise((done) => {
            const button = [...document.querySelectorAll('.rds-nav button')].find((b) => b.innerText === title);
            const heading = document.querySelector('.rds-title'), panel = document.querySelector('.rds-panel');
            const began = performance.now();
            let answered = 0;
            const look = () => {
                if (heading.innerText.startsWith(title)) {
                    answered ||= performance.now() - began;
                    if (!panel.classList.contains('rds-opening') && panel.childElementCount)
                        return done([answered, performance.now() - began]);
                }
                requestAnimationFrame(look);
            };
            button.click();
            look();
        })""",
        title,
    )
    return float(answered), float(there)


def _live(page: Any, server: int, folder: Path) -> tuple[Result, float]:
    """A run of SECONDS, and the share of a core that the kernel of the page took while it lasted, %."""
    page.click('button:visible:text-is("Run")')
    page.wait_for_selector(".rds-strip canvas", timeout=60_000)
    time.sleep(2.0)  # the chart has been built
    before = {kernel: _cpu(kernel) for kernel in _kernels(server)}
    began = time.perf_counter()
    time.sleep(SECONDS * 0.6)
    passed = time.perf_counter() - began
    cost = max(_cpu(kernel) - seconds for kernel, seconds in before.items()) / passed * 100.0
    return _saved(page, folder), cost


def _animated(page: Any, server: int, folder: Path) -> tuple[Result, float, float, float, float]:
    """Another run of SECONDS with the machine in motion beside it.

    Its result, ms from a picture to the next, and shares of a core, %: the kernel's, and the main thread's of the page.
    Last the share of the time in which a task of that thread had begun and not ended, %. Without a graphics card it
    waits for the process that draws, and where all cores are in use it waits for one: time, and no use of a core.
    """
    page.click('button:visible:text-is("Run")')
    page.wait_for_selector(".rds-scene:visible", timeout=60_000)
    if page.evaluate(f"{_SCENE}.open") != "true":
        page.click('button:visible:text-is("Show the machine")')
    page.wait_for_function(f"{_SCENE}.state === 'live' && Number({_SCENE}.now) > 1", timeout=60_000)
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable")
    browser = page.context.browser.new_browser_cdp_session()

    def state() -> tuple[list[float], dict[int, float], dict[int, float]]:
        found = {each["name"]: each["value"] for each in session.send("Performance.getMetrics")["metrics"]}
        pictures = float(page.evaluate(f"{_SCENE}.pictures"))
        kernels = {each: _cpu(each) for each in _kernels(server)}
        processes = browser.send("SystemInfo.getProcessInfo")["processInfo"]
        pages = [each["id"] for each in processes if each["type"] == "renderer"]
        main_threads = {each: _cpu(f"{each}/task/{each}") for each in pages}
        return [time.perf_counter(), pictures, found["TaskDuration"]], kernels, main_threads

    before, *processes_before = state()
    time.sleep(SECONDS * 0.5)
    after, *processes_after = state()
    passed, pictures, tasks = (there - here for here, there in zip(before, after, strict=True))
    kernel, main_thread = (
        max(there.get(each, seconds) - seconds for each, seconds in here.items())
        for here, there in zip(processes_before, processes_after, strict=True)
    )
    shares = 100.0 * np.array([kernel, main_thread, tasks]) / passed
    return _saved(page, folder), 1e3 * passed / max(pictures, 1.0), *map(float, shares)


def _held(page: Any) -> list[float]:
    """ms from a press of Hold until the page says that the axes are held, while two processes keep both cores busy."""
    page.click('.rds-nav button:text-is("Program")')
    page.wait_for_selector(".rds-editor .cm-content:visible")
    page.fill(".rds-editor .cm-content", "G21 G90 G94\nG1 X70 F30\nM2\n")
    page.wait_for_selector('.rds-verdict:has-text("1 move, ")', timeout=60_000)
    page.click('button:visible:text-is("Emulation")')
    page.click('button:visible:text-is("Run")')
    page.wait_for_function(_RUNNING, timeout=60_000)
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(os.cpu_count() or 2)]
    found = []
    try:
        time.sleep(2.0)
        for _ in range(5):
            found.append(float(page.evaluate(_HOLD)))
            page.click('button:visible:text-is("Resume")')
            page.wait_for_function(_RUNNING, timeout=60_000)
            time.sleep(0.5)
    finally:
        for each in busy:
            each.kill()
            each.wait()
    page.click('.rds-work button:visible:text-is("Stop")')
    page.wait_for_selector('.rds-notice:has-text("ended early")', timeout=60_000)
    return found


def _growth(page: Any, server: int, folder: Path) -> tuple[float, float, float]:
    """kB that one more run leaves, over some of _RUNS simulations: kernel, heap of the page, data in that heap.

    The rest of the heap is machine code: the browser compiles a function once it has been called often.
    """
    page.select_option('.rds-field:has(label:text-is("Mode")) select', label="Simulation")
    page.get_by_label("Final time").filter(visible=True).fill("0.2")
    page.keyboard.press("Enter")
    session = page.context.new_cdp_session(page)

    def memory() -> tuple[float, float, float]:
        session.send("HeapProfiler.collectGarbage")
        used = float(session.send("Runtime.getHeapUsage")["usedSize"])
        return max(_resident(each) for each in _kernels(server)), used / 1e3, _data(session) / 1e3

    runs = folder / "runs"
    for number in range(_RUNS):
        page.wait_for_selector("button.rds-run:visible:enabled", timeout=60_000)
        before_it = set(runs.iterdir())
        page.click("button.rds-run:visible")
        written = False
        patience = time.monotonic() + 120.0
        while not written:  # its pictures and reports, too: what waits to be written is no growth
            if time.monotonic() > patience:
                raise RuntimeError(f"run {number} of {_RUNS} was not begun, or not written")
            page.wait_for_timeout(10)
            written = any(
                (new / "report.html").is_file() and not is_being_saved(new) for new in set(runs.iterdir()) - before_it
            )
        if number == _SETTLED - 1:
            before = memory()
    page.wait_for_selector("button.rds-run:visible:enabled", timeout=60_000)
    after = memory()
    return tuple((b - a) / (_RUNS - _SETTLED) for a, b in zip(before, after, strict=True))  # type: ignore[return-value]


def _data(session: Any) -> float:
    """Bytes of all that scripts of the page hold, from a snapshot of its heap: strings, arrays, objects, functions."""
    chunks: list[str] = []
    session.on("HeapProfiler.addHeapSnapshotChunk", keep := lambda event: chunks.append(event["chunk"]))
    session.send("HeapProfiler.takeHeapSnapshot")
    session.remove_listener("HeapProfiler.addHeapSnapshotChunk", keep)
    snapshot = json.loads("".join(chunks))
    meta = snapshot["snapshot"]["meta"]
    nodes = np.array(snapshot["nodes"]).reshape(-1, len(meta["node_fields"]))
    kinds = meta["node_types"][0]
    apart = [kinds.index(kind) for kind in ("code", "native", "synthetic")]  # native: of the browser, such as the DOM
    counted = ~np.isin(nodes[:, meta["node_fields"].index("type")], apart)
    return float(nodes[counted, meta["node_fields"].index("self_size")].sum())


def _resident(process: int) -> float:
    """kB."""
    found = re.search(r"VmRSS:\s+(\d+)", Path(f"/proc/{process}/status").read_text())
    return float(found[1]) if found else 0.0


def _bare_page(browser: Any) -> float:
    """s from the command to a page with one slider, served by Voilà as it comes."""
    import nbformat

    with tempfile.TemporaryDirectory() as folder:
        notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(_BARE)])
        nbformat.write(notebook, Path(folder, "bare.ipynb"))
        began = time.perf_counter()
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        command = [sys.executable, "-m", "voila", "bare.ipynb", "--no-browser", f"--port={port}"]
        server = subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True, start_new_session=True)
        assert server.stderr is not None
        try:
            for line in server.stderr:
                if found := re.search(r"http://localhost:\d+/\S*|http://127\.0\.0\.1:\d+/\S*", line):
                    page = browser.new_page()
                    page.goto(found.group(0))
                    page.wait_for_selector(".widget-slider", timeout=120_000)
                    page.close()
                    return time.perf_counter() - began
            raise RuntimeError("voila did not start")
        finally:
            os.killpg(server.pid, signal.SIGTERM)
            server.wait(20)


def _saved(page: Any, folder: Path) -> Result:
    """The result of the run that goes on, once it is over."""
    page.wait_for_selector(':text("Saved with its report in")', timeout=120_000)
    return open_result(max((folder / "runs").iterdir()))


def _kernels(server: int) -> list[int]:
    """The page's kernels: forks of the process that the server has started."""
    children: dict[int, list[int]] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(stat.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
        children.setdefault(parent, []).append(int(stat.parent.name))
    return [kernel for process in children.get(server, []) for kernel in children.get(process, [])]


def _cpu(process: int | str) -> float:
    """s of a core that a process has used, or a thread of it as `process/task/thread`."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS


def _p99(result: Result) -> float:
    return float(np.percentile(result["lateness"], 99))
