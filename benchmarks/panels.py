"""The page in a browser: until it can be used, until it answers, what its strip costs, what it does to the loop."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
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
from rds.results import Result, open_result

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
SECONDS = 20.0  # of each emulation
ROUNDS = 3
_TICKS = os.sysconf("SC_CLK_TCK")
# counts the pictures of the machine that WebGL draws of a position that it had not drawn before
_COUNT_PICTURES = """
window.pictures = 0;
let said = '';
const clear = WebGL2RenderingContext.prototype.clear;
WebGL2RenderingContext.prototype.clear = function (...what) {
    const words = [...document.querySelectorAll('.rds-app p')].find((each) => each.innerText.startsWith('at '));
    if (words && words.innerText !== said) { said = words.innerText; window.pictures += 1; }
    return clear.apply(this, what);
};
"""


def run() -> list[Figure]:
    """Figures, or the reason why there are none."""
    if CHROMIUM is None:
        return [Figure("the page in a browser", note="no Chromium: apt-get install chromium")]
    from playwright.sync_api import sync_playwright

    opened, first, answered, there, pictures, costs, beside, moving, alone = [], [], [], [], [], [], [], [], []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        for attempt in range(-1, ROUNDS):  # the first start only brings the files into memory
            with tempfile.TemporaryDirectory() as folder:
                kept = {"equipment control": {"mode": "emulation", "duration": SECONDS}}
                Path(folder, "session.json").write_text(json.dumps(kept))
                with _app(folder) as (url, server, began):
                    page = browser.new_page(viewport={"width": 1280, "height": 800})
                    page.add_init_script(_COUNT_PICTURES)
                    page.goto(url)
                    page.wait_for_selector(".rds-nav button")
                    taken = time.perf_counter() - began
                    if attempt < 0:
                        continue
                    opened.append(taken)
                    for title in ("Equipment control", "Program", "Design"):  # none of them has been opened yet
                        at_once, whole = _answer(page, title)
                        first.append(at_once)
                        there.append(whole)
                    answered += [_answer(page, title)[1] for title in ("Program", "Main menu", "Design")]
                    page.click('.rds-nav button:text-is("Equipment control")')
                    result, cost = _live(page, server, Path(folder))
                    costs.append(cost)
                    beside.append(_p99(result))
                    result, passed = _animated(page, Path(folder))
                    pictures.append(passed)
                    moving.append(_p99(result))
                    page.close()
            alone.append(_p99(experiment(SECONDS).run("emulation")))
        browser.close()
    return [
        Figure("from `rds app` to the first panel", "s", tuple(opened), 6.0),
        Figure("a press that opens a panel for the first time, to its title", "ms", tuple(first), 100.0),
        Figure("the same, to the panel", "ms", tuple(there)),
        Figure("a press that goes to a panel that is open, to the panel", "ms", tuple(answered), 100.0),
        Figure("from one picture of the machine in motion to the next", "ms", tuple(pictures), 100.0),
        Figure("kernel, live strip of a run at 10 Hz", "% of a core", tuple(costs), 3.0),
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


def _animated(page: Any, folder: Path) -> tuple[Result, float]:
    """Another run of SECONDS with the machine in motion beside it, and the time from one picture to the next, ms."""
    page.click('button:visible:text-is("Run")')
    page.click('button:visible:text-is("Show the machine")')
    page.wait_for_function("window.pictures > 3", timeout=60_000)
    before, began = page.evaluate("[window.pictures, performance.now()]")
    time.sleep(SECONDS * 0.5)
    after, ended = page.evaluate("[window.pictures, performance.now()]")
    return _saved(page, folder), (ended - began) / max(after - before, 1)


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


def _cpu(process: int) -> float:
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS


def _p99(result: Result) -> float:
    return float(np.percentile(result["lateness"], 99))
