"""`rds bus ...` as a user runs it: real processes on the built-in bus."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest
from typer.testing import CliRunner
from waiting import wait_for

from bus_tools.made_frames import frame
from rds.bus.hub.faults import Faults
from rds.bus.tools.logs import LogFile, LogWriter
from rds.cli.main import app

Opener = Callable[..., can.BusABC]


@pytest.fixture
def rds() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts `rds bus ARGUMENTS --channel test`."""
    processes = []

    def run(*arguments: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "rds.cli.bus", *arguments, "--channel", "test"]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        processes.append(process)
        return process

    yield run
    for process in processes:
        process.kill()
        process.communicate()


def end(process: subprocess.Popen[str], code: int = 0) -> tuple[str, str]:
    """What it has said on stdout and stderr."""
    out, err = process.communicate(timeout=60)
    assert process.returncode == code, err
    return out, err


def here(*arguments: str, code: int = 0) -> tuple[str, str]:
    """What `rds bus ARGUMENTS --channel test` says on stdout and stderr, in this process."""
    done = CliRunner().invoke(app, ["bus", *arguments, "--channel", "test"])
    assert done.exit_code == code, done.stderr
    return done.stdout, done.stderr


def busy(bus: can.BusABC) -> can.CyclicSendTaskABC:
    return bus.send_periodic(frame(0x700, b"\x01\x02"), 0.005)


def test_monitor_prints_one_json_object(rds: Callable[..., subprocess.Popen[str]], open_bus: Opener) -> None:
    task = busy(open_bus())
    out, err = end(rds("monitor", "--seconds", "1.5", "--json"))
    task.stop()
    seen = json.loads(out)
    (row,) = seen["identifiers"]
    assert row["identifier"] == "0x700" and row["data"] == "0102"
    assert row["rate_hz"] == pytest.approx(200.0, rel=0.15)
    assert row["period_ms"] == pytest.approx(5.0, rel=0.15)
    assert seen["load_percent"] == pytest.approx(200 * 68e-6 * 100, rel=0.3)
    assert seen["lost"] == 0 and not seen["faults"] and not err


def test_monitor_prints_one_table_in_a_pipe(open_bus: Opener) -> None:
    task = busy(open_bus())
    out, _ = here("monitor", "--seconds", "0.5")
    task.stop()
    assert out.count("identifier") == 1 and "0x700" in out and "rds:test: active" in out


def test_monitor_reports_a_killed_hub(
    rds: Callable[..., subprocess.Popen[str]], hub: Callable[..., subprocess.Popen[str]], open_bus: Opener
) -> None:
    process = hub("test")
    open_bus()  # a hub without nodes leaves after some seconds, and a monitor may take longer to start
    with Faults("test") as faults:
        others = len(faults.nodes())
        watcher = rds("monitor", "--seconds", "3", "--json")
        wait_for(lambda: len(faults.nodes()) > others, every=0.05)
    time.sleep(0.5)  # it is reading, not only there
    process.kill()
    out, err = end(watcher, 1)
    assert len(json.loads(out)["faults"]) == 1
    assert err.count("failed") == 1 and "it is opened again" in err


def test_record_until_ctrl_c_and_replay(
    rds: Callable[..., subprocess.Popen[str]], open_bus: Opener, tmp_path: Path
) -> None:
    path = tmp_path / "a.asc"
    recorder = rds("record", str(path), "--json")
    assert recorder.stderr is not None and "recording rds:test" in recorder.stderr.readline()
    bus = open_bus()
    for k in range(50):
        bus.send(frame(0x790, bytes([k])))
    wait_for(lambda: path.read_bytes().count(b" 790 ") == 50)
    recorder.send_signal(signal.SIGINT)
    result = json.loads(end(recorder)[0])
    assert result["frames"] == 50 and result["complete"] and result["lost"] == 0
    out, err = end(rds("replay", str(path), "--json"))
    assert json.loads(out)["sent"] == 50 and not err
    found = [message.data[0] for _ in range(50) if (message := bus.recv(10.0))]
    assert found == list(range(50)) and bus.recv(0.2) is None


