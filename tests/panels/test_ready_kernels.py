"""The page's kernels are forks of a process that is ready: what they are, and that they and it end."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("ipykernel", reason="ipykernel is not installed: pip install 'rds[lab]'")

from jupyter_client import KernelManager

from rds.panels.app import serve
from rds.panels.app.provisioner import offer
from rds.panels.app.ready_kernels import LAUNCHER, ForkedKernel, ReadyKernels

APP = Path(serve.__file__).parent
ASK = (
    "import os, sys; 'ipywidgets' in sys.modules and print("
    "os.environ['SAID'], os.getcwd(), 'rds.panels.program.panel' in sys.modules, os.environ['APP'] in sys.path, "
    "__import__('numpy').random.rand())"
)


@pytest.fixture
def ready(alone: Path) -> Iterator[ReadyKernels]:
    kernels = ReadyKernels()
    yield kernels
    kernels.close()  # and `alone` fails the test if a process stays


def ask(manager: Any, code: str) -> str:
    """What a kernel prints."""
    client = manager.client()
    said: list[str] = []
    try:
        client.start_channels()
        client.wait_for_ready(timeout=60)
        client.execute_interactive(
            code, timeout=60, output_hook=lambda message: said.append(message["content"].get("text", ""))
        )
    finally:
        client.stop_channels()
    return "".join(said)


def test_jupyter_takes_all_kernels_of_the_page_from_there(
    ready: ReadyKernels, alone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("JUPYTER_PATH", str(APP / "share" / "jupyter"))
    offer(ready)
    name = json.loads((APP / "page.ipynb").read_text())["metadata"]["kernelspec"]["name"]
    drawn, ended = set(), []
    for number in range(2):
        manager: Any = KernelManager(kernel_name=name, connection_file=str(alone / f"connection{number}.json"))
        manager.start_kernel(cwd=str(alone), env=os.environ | {"SAID": "yes", "APP": str(APP)})
        try:
            assert isinstance(manager.provisioner.process, ForkedKernel)
            said, folder, imported, own_path, number_drawn = ask(manager, ASK).split()
            assert (said, folder, imported, own_path) == ("yes", str(alone), "True", "False")
            drawn.add(number_drawn)
            ended.append(manager.provisioner.process)
        finally:
            manager.shutdown_kernel(now=number == 0)
    assert len(drawn) == 2  # each draws its own random numbers
    assert [process.poll() for process in ended] == [0, 0]


def test_a_kernel_that_is_not_of_this_kind_is_started_as_always(ready: ReadyKernels, alone: Path) -> None:
    assert ready.start(["julia", "-i", "kernel.jl"], os.environ, alone) is None
    ready.close()
    assert ready.start([sys.executable, *LAUNCHER, "-f", "connection.json"], os.environ, alone) is None


def test_pages_that_ask_at_the_same_time_have_a_kernel_each(ready: ReadyKernels, alone: Path) -> None:
    def start(number: int) -> ForkedKernel | None:
        command = [sys.executable, *LAUNCHER, "-f", str(alone / f"connection{number}.json")]
        return ready.start(command, os.environ, alone)

    with ThreadPoolExecutor() as pool:
        kernels = [kernel for kernel in pool.map(start, range(3)) if kernel is not None]
    try:
        told = [Path(f"/proc/{kernel.pid}/stat").read_text().split() for kernel in kernels]
        assert len({fields[0] for fields in told}) == 3 and len({fields[3] for fields in told}) == 1
    finally:
        for kernel in kernels:
            kernel.kill()


def test_a_kernel_that_compiled_code_holds_ends_with_the_server(
    ready: ReadyKernels, alone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("JUPYTER_PATH", str(APP / "share" / "jupyter"))
    offer(ready)
    manager: Any = KernelManager(kernel_name="rds", connection_file=str(alone / "connection.json"))
    manager.start_kernel(cwd=str(alone), env=os.environ | {"SAID": "", "APP": ""})
    kernel = manager.provisioner.process
    client = manager.client()
    try:
        client.start_channels()
        client.wait_for_ready(timeout=60)
        client.execute("open('there', 'w').close() or sum(range(10**12))")
        while not (alone / "there").exists():
            with pytest.raises(subprocess.TimeoutExpired):
                kernel.wait(0.05)
        ready.close()
        assert kernel.wait(30.0) == 0
    finally:
        client.stop_channels()
        kernel.kill()


def test_kernels_end_with_the_server(ready: ReadyKernels, alone: Path) -> None:
    command = [sys.executable, *LAUNCHER, "-f", str(alone / "connection.json")]
    kernel = ready.start(command, os.environ, alone)
    assert kernel is not None
    with pytest.raises(subprocess.TimeoutExpired):
        kernel.wait(0.0)
    ready.close()
    assert kernel.wait(30.0) == 0
    kernel.kill()  # which does nothing to whoever may have its number now
