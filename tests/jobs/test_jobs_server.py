"""`rds jobs serve`: what it refuses, and part programs that clients run, hold, stop and leave alone."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import stat
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner
from waiting import wait_for

import rds
from rds.cli.main import app
from rds.core.errors import InputError
from rds.jobs.address import Address
from rds.jobs.folder import Folder
from rds.jobs.jobs import Jobs
from rds.jobs.requests import VERBS, answer, parse, words_of
from rds.jobs.server import CLIENTS
from rds.jobs.server import Server as JobsServer
from rds.machines import load_machine
from tests.documents import blocks, save
from tests.jobs.conftest import Server

Serve = Callable[..., Server]
EXPERIMENT = """
axis = "X"
duration = 0.2
[reference]
kind = "constant"
value = 0.1
[controller]
{controller}
"""


def test_files_are_read_checked_and_kept_inside_the_folder(serve: Serve, tmp_path: Path) -> None:
    server = serve()
    folder, client = server.folder, server.client()
    told = client.ask(do="check", file="circle.ngc", id="mine")
    assert told["ok"] and told["id"] == "mine" and told["kind"] == "part program"
    assert told["seconds"] == pytest.approx(2 * 3.14159 * 20 / 10, rel=0.05)
    (folder / "wrong.ngc").write_text("G1 X10\nM2\n")
    told = client.ask(do="load", file="wrong.ngc")
    assert not told["ok"] and "line 1" in told["error"] and "F" in told["error"]
    assert client.ask(do="jobs") == {"ok": True, "jobs": []}

    outside = tmp_path / "outside.ngc"
    outside.write_text("M2\n")
    (folder / "link.ngc").symlink_to(outside)
    (folder / "away").symlink_to(tmp_path)
    (folder / "round").symlink_to(folder / "round")
    for name in ("../outside.ngc", str(outside), "link.ngc", "away/outside.ngc"):
        assert "leads out of the served folder" in client.ask(do="load", file=name)["error"], name
    assert not client.ask(do="load", file="round")["ok"]
    assert "no file" in client.ask(do="load", file="absent.ngc")["error"]
    assert not client.ask(do="load", file="a\0b")["ok"]

    (tmp_path / "law.py").write_text("raise SystemExit\n")
    (folder / "law.py").symlink_to(tmp_path / "law.py")
    for law in ("../law.py", str(tmp_path / "law.py"), "law.py"):
        (folder / "e.toml").write_text(EXPERIMENT.format(controller=f'file = "{law}"'))
        assert "leads out of the served folder" in client.ask(do="load", file="e.toml")["error"], law
    (folder / "e.toml").write_text(EXPERIMENT.format(controller='name = "p"'))
    assert client.ask(do="load", file="e.toml", id=[1])["job"] == 1
    assert client.ask(do="run", job=1)["out"] == "runs/e-1"
    assert client.until_over(1)["ending"] == "done"
    assert rds.open_result(folder / "runs" / "e-1").axes == ["X"]
    assert "job 1 is over; a job runs once" in client.ask(do="run", job=1)["error"]
    assert client.ask(do="drop", job=1)["ok"]
    assert "no job 1" in client.ask(do="status", job=1)["error"]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('{"do": "jump"}', "do = 'jump' is unknown; known: load"),
        ('{"do": "status"}', "job is missing"),
        ('{"do": "status", "job": "1"}', "job = '1' must be a whole number"),
        ('{"do": "status", "job": 1, "now": true}', "unknown key 'now'"),
        ('{"do": "jobs", "do": "jobs"}', "given twice"),
        ('{"do": "override", "job": 1, "share": NaN}', "NaN is no number"),
        ('{"do": "load", "file": "circle.ngc", "mode": "dream"}', "mode = 'dream' is unknown"),
        ('{"do": "load", "file": "circle.ngc", "machine": "/etc/passwd"}', "must be the name of a machine"),
        ("[" * 60_000, "not JSON"),
        ("7", "must be one JSON object"),
        ("\x00\xff", "not JSON"),
    ],
)
def test_what_is_wrong_is_a_sentence(tmp_path: Path, line: str, message: str) -> None:
    (tmp_path / "circle.ngc").write_text("M2\n")
    with pytest.raises(InputError) as refusal:
        verb, values = words_of(parse(line.encode()))
        answer(Jobs(Folder(tmp_path)), verb, values)
    assert message in str(refusal.value)


def test_without_the_secret_nothing_is_answered(serve: Serve) -> None:
    server = serve()
    assert stat.S_IMODE(server.socket.stat().st_mode) == 0o600
    assert stat.S_IMODE(server.secret_file.stat().st_mode) == 0o600
    for request in ({"secret": "0" * 32}, {"secret": 1}, {"do": "jobs"}):
        stranger = server.client(with_secret=False)
        told = stranger.ask(**request)
        assert not told["ok"] and str(server.secret_file) in told["error"] and stranger.ended()
    stranger = server.client(with_secret=False)
    stranger.sock.sendall(b"POST / HTTP/1.1\r\n")
    assert not stranger.read()["ok"] and stranger.ended()

    client = server.client()
    client.sock.sendall(b'{"do": "' + b"x" * 200_000)
    assert "longer than 65536 bytes" in client.read()["error"] and client.ended()
    assert server.client().ask(do="jobs")["ok"]


def test_strangers_and_too_many_clients_keep_nobody_out(serve: Serve) -> None:
    server = serve()
    strangers = [server.client(with_secret=False) for _ in range(17)]
    assert strangers[0].ended()
    clients = [server.client() for _ in range(16)]
    late = server.client()
    assert "16 programs are connected" in late.read()["error"]
    clients[0].close()
    deadline = time.monotonic() + 20.0
    while not (taken := server.client()).ask(do="jobs")["ok"] and time.monotonic() < deadline:
        pass
    assert taken.ask(do="jobs")["ok"]


def test_a_server_that_is_too_busy_to_answer_keeps_its_socket(tmp_path: Path) -> None:
    address = Address.of(tmp_path / "jobs.sock")
    with socket.socket(socket.AF_UNIX) as busy:
        busy.bind(str(address.path))
        busy.listen(0)
        clients = [socket.socket(socket.AF_UNIX) for _ in range(3)]
        for client in clients:
            client.setblocking(False)
            with suppress(BlockingIOError):
                client.connect(str(address.path))
        with pytest.raises(InputError, match="another server of jobs listens there"):
            address.listen()
        for client in clients:
            client.close()
    address.listen().close()  # that one has gone, and left it behind


def test_no_stop_and_no_end_waits_until_the_files_of_others_are_read(tmp_path: Path) -> None:
    """With as many files to read as Python has threads for such work, a stop waited for the first of them.

    The end of the server waited for all of them, without end where a file calls input() while it loads.
    """
    read = threading.Event()
    jobs: Any = SimpleNamespace(load=lambda *_, **__: read.wait(10.0), stop=lambda _: SimpleNamespace(state="running"))
    address = Address.of(tmp_path / "jobs.sock")

    async def stopped() -> bytes:
        server = JobsServer(jobs, address, None)
        async with await asyncio.start_unix_server(server._meet, sock=address.listen()):
            lines = [await asyncio.open_unix_connection(address.path) for _ in range(CLIENTS)]
            for _, writer in lines[1:]:
                writer.write(b'{"do": "check", "file": "a"}\n')
            await asyncio.sleep(0.1)
            reader, writer = lines[0]
            writer.write(b'{"do": "stop", "job": 1}\n')
            try:
                return await asyncio.wait_for(reader.readline(), 5.0)
            finally:
                for _, writer in lines:
                    writer.close()

    began = time.monotonic()
    try:
        assert b'"state": "running"' in asyncio.run(stopped())
        assert time.monotonic() - began < 5.0
    finally:
        read.set()


def test_a_simulation_that_waits_is_left_behind_once_it_is_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Such a job was stopped, and ran; and so did every other one wait, until the server was killed."""
    monkeypatch.setattr("rds.jobs.jobs._SAFE_END", 0.1)
    jobs = Jobs(Folder(tmp_path))
    law = "import os, time\ndef control(t, r, y, state, params):\n    {}\n    return 0.0, state\n"
    begun, over = str(tmp_path / "begun"), str(tmp_path / "over")
    wait = f"if t > 0: open({begun!r}, 'w').close()\n    while t > 0 and not os.path.exists({over!r}): time.sleep(0.01)"
    loaded = []
    for name, line in (("waits", wait), ("other", "pass")):
        (tmp_path / f"{name}.py").write_text(law.format(line))
        (tmp_path / f"{name}.toml").write_text(EXPERIMENT.format(controller=f'file = "{name}.py"'))
        loaded.append(jobs.load(f"{name}.toml", None, None, None, keep=True))
    waits, other = loaded
    jobs.run(waits.number, queue=False)
    jobs.run(other.number, queue=True)
    wait_for((tmp_path / "begun").exists, 20.0)
    jobs.stop(waits.number)
    wait_for(lambda: other.state == "over", 20.0)
    assert "did not end within" in waits.status()["error"] and other.status()["ending"] == "done"
    # The thread that was left behind goes back to its folder; it would do so in the tests after this one.
    (tmp_path / "over").touch()
    for thread in threading.enumerate():
        if thread.name == f"job {waits.number}":
            thread.join(20.0)


