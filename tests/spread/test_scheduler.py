"""What protects a dask cluster: TLS with certificates of its own authority; plain TCP stays on this computer."""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import spread_functions
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.core.parallel import Scheduler, spread
from rds.core.parallel.scheduler import ClusterWarning

pytestmark = pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl is missing: apt install openssl")


def certificates(folder: Path) -> dict[str, Path]:
    """An authority, and a certificate of it, by the commands that the documentation gives."""
    folder.mkdir()
    text = (Path(__file__).parents[2] / "docs" / "submissions.md").read_text(encoding="utf-8")
    commands = re.search(r"```sh cluster-certificates\n(.*?)```", text, re.DOTALL)
    assert commands is not None
    subprocess.run(["sh", "-ec", commands[1]], cwd=folder, check=True, capture_output=True)
    return {"ca": folder / "ca.pem", "cert": folder / "cluster.pem", "key": folder / "cluster.key"}


@pytest.fixture(scope="module")
def ours(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return certificates(tmp_path_factory.mktemp("tls") / "ours")


@pytest.fixture(scope="module")
def others(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return certificates(tmp_path_factory.mktemp("tls") / "others")


@pytest.fixture(scope="module")
def address(ours: dict[str, Path]) -> Iterator[str]:
    """A scheduler with TLS and a worker, by dask's own commands."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    tls = [f"--tls-ca-file={ours['ca']}", f"--tls-cert={ours['cert']}", f"--tls-key={ours['key']}"]
    found = f"tls://127.0.0.1:{port}"
    dask = [sys.executable, "-m", "dask"]
    scheduler = ["scheduler", "--host", found, "--no-dashboard", *tls]
    worker = ["worker", found, "--nthreads", "1", "--no-nanny", "--no-dashboard", *tls]
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parent)}
    started = []
    try:
        for words in (scheduler, worker):
            quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
            started.append(subprocess.Popen([*dask, *words], env=environment, **quiet))
            if words is scheduler:
                wait_for(port)
        yield found
    finally:
        for process in started:
            process.kill()
            process.wait()


def wait_for(port: int) -> None:
    for _ in range(600):
        try:
            socket.create_connection(("127.0.0.1", port), 0.1).close()
            return
        except OSError:
            pass
        time.sleep(0.1)
    raise AssertionError("the scheduler did not come up")


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rds.core.parallel.cluster._ARRIVE", 90.0)


def test_with_tls_the_work_is_done(address: str, ours: dict[str, Path]) -> None:
    found = list(spread(spread_functions.square, range(4), scheduler=Scheduler(address, **ours)))
    assert [o.value for o in found] == [0, 1, 4, 9]


def test_dasks_own_configuration_will_do(address: str, ours: dict[str, Path]) -> None:
    import dask

    names = {"ca": "ca-file", "cert": "client.cert", "key": "client.key"}
    with dask.config.set({f"distributed.comm.tls.{name}": str(ours[file]) for file, name in names.items()}):
        assert [o.value for o in spread(spread_functions.square, [3], scheduler=address)] == [9]


def test_a_scheduler_of_another_authority_is_refused(address: str, others: dict[str, Path]) -> None:
    with pytest.raises(InputError, match="its certificate is not of the authority in --tls-ca"):
        spread(spread_functions.square, [1], scheduler=Scheduler(address, **others))


def test_a_scheduler_refuses_who_has_no_certificate_of_its_authority(
    address: str, ours: dict[str, Path], others: dict[str, Path]
) -> None:
    mixed = others | {"ca": ours["ca"]}  # who got hold of the authority's certificate, which is no secret
    with pytest.raises(InputError, match=re.escape(address)):
        spread(spread_functions.square, [1], scheduler=Scheduler(address, **mixed))


def test_plain_tcp_does_not_reach_a_scheduler_with_tls(address: str) -> None:
    with pytest.warns(ClusterWarning), pytest.raises(InputError, match="no dask scheduler answers"):
        spread(spread_functions.square, [1], scheduler=address.replace("tls", "tcp"))


@pytest.mark.parametrize(
    "plain", ["tcp://192.0.2.1:8786", "192.0.2.1:8786", "tcp://lab-7:8786", "tcp://[2001:db8::1]:1"]
)
def test_plain_tcp_to_other_computers_is_refused_before_any_connection(
    plain: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def connect(*_: object, **__: object) -> None:
        raise AssertionError("a name was looked up, or something sent")

    monkeypatch.setattr(socket, "getaddrinfo", connect)
    monkeypatch.setattr(socket.socket, "connect", connect)
    with pytest.raises(InputError, match=r"is plain TCP: whoever reaches .* say --insecure-cluster"):
        spread(spread_functions.square, [1], scheduler=plain)


def test_it_is_allowed_by_who_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rds.core.parallel.cluster.CONNECT", 0.3)
    with pytest.warns(ClusterWarning, match="whoever reaches it over the network can run code"):
        Scheduler("tcp://192.0.2.1:8786", insecure=True).security()
    Scheduler("tcp://192.0.2.1:8786", insecure=True).check()


@pytest.mark.parametrize("plain", ["tcp://127.0.0.1:8786", "localhost:8786", "tcp://[::1]:8786"])
def test_plain_tcp_on_this_computer_is_warned_of(plain: str) -> None:
    Scheduler(plain).check()
    with pytest.warns(ClusterWarning, match="every user of this computer can run code as its users"):
        Scheduler(plain).security()


@pytest.mark.parametrize(
    ("scheduler", "said"),
    [
        (Scheduler("tls://127.0.0.1:1"), "needs --tls-ca, --tls-cert, --tls-key"),
        (Scheduler("tls://127.0.0.1:1", ca="nowhere.pem"), "--tls-ca 'nowhere.pem': there is no such file"),
        (Scheduler("tls://127.0.0.1:1", ca=__file__, cert=__file__, key=__file__), "certificates cannot be read"),
        (Scheduler("tcp://127.0.0.1:1", ca=__file__), r"takes no certificates \(ca given\)"),
        (Scheduler("ucx://127.0.0.1:1"), "is no address of a dask scheduler"),
        (Scheduler("tls://127.0.0.1"), "is no address of a dask scheduler"),
    ],
)
def test_what_will_not_do_is_said(scheduler: Scheduler, said: str) -> None:
    with pytest.raises(InputError, match=said):
        spread(spread_functions.square, [1], scheduler=scheduler)


@pytest.mark.parametrize("command", [["grade", "run", "task", "in", "-o", "out"], ["robustness", "loop.toml"]])
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--scheduler", "tcp://lab-7:8786"], "say --insecure-cluster"),
        (["--insecure-cluster"], "--insecure-cluster without --scheduler"),
        (["--tls-ca", "ca.pem"], "--tls-ca without --scheduler"),
    ],
)
def test_the_commands_refuse_the_same(command: list[str], words: list[str], said: str) -> None:
    result = CliRunner().invoke(app, [*command, *words])
    assert result.exit_code == 2 and said in result.stderr
