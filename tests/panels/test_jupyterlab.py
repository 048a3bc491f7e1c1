"""The panels in JupyterLab: the notebook on them, opened and run in a browser, to a first tracked sine."""

from __future__ import annotations

import os
import re
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from documents import ROOT

NOTEBOOK = ROOT / "notebooks" / "04_panels.ipynb"
# JupyterLab itself looks for news and extensions on the internet, unless it is told not to
OFFLINE = (
    "--LabApp.news_url=None",
    "--LabApp.check_for_updates_class=jupyterlab.NeverCheckForUpdate",
    "--LabApp.extension_manager=readonly",
)
# as docs/panels.md says for a computer that others use as well
PRIVATE = "--KernelManager.transport=ipc"


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[tuple[str, Path, Path]]:
    """A JupyterLab with settings of its own, on a folder with the notebook: its address, both folders."""
    pytest.importorskip("jupyterlab", reason="JupyterLab is not installed: it is in the extra lab")
    runtime = tempfile.mkdtemp(prefix="rds", dir="/tmp")  # short, because a socket's path is
    folder = tmp_path / "student"
    folder.mkdir()
    shutil.copy(NOTEBOOK, folder)
    token = secrets.token_hex(16)
    own = {"JUPYTER_CONFIG_DIR": "config", "JUPYTER_DATA_DIR": "data", "JUPYTER_RUNTIME_DIR": f"{runtime}/jupyter"}
    own |= {"JUPYTERLAB_SETTINGS_DIR": "settings", "JUPYTERLAB_WORKSPACES_DIR": "workspaces", "IPYTHONDIR": "ipython"}
    env = {name: str(tmp_path / place) for name, place in own.items()}
    options = ["--no-browser", "--allow-root", "--ip=127.0.0.1", *OFFLINE, PRIVATE]
    server = subprocess.Popen(
        [sys.executable, "-m", "jupyterlab", *options, str(folder)],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=os.environ | env | {"XDG_RUNTIME_DIR": runtime, "JUPYTER_PREFER_ENV_PATH": "1", "JUPYTER_TOKEN": token},
    )
    assert server.stderr is not None
    try:
        said = []
        for line in server.stderr:
            said.append(line)
            if found := re.search(r"http://127\.0\.0\.1:\d+/", line):
                yield f"{found.group(0)}lab/tree/{NOTEBOOK.name}?token={token}", folder, Path(runtime)
                break
        else:
            raise AssertionError("JupyterLab did not start:\n" + "".join(said))
    finally:
        os.killpg(server.pid, signal.SIGTERM)
        server.communicate(timeout=20)
        shutil.rmtree(runtime, ignore_errors=True)


def test_a_notebook_cell_shows_the_panels_and_tracks_a_sine(
    lab: tuple[str, Path, Path], new_page: Callable[[int, int], Any]
) -> None:
    url, folder, runtime = lab
    page = new_page(1280, 800)
    page.goto(url)
    page.wait_for_selector('.jp-StatusBar-TextItem:has-text("| Idle")')
    page.click('.jp-CodeCell .cm-content:has-text("rds.panels.main()")')
    page.keyboard.press("Shift+Enter")
    page.click('.rds-app button:text-is("Track a sine")')
    page.click('.rds-app button:visible:text-is("Run")')
    page.wait_for_selector('.rds-app :text("RMS error"):visible')
    page.wait_for_selector(".rds-app .rds-figure canvas:visible")
    page.wait_for_selector('.rds-app :text("Saved with its report in")')
    assert len(list((folder / "runs").iterdir())) == 1
    page.focus('.rds-app button:text-is("Dark")')
    page.keyboard.press("Enter")  # the button's, and not the notebook's
    page.wait_for_selector(".rds-app.rds-dark")
    page.keyboard.press("Enter")
    page.wait_for_selector(".rds-app:not(.rds-dark)")
    page.keyboard.type("dd")  # which deletes a cell that is selected
    assert page.locator('.jp-CodeCell .cm-content:has-text("rds.panels.main()")').count() == 1
    sockets = [path for path in runtime.glob("jupyter/kernel-*") if path.is_socket()]
    assert len(sockets) == 5 and (runtime / "jupyter").stat().st_mode & 0o077 == 0  # nobody else connects to them
    # the emergency stop stays in sight while one scrolls, and nothing lies over it: not the tools of the figure either
    covered = page.evaluate("""() => {
        const stop = document.querySelector("button.rds-stop").getBoundingClientRect();
        const tools = document.querySelector(".rds-figure .jupyter-matplotlib-toolbar");
        document.querySelector(".rds-app").scrollTop += tools.getBoundingClientRect().y - stop.y;
        const over = tools.getBoundingClientRect();
        const seen = (x, y) => document.elementFromPoint(x, y)?.className ?? "outside the window";
        const left = Math.max(over.x, stop.x) + 4;  // where both would be
        return [over.y - stop.y, seen(left, stop.y + 8), seen(stop.right - 8, stop.bottom - 8)];
    }""")
    assert abs(covered[0]) < 2.0 and "rds-stop" in covered[1] and "rds-stop" in covered[2]