def test_a_job_that_was_left_behind_before_it_ran_stays_over(tmp_path: Path) -> None:
    """It was running again without end, and could not be dropped."""
    jobs, job = Jobs(Folder(tmp_path)), SimpleNamespace(state="starting", error=None)
    jobs._current = job  # type: ignore[assignment]
    run = SimpleNamespace(ready=lambda: jobs._over(job, "left behind"), wait=lambda: None)  # type: ignore[arg-type]
    jobs._follow(job, run)  # type: ignore[arg-type]
    assert (job.state, job.error) == ("over", "left behind")


def test_a_file_that_raises_keyboard_interrupt_does_not_end_the_server(serve: Serve) -> None:
    server = serve()
    (server.folder / "law.py").write_text("raise KeyboardInterrupt\n")
    (server.folder / "law.toml").write_text(EXPERIMENT.format(controller='file = "law.py"'))
    client = server.client()
    assert "KeyboardInterrupt" in client.ask(do="load", file="law.toml")["error"]
    assert client.ask(do="jobs")["ok"]
    server.process.terminate()
    assert server.process.wait(60.0) == 0 and server.process.stderr is not None
    assert server.process.stderr.read() == ""  # of clients that were connected there was a traceback


def test_code_that_ends_its_process_ends_its_job_only(serve: Serve) -> None:
    server = serve()
    client, folder = server.client(), server.folder
    law = "import os\ndef control(t, r, y, state, params):\n    if t > 0.1: {}\n    return 0.0, state\n"
    for name in ("first", "law"):
        (folder / f"{name}.toml").write_text(EXPERIMENT.format(controller=f'file = "{name}.py"'))
    for ending in ("os._exit(3)", "os.abort()", "os.kill(os.getpid(), 9)"):
        said = f"{ending.partition('(')[0]}() would have ended the server of jobs; remove it"
        (folder / "first.py").write_text(f"import os\n{ending}\n")
        told = client.ask(do="load", file="first.toml")["error"]
        assert "first.py, line 2" in told and said in told
        (folder / "law.py").write_text(law.format(ending))
        job = client.ask(do="load", file="law.toml")["job"]
        client.ask(do="run", job=job)
        told = client.until_over(job)["error"]
        assert "law.py, line 3" in told and said in told


