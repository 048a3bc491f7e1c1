"""The page's kernels are forks of a process that is ready: what they are, and that they and it end."""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("ipykernel", reason="ipykernel is not installed: it is in the extra lab")
pytest.importorskip("jupyter_server", reason="Voilà is not installed: it is in the extra lab")

from jupyter_client import KernelManager

from rds.bus.hub.address import runtime_directory
from rds.core.parallel.forked import ForkedProcess
from rds.panels.app import serve
from rds.panels.app.provisioner import offer
from rds.panels.app.ready_kernels import LAUNCHER, ReadyKernels
from tests.conftest import LINGER, _processes

APP = Path(serve.__file__).parent
ASK = (
    "import os, sys; 'ipywidgets' in sys.modules and print("
    "os.environ['SAID'], os.getcwd(), 'rds.panels.program.panel' in sys.modules, os.environ['APP'] in sys.path, "
    "__import__('numpy').random.rand())"
)

# what draws for a kernel is its fork, at the lowest priority; should that be killed, the next one is not
DRAWN = """
import os, sys
from rds.panels.session.background_pictures import made_beside
ABOUT = "(os.getpid(), os.getppid(), os.nice(0), 'rds.panels.program.panel' in sys.modules)"
about = lambda: made_beside(eval, ABOUT, {"os": os, "sys": sys})
first, again = about(), about()
os.kill(first[0], 9)
try:
    about()
except Exception as error:
    assert "signal 9" in str(error), error
later = about()
print(first == again, first[1] == os.getpid() == later[1], first[2:], later[2:])
"""


@pytest.fixture(scope="module")
def ready() -> Iterator[ReadyKernels]:
    """For all tests that do not end it, whose kernels have ended soon after it."""
    with tempfile.TemporaryDirectory(prefix="rds", dir="/tmp") as runtime:
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("XDG_RUNTIME_DIR", runtime)
            kernels = ReadyKernels()
        yield kernels
        kernels.close()
        deadline = time.monotonic() + LINGER
        while (left := _processes(Path(runtime))) and time.monotonic() < deadline:
            time.sleep(0.05)
        assert not left, f"left running: {left}"


@pytest.fixture
def own_ready(alone: Path) -> Iterator[ReadyKernels]:
    """For one test."""
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
            assert isinstance(manager.provisioner.process, ForkedProcess)
            said, folder, imported, own_path, number_drawn = ask(manager, ASK).split()
            assert (said, folder, imported, own_path) == ("yes", str(alone), "True", "False")
            drawn.add(number_drawn)
            if number:
                assert ask(manager, DRAWN) == "True True (19, True) (19, False)\n"
            ended.append(manager.provisioner.process)
        finally:
            manager.shutdown_kernel(now=number == 0)
    assert len(drawn) == 2  # each draws its own random numbers
    assert [process.poll() for process in ended] == [0, 0]


FORK = """import os
if os.fork() == 0:
    print("from a forked process", flush=True)
    os._exit(0)
os.wait()"""