def test_a_replay_says_that_a_log_has_frames_of_several_channels(open_bus: Opener, tmp_path: Path) -> None:
    open_bus()
    path = tmp_path / "a.log"
    path.write_text("(1.0) can0 790#01\n(1.1) can1 790#02\n")
    out, err = here("replay", str(path), "--speed", "inf", "--json")
    assert json.loads(out)["channels"] == ["can0", "can1"]
    assert "frames of 2 channels (can0, can1) went onto this one bus" in err
    path.write_text("(1.0) can0 790#01\n(1.1) can0 790#02\n")
    assert "channels" not in here("replay", str(path), "--speed", "inf")[1]


def test_a_recording_that_is_not_complete_says_so(
    rds: Callable[..., subprocess.Popen[str]], open_bus: Opener, tmp_path: Path
) -> None:
    recorder = rds("record", str(tmp_path / "a.trc"), "--seconds", "1")
    assert recorder.stderr is not None
    recorder.stderr.readline()
    bus = open_bus()
    bus.send(frame(0x700, is_remote_frame=True))
    _, err = end(recorder, 1)
    assert "1 remote frames are not in the log" in err


@pytest.mark.parametrize(
    "arguments, word",
    [
        (["record", "{here}/exists.log"], "--force"),
        (["record", "{here}/a.txt"], "end the name in"),
        (["record", "{here}/no/such/folder/a.log"], "No such file or directory"),
        (["record", "{here}/a.log", "--id", "x"], "'x' is no identifier"),
        (["replay", "{here}/none.log"], "there is no such log"),
        (["replay", "{here}/bad.log"], "bad.log:1: "),
        (["replay", "{here}/exists.log", "--speed", "0"], "speed 0.0"),
        (["replay", "{here}/exists.log", "--from", "2", "--to", "1"], "no span of a log"),
        (["monitor", "--dbc", "{here}/none.dbc"], "no such DBC"),
        (["monitor", "--interface", "no-such"], "can't be opened"),
        (["record", "{here}/a.log", "--interface", "no-such"], "can't be opened"),
        (["serve-socketcand", "--host", "0.0.0.0"], "loopback"),
    ],
)
def test_bad_input_is_refused_with_a_sentence(arguments: list[str], word: str, tmp_path: Path) -> None:
    (tmp_path / "bad.log").write_text("rubbish\n")
    log = LogWriter(tmp_path / "exists.log")
    log.write(frame(0x700))
    log.close()
    out, err = here(*(argument.format(here=tmp_path) for argument in arguments), code=2)
    assert not out
    assert err.startswith("rds: ") and word in err and "Traceback" not in err
    assert len(err.splitlines()) == 1
    assert len(list(LogFile(tmp_path / "exists.log"))) == 1


def test_a_socketcand_server_until_ctrl_c(rds: Callable[..., subprocess.Popen[str]], open_bus: Opener) -> None:
    server = rds("serve-socketcand", "--port", "0")
    assert server.stderr is not None
    port = int(server.stderr.readline().split("port ")[1].split(";")[0])
    name = server.stderr.readline().split("open it as ")[1].split()[0]
    assert name.startswith("test.")
    bus = open_bus()
    with can.Bus(interface="socketcand", channel=name, host="127.0.0.1", port=port, tcp_tune=True) as tool:
        tool.send(frame(0x790, b"\x05"))
        found = bus.recv(10.0)
        assert found is not None and found.data == b"\x05"
    server.send_signal(signal.SIGINT)
    assert "left out" not in end(server)[1]


def test_commands_are_replayed_only_by_one_host(open_bus: Opener, tmp_path: Path) -> None:
    from rds.bus.hub.command import Command

    log = LogWriter(tmp_path / "a.log")
    log.write(frame(0x010, bytes(8)))
    log.close()
    with Command("test"):
        _, err = here("replay", str(tmp_path / "a.log"), "--with-commands", code=2)
    assert "another run commands the machine" in err
    here("replay", str(tmp_path / "a.log"), "--with-commands")