def test_texts_in_an_experiment_may_be_longer_than_names_of_files(tmp_path: Path) -> None:
    law = "params = {'note': ''}\ndef control(t, r, y, state, params):\n    return 0.0, state\n"
    (tmp_path / "law.py").write_text(law)
    text = EXPERIMENT.format(controller='file = "law.py"\n[controller.params]\nnote = "' + 60 * "a word " + '"')
    (tmp_path / "long.toml").write_text(text)
    Folder(tmp_path).check_words(tmp_path / "long.toml")
    with pytest.raises(InputError, match="is no file in"):
        Folder(tmp_path).file("ä" * 200)


def test_a_port_needs_the_secret_and_a_socket_may_do_without(serve: Serve, alone: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    refused = CliRunner().invoke(app, ["jobs", "serve", "--port", str(port), "--no-secret", "."])
    assert refused.exit_code == 2 and "it needs the secret" in refused.stderr
    server = serve(port=port)
    assert server.client().ask(do="jobs")["ok"]
    assert not server.client(with_secret=False).ask(do="jobs")["ok"]
    open_one = serve("--no-secret")
    assert open_one.client(with_secret=False).ask(do="jobs")["ok"]
    again = CliRunner().invoke(app, ["jobs", "serve", "--socket", str(open_one.socket), "."])
    assert again.exit_code == 2 and "another server of jobs listens there" in again.stderr
    sent = CliRunner().invoke(app, ["jobs", "send", "--socket", str(open_one.socket), '{"do": "jobs"}', '{"do": 1}'])
    assert sent.exit_code == 1 and sent.stdout.startswith('{"ok": true, "jobs": []}\n{"ok": false'), sent


@pytest.mark.realtime
def test_a_program_is_held_resumed_and_stopped_by_two_clients(serve: Serve) -> None:
    server = serve()
    one, two = server.client(), server.client()
    assert one.ask(do="load", file="circle.ngc", mode="emulation")["job"] == 1
    assert two.ask(do="load", file="small.ngc")["job"] == 2
    assert one.ask(do="run", job=1)["ok"]
    assert "job 1 runs, and one runs at a time" in two.ask(do="run", job=2)["error"]
    assert two.ask(do="run", job=2, queue=True)["state"] == "queued"
    one.until(1, state="running", program="runs")
    assert two.ask(do="hold", job=1)["ok"]
    held = one.until(1, program="held")
    assert two.until(1, program="held")["measured"]["X"] == pytest.approx(held["measured"]["X"], abs=0.2)  # mm
    assert "from 0 to 2" in one.ask(do="override", job=1, share=3.0)["error"]
    assert one.ask(do="override", job=1, share=0.5)["ok"]
    assert one.ask(do="resume", job=1)["ok"]
    one.until(1, program="runs", override=0.5)
    assert "stop it first" in one.ask(do="drop", job=1)["error"]
    # a client that is gone leaves the run alone
    one.ask(do="watch", job=1, period=0.05)
    one.sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
    one.close()
    assert two.until(1, program="runs")["taken"] > held["taken"]
    assert two.ask(do="stop", job=1)["ok"]
    assert two.until_over(1)["ending"] == "stopped"
    assert two.until_over(2)["ending"] == "done"
    assert "job 2 does not run: it is over; load its file again" in two.ask(do="hold", job=2)["error"]


@pytest.mark.realtime
def test_a_killed_server_leaves_the_run_to_its_safe_end(serve: Serve) -> None:
    server = serve()
    client = server.client()
    client.ask(do="load", file="small.ngc", mode="emulation")
    out = server.folder / client.ask(do="run", job=1)["out"]
    client.until(1, state="running", program="runs")
    os.kill(server.process.pid, signal.SIGKILL)
    server.process.wait()
    wait_for((out / "ending.json").exists)
    result = rds.open_result(out)
    assert result.meta["ending"] == "stopped" and abs(result["X_reference_velocity"][-1]) < 1e-6  # at rest on its path
    assert server.socket.exists()
    again = serve()  # takes the place of the one that was killed
    assert again.client().ask(do="jobs") == {"ok": True, "jobs": []}


def test_a_configuration_script_comes_over_the_socket(serve: Serve) -> None:
    """The chain of mrm-control's script: judged, written, and used by name in the next request."""
    links = ["RF01 LN1 XA0 YA90 ZA0 X-80 Y0 Z75", "RF01 LN2 XA0 YA0 ZA0 X0 Y0 Z-370"]
    script = "\n".join([*links, "RF01 LN3 XA0 YA0 ZA# X0 Y0 Z-140", "RF02 LN3 UP180 LW-180", "BUILD"])
    server = serve()
    client = server.client()
    told = client.ask(do="configure", script=script, file="own.toml")
    assert told["ok"] and told["file"] == "own.toml" and told["verdict"]["ok"]
    own = load_machine(str(server.folder / "own.toml"))
    tip = own.kinematics.forward({"C": 0.0})[:3, 3]
    assert np.abs(tip - [-80.0, 0.0, -435.0]).max() < 1e-9
    for file, said in (("own.toml", "is there already"), ("../x.toml", "leads out of"), ("a.txt", "end with .toml")):
        assert said in client.ask(do="configure", script=script, file=file)["error"]
    wrong = client.ask(do="configure", script=script.replace("LN2", "LN4"), file="wrong.toml")
    assert wrong["error"].startswith("script, line 2: LN4 out of order") and not (server.folder / "wrong.toml").exists()
    fixed = client.ask(do="configure", script=script.replace("X-80", "X0").replace("YA90", "YA0"), file="none.toml")
    assert fixed["ok"] and not fixed["verdict"]["ok"] and fixed["file"] is None, "turns the tool about itself"
    assert not (server.folder / "none.toml").exists()
    told = client.ask(do="configure", script="RF02 LN3 UP90 LW-45", file="narrow.toml", like="own.toml")
    assert told["ok"], "limits of a machine that is there, without its links"
    assert load_machine(str(server.folder / "narrow.toml")).kinematics.limits.tolist() == [[-45.0, 90.0]]
    alone = client.ask(do="configure", script="RF02 LN3 UP90 LW-45", file="more.toml")
    assert "name it (`like`)" in alone["error"]


def test_the_documents_client(alone: Path) -> None:
    found = blocks("docs/jobs.md")
    save(found, alone)
    (program,) = (block for block in found if block.file == "client.py")
    assert sum(bool(line) for line in program.text.splitlines()) <= 10
    run = subprocess.Popen(
        [sys.executable, "-m", "rds", "jobs", "serve", "--socket", "jobs.sock", "."],
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert run.stderr is not None and "Ctrl-C ends" in run.stderr.readline()
        done = subprocess.run([sys.executable, "client.py"], capture_output=True, text=True, timeout=60.0)
    finally:
        run.terminate()
        run.wait(30.0)
        assert run.stderr is not None
        run.stderr.close()
    assert done.returncode == 0 and done.stdout.rstrip().endswith("done"), done


def test_the_document_names_every_request() -> None:
    text = Path(__file__).parents[2].joinpath("docs", "jobs.md").read_text()
    for verb, table in VERBS.items():
        row = next(line for line in text.splitlines() if line.startswith(f"| `{verb}` |"))
        assert all(f"`{key}`" in row for key in table.keys), verb


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="no terminal that hangs up")
def test_a_closed_terminal_ends_the_server_in_order(serve: Callable[..., Server]) -> None:
    server = serve()
    server.process.send_signal(signal.SIGHUP)
    assert server.process.wait(60.0) == 0