def test_what_a_forked_process_prints_comes_by_a_private_socket_as_all_else(
    ready: ReadyKernels, alone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("JUPYTER_PATH", str(APP / "share" / "jupyter"))
    offer(ready)
    folder = runtime_directory()

    async def life() -> tuple[str, list[str]]:
        from rds.panels.app.kernels import PageKernel  # here, as each worker would spend 2 s as it collects

        manager = PageKernel(kernel_name="rds", connection_file=str(folder / "kernel-0123456789ab.json"))
        await manager.start_kernel(cwd=str(APP), env=os.environ | {"SAID": "", "APP": ""})
        client = manager.client()
        said = ""
        try:
            client.start_channels()
            await client.wait_for_ready(timeout=60)
            client.execute(FORK)
            while "forked" not in said:
                said += (await client.get_iopub_msg(timeout=60))["content"].get("text", "")
            return said, sorted(path.name for path in folder.iterdir() if path.is_socket())
        finally:
            client.stop_channels()
            await manager.shutdown_kernel(now=True)

    with ThreadPoolExecutor(1) as thread:  # in this one the browser of other tests has a loop
        said, sockets = thread.submit(asyncio.run, life()).result()
    assert said.startswith("from a forked process")
    assert sockets == [f"01234567-{number}" for number in range(1, 7)]


def test_the_sockets_of_kernels_have_room_in_the_longest_runtime_directory() -> None:
    # 65 bytes are the most that runtime_directory takes; then come serve's folder and Voilà's in it, with random ends
    folder = Path("/" + "r" * 64) / "app12345678" / "voila_12345678"
    from rds.panels.app.kernels import PageKernel  # here, as each worker would spend 2 s as it collects

    manager = PageKernel(connection_file=str(folder / "kernel-01234567-89ab-cdef-0123-456789abcdef.json"))
    assert manager.transport == "ipc" and len(f"{manager.ip}-6") <= 103


def test_a_kernel_that_is_not_of_this_kind_is_started_as_always(ready: ReadyKernels, alone: Path) -> None:
    assert ready.start(["julia", "-i", "kernel.jl"], os.environ, alone) is None


def test_pages_that_ask_at_the_same_time_have_a_kernel_each(ready: ReadyKernels, alone: Path) -> None:
    def start(number: int) -> ForkedProcess | None:
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


def test_kernels_end_with_the_server_though_compiled_code_holds_one_and_are_started_as_always_then(
    own_ready: ReadyKernels, alone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("JUPYTER_PATH", str(APP / "share" / "jupyter"))
    ready = own_ready
    offer(ready)
    manager: Any = KernelManager(kernel_name="rds", connection_file=str(alone / "connection.json"))
    manager.start_kernel(cwd=str(alone), env=os.environ | {"SAID": "", "APP": ""})
    kernel = manager.provisioner.process
    idle = ready.start([sys.executable, *LAUNCHER, "-f", str(alone / "idle.json")], os.environ, alone)
    assert idle is not None
    client = manager.client()
    try:
        client.start_channels()
        client.wait_for_ready(timeout=60)
        client.execute("open('there', 'w').close() or sum(range(10**12))")
        while not (alone / "there").exists():
            with pytest.raises(subprocess.TimeoutExpired):
                kernel.wait(0.05)
        with pytest.raises(subprocess.TimeoutExpired):
            idle.wait(0.0)
        ready.close()
        assert kernel.wait(30.0) == idle.wait(30.0) == 0
        assert ready.start([sys.executable, *LAUNCHER, "-f", "connection.json"], os.environ, alone) is None
    finally:
        client.stop_channels()
        kernel.kill()
        idle.kill()


MANY = 20_000  # a panel that is opened is up to 272; ZeroMQ keeps 2,000 of its own, and a socket some more
PANEL_OPENS = f"""
kernel = get_ipython().kernel
for number in range({MANY}):
    kernel.session.send(kernel.iopub_socket, "comm_msg", {{"data": {{"number": number}}}})
"""


def test_a_page_that_reads_late_misses_no_message(
    ready: ReadyKernels, alone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """More than 2,000 that wait were thrown away: what such a message makes or shows is never there."""
    monkeypatch.setenv("JUPYTER_PATH", str(APP / "share" / "jupyter"))
    offer(ready)
    manager: Any = KernelManager(kernel_name="rds", connection_file=str(alone / "connection.json"))
    manager.start_kernel(cwd=str(alone), env=os.environ | {"SAID": "", "APP": ""})
    client = manager.client()
    try:
        client.start_channels()
        client.wait_for_ready(timeout=60)
        sent = client.execute(PANEL_OPENS)
        while client.get_shell_msg(timeout=60)["parent_header"]["msg_id"] != sent:
            pass  # the reply to an earlier question
        found: list[int] = []
        while (message := client.get_iopub_msg(timeout=60))["content"].get("execution_state") != "idle" or not found:
            if message["msg_type"] == "comm_msg":
                found.append(message["content"]["data"]["number"])
        assert found == list(range(MANY))
    finally:
        client.stop_channels()
        manager.shutdown_kernel(now=True)


def test_a_page_waits_for_minutes_for_what_its_kernel_shows() -> None:
    """On a busy computer its hundreds of messages come late, and a page that does not wait for them stays empty."""
    pytest.importorskip("voila", reason="Voilà is not installed: it is in the extra lab")
    from nbformat.v4 import new_notebook
    from voila.execute import VoilaExecutor

    from rds.panels.app.server import PanelsServer

    server = PanelsServer()
    server.parse_command_line(serve._options(None, False, "private"))
    assert VoilaExecutor(new_notebook(), config=server.config).iopub_timeout >= 60
