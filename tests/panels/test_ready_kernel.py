"""The kernel that gets ready while the server starts: Jupyter takes it for the page's first, or it goes."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("ipykernel", reason="ipykernel is not installed: pip install 'rds[lab]'")

from jupyter_client import KernelManager

from rds.panels.app import serve
from rds.panels.app.provisioner import offer
from rds.panels.app.ready_kernel import LAUNCHER, ReadyKernel

APP = Path(serve.__file__).parent
ASK = (
    "import os, sys; 'ipywidgets' in sys.modules and print("
    "os.environ['SAID'], os.getcwd(), 'rds.panels.program' in sys.modules, os.environ['APP'] in sys.path)"
)


@pytest.fixture
def ready(alone: Path) -> Iterator[ReadyKernel]:
    kernel = ReadyKernel()
    yield kernel
    kernel.close()  # and `alone` fails the test if the process stays


def command(file: Path) -> list[str]:
    return [sys.executable, *LAUNCHER, "-f", str(file)]


def test_jupyter_takes_it_for_the_page_s_first_kernel(
    ready: ReadyKernel, alone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("JUPYTER_PATH", str(APP / "share" / "jupyter"))
    offer(ready)
    name = json.loads((APP / "page.ipynb").read_text())["metadata"]["kernelspec"]["name"]
    manager: Any = KernelManager(kernel_name=name, connection_file=str(alone / "connection.json"))
    manager.start_kernel(cwd=str(alone), env=os.environ | {"SAID": "yes", "APP": str(APP)})
    client = manager.client()
    said: list[str] = []
    try:
        client.start_channels()
        client.wait_for_ready(timeout=60)
        client.execute_interactive(
            ASK, timeout=60, output_hook=lambda message: said.append(message["content"].get("text", ""))
        )
        assert "".join(said).split() == ["yes", str(alone), "True", "False"]
        assert ready.take(command(alone / "connection.json"), os.environ, alone) is None  # there is only one
    finally:
        client.stop_channels()
        manager.shutdown_kernel(now=True)


def test_it_is_no_other_kernel_and_goes_if_nobody_wants_it(ready: ReadyKernel, alone: Path) -> None:
    assert ready.take(["julia", "-i", "kernel.jl"], os.environ, alone) is None
    ready.close()
    assert ready.take(command(alone / "connection.json"), os.environ, alone) is None
