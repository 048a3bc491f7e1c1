"""The command line as a script sees it: exit codes, one JSON object, sentences on stderr."""

from __future__ import annotations

import errno
import json
import os
import queue
import re
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import rds
from rds.__main__ import open_streams
from rds.cli.main import HEADINGS, app, progress_bars

SIMULATION = """
axis = "X"
mode = "simulation"
duration = 2.0
[reference]
kind = "sinusoid"
amplitude = 2.0
frequency = 1.0
[controller]
file = "law.py"
"""
LAW = "def control(t, r, y, state, params):\n    return 20.0 * (r.position - y), state\n"
PRINTS = """
import os
print("loading")
def control(t, r, y, state, params):
    print("calling", t)
    if t == 0:
        os.system("echo from a shell")
        os.write(1, b"straight to the descriptor")
    return 20.0 * (r.position - y), state
"""
SLOW = "import time\ndef control(t, r, y, state, params):\n    time.sleep(0.002)\n    return 0.5, state\n"

METRICS = {"mean_error", "std_error", "mean_abs_error", "std_abs_error", "max_abs_error", "rms_error"}


@pytest.fixture
def folder(alone: Path) -> Path:
    (alone / "e.toml").write_text(SIMULATION)
    (alone / "law.py").write_text(LAW)
    (alone / "part.ngc").write_text("G21 G1 X1 F60\nM2\n")
    (alone / "model.py").write_text(
        "def derivatives(t, x, u, params):\n    return [x[1], 100.0 * (2.0 * u[0] - x[1])]\n"
    )
    return alone


def command(*arguments: str) -> subprocess.CompletedProcess[str]:
    """`rds` with these arguments, in pipes."""
    return subprocess.run(
        [sys.executable, "-m", "rds.cli.main", *arguments], capture_output=True, text=True, timeout=120
    )


def call(*arguments: str) -> Any:
    """The same in this process."""
    return CliRunner().invoke(app, list(arguments))


def only_json(stdout: str) -> dict[str, Any]:
    """The one JSON object that is all of stdout; NaN is no JSON."""
    value = json.loads(stdout, parse_constant=lambda word: pytest.fail(f"{word} in JSON"))
    assert isinstance(value, dict)
    assert stdout.count("\n") == 1
    return value


def test_a_simulation(folder: Path) -> None:
    done = command("run", "e.toml", "--out", "out", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    said = only_json(done.stdout)
    assert (said["mode"], said["verdict"], said["timing"], said["ending"]) == ("simulation", None, None, "done")
    assert set(said["axes"]["X"]) >= METRICS
    result = rds.open_result(folder / "out")
    assert said["axes"]["X"]["rms_error"] == result.metrics["X"]["rms_error"]
    assert set(said["files"]) == {"csv", "json", "mat", "parquet", "plot_X", "report"}
    assert all((folder / path).stat().st_size for path in said["files"].values())
    assert sorted(path.name for path in (folder / "out").iterdir()) == sorted(
        Path(path).name for path in said["files"].values()
    )


def test_in_words(folder: Path) -> None:
    done = call("run", "e.toml", "--out", "out")
    assert (done.exit_code, done.stderr) == (0, "")
    assert "Tracking error, simulation" in done.stdout
    assert "report: out/report.html" in done.stdout
    assert "\x1b" not in done.stdout


@pytest.mark.realtime
def test_real_time(folder: Path) -> None:
    (folder / "e.toml").write_text(SIMULATION.replace("duration = 2.0", "duration = 1.0"))
    done = call("run", "e.toml", "--mode", "implementation", "--out", "out", "--json")
    said = only_json(done.stdout)
    assert said["verdict"] in ("met", "missed", "void")
    assert done.exit_code == (1 if said["verdict"] == "missed" else 0)
    assert said["verdict"] == "met" or f"timing {said['verdict']}" in done.stderr
    assert said["axes"]["X"]["fit_percent"] > 50
    for stage in ("lateness", "io", "compute", "model"):
        assert set(said["timing"][stage]) == {"p50", "p99", "p999", "max"}
    assert said["timing"]["samples"] <= 1000
    assert said["environment"]["sentence"]


@pytest.mark.realtime
def test_a_missed_verdict_is_exit_code_1(folder: Path) -> None:
    (folder / "law.py").write_text(SLOW)
    (folder / "e.toml").write_text(SIMULATION.replace("duration = 2.0", "duration = 0.5"))
    done = call("run", "e.toml", "-m", "emulation", "-o", "out", "--json")
    said = only_json(done.stdout)
    assert (done.exit_code, said["verdict"]) == (1, "missed")
    assert "rds: timing missed: " in done.stderr
    assert "control() and the model took " in done.stderr
    (folder / "law.py").write_text(LAW)  # the record says what ran, not what is there now
    assert "time.sleep" in rds.open_result(folder / "out").meta["controller"]["X"]["source"]


@pytest.mark.parametrize("mode", ["simulation", pytest.param("emulation", marks=pytest.mark.realtime)])
def test_stdout_is_the_json_s_whatever_the_student_prints(folder: Path, mode: str) -> None:
    (folder / "law.py").write_text(PRINTS)
    (folder / "e.toml").write_text(SIMULATION.replace("2.0", "0.2", 1))
    done = command("run", "e.toml", "--mode", mode, "--out", "out", "--json")
    assert only_json(done.stdout)["mode"] == mode
    assert "loading" in done.stderr
    if mode == "simulation":
        assert all(word in done.stderr for word in ("calling 0.1", "from a shell", "straight to the descriptor"))
        assert only_json(command("check", "law.py", "--json").stdout)


BAD_INPUT = [
    (["run", "gone.toml"], "gone.toml: cannot be read: No such file"),
    (["run", "e.toml", "--mode", "fly"], "unknown mode 'fly'; known modes: simulation"),
    (["run", "e.toml", "--mode", ""], "unknown mode ''; known modes: simulation"),
    (["run", "e.toml", "--mode", "system-test"], "give [signal]"),
    (["run", "law.py"], "law.py: it is a Python file: an experiment names it"),
    (["run", "part.ngc"], "part.ngc: it is a part program: `rds nc run` runs it"),
    (["run", "e.toml", "--out", "law.py"], "law.py"),
    (["run", "e.toml", "-m", "emulation", "--out", "law.py"], "law.py: is a file, not a folder"),
    (["check", "log.csv"], "log.csv: it is no Python file; `rds data describe` looks at a log"),
    (["data", "describe", "e.toml"], "`rds validate` takes the model first, then logs"),
    (["check", "gone.py"], "gone.py: there is no such file"),
    (["check", "e.toml"], "it looks like an experiment, which `rds run` takes"),
    (["check", "law.py", "--sample-period", "0"], "must be from 1e-06 to 1000 s"),
    (["check", "model.py", "--axes", "2"], "it defines no control(t, r, y, state, params)"),
    (["check", "e.toml", "--axes", "2"], "--axes 2 is for a coupled controller"),
    (["compare", "gone", "law.py"], "gone"),
    (["machine", "serve", "gone"], "there is no machine 'gone'; known machines: lathe, mini-cnc"),
    (["machine", "serve", "mini-cnc", "--interface", "gone"], "gone"),
]


@pytest.mark.parametrize(
    ("arguments", "said", "json"),
    [
        (arguments, said, json)
        for arguments, said in BAD_INPUT
        for json in ([False] if arguments[0] == "machine" else [True, False])  # which has no --json
    ],
)
def test_bad_input_is_exit_code_2_and_a_sentence(folder: Path, arguments: list[str], said: str, json: bool) -> None:
    before = sorted(folder.rglob("*"))
    done = call(*arguments, *(["--json"] if json else []))
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr.startswith("rds: ")
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert sorted(folder.rglob("*")) == before


def test_bad_usage_is_exit_code_2(folder: Path) -> None:
    forever = ["nc", "time", "part.ngc", "--sample-period", "inf"]
    for arguments in (["run"], ["fly"], ["machine"], [], forever):
        done = call(*arguments)
        assert done.exit_code == 2, arguments
        assert isinstance(done.exception, SystemExit), arguments
    process = command("run", "e.toml", "--jsn")
    assert process.returncode == 2
    assert "Traceback" not in process.stderr


def test_a_fault_of_the_student_s_code_is_exit_code_2(folder: Path) -> None:
    (folder / "law.py").write_text(LAW.replace("20.0", "1 / (0.5 - t)"))
    done = command("run", "e.toml", "--out", "out", "--json")
    assert (done.returncode, done.stdout) == (2, "")
    assert "law.py, line 2, in control: ZeroDivisionError" in done.stderr
    assert "(at t = 0.500 s)" in done.stderr
    assert len(rds.open_result(folder / "out")["time"]) == 500  # what was before it is kept


def test_a_class_of_the_student_s_that_fails_when_it_is_looked_at_is_told_with_its_line(folder: Path) -> None:
    (folder / "odd.py").write_text("class Odd:\n    def __array__(self, *rest):\n        raise RuntimeError('odd')\n")
    (folder / "model.py").write_text(
        "from odd import Odd\ninitial_state = Odd()\ndef derivatives(t, x, u, params):\n    return [x[1], 0.0]\n"
    )
    (folder / "e.toml").write_text(SIMULATION + "[model]\nfile = 'model.py'\n")
    done = call("run", "e.toml", "--out", "out")
    assert (done.exit_code, done.stderr) == (
        2,
        "rds: odd.py, line 3, in __array__: RuntimeError: odd: `raise RuntimeError('odd')`\n",
    )


def test_check(folder: Path) -> None:
    good = call("check", "law.py", "--json")
    assert good.exit_code == 0
    assert only_json(good.stdout)
    assert "controller" in call("check", "law.py").stdout
    (folder / "bad.py").write_text("def control(t, r, y, state, params):\n    return float('nan'), state\n")
    bad = call("check", "bad.py", "--json")
    assert bad.exit_code == 1
    assert "finite" in json.dumps(only_json(bad.stdout))
    assert "finite" in call("check", "bad.py").stdout


def test_a_coupled_controller_is_checked_with_as_many_axes_as_are_said(folder: Path) -> None:
    (folder / "law.py").write_text(
        "def control(t, r, y, state, params):\n    x, y, z = r.position - y\n    return [x, y, z], state\n"
    )
    assert call("check", "law.py", "--axes", "3").exit_code == 0
    two, one = call("check", "law.py", "--axes", "2"), call("check", "law.py")
    assert (two.exit_code, one.exit_code) == (1, 1)
    assert "not enough values to unpack (expected 3, got 2)" in two.stdout


def test_compare(folder: Path) -> None:
    rds.Experiment.from_toml("e.toml").run(out="a")
    (folder / "law.py").write_text(LAW.replace("20.0", "30.0"))
    rds.Experiment.from_toml("e.toml").run(out="b")
    same, different = call("compare", "a", "a", "--json"), call("compare", "a", "b/result.csv", "--json")
    assert same.exit_code == different.exit_code == 0
    assert only_json(same.stdout) != only_json(different.stdout)
    assert "X" in call("compare", "a", "b").stdout


def test_machine_list(folder: Path) -> None:
    said = only_json(call("machine", "list", "--json").stdout)
    assert said["mini-cnc"]["axes"] == ["X", "Y", "Z", "spindle"]
    assert "-75 to 75 mm" in call("machine", "list").stdout


@pytest.mark.realtime
def test_a_served_machine_ends_by_ctrl_c(folder: Path) -> None:
    import signal

    served = subprocess.Popen(
        [sys.executable, "-m", "rds.cli.main", "machine", "serve", "mini-cnc"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert served.stderr is not None and served.stdin is not None
    try:
        assert "Ctrl-C ends" in served.stderr.readline()
        (folder / "e.toml").write_text(SIMULATION.replace("duration = 2.0", "duration = 0.2"))
        done = call("run", "e.toml", "-m", "implementation", "-o", "out", "--json")
        assert only_json(done.stdout)["mode"] == "implementation"
        served.stdin.write("2 emergency on\n")  # a hand at the button of X
        served.stdin.flush()
        assert any("emergency stop" in line for line in iter(served.stderr.readline, ""))
        served.send_signal(signal.SIGINT)
        _, errors = served.communicate(timeout=60)
    finally:
        served.kill()
    assert "Traceback" not in errors
    assert served.returncode in (0, 130)


def test_hands_are_heard_again_when_a_server_comes_to_the_front(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the background of a terminal a read is an error (EIO), and is no end of the lines."""
    from rds.bus.modules import server_program

    said: list[Any] = [OSError(errno.EIO, "in the background"), b"2 emergency on\n2 em", b"ergency off\n", b""]

    def read(descriptor: int, size: int) -> bytes:
        word = said.pop(0)
        if isinstance(word, OSError):
            raise word
        return bytes(word)

    monkeypatch.setattr(server_program.os, "read", read)
    monkeypatch.setattr(server_program, "_BACKGROUND", 0.0)
    lines, ended = queue.SimpleQueue[str](), threading.Event()
    server_program._read_stdin(lines, ended)
    assert [lines.get(), lines.get()] == ["2 emergency on", "2 emergency off"] and ended.is_set()


def test_a_flood_of_lines_does_not_stop_a_server(monkeypatch: pytest.MonkeyPatch) -> None:
    from rds.bus.modules import buttons, server_program

    said = [b"\0" * 4096] * 100 + [b"\n", b"yes\n" * 50 + b"2 emergency on", b""]  # the last line lacks its end
    monkeypatch.setattr(server_program.os, "read", lambda *_: said.pop(0))
    monkeypatch.setattr(server_program, "_FULL", 1e-3)
    lines = queue.SimpleQueue[str]()
    reader = threading.Thread(target=server_program._read_stdin, args=(lines, None), daemon=True)
    reader.start()
    heard: list[str] = []
    while reader.is_alive() or not lines.empty():
        assert lines.qsize() <= 20
        if not lines.empty():
            heard.append(lines.get())
    assert len(heard[0]) <= 2 * 4096 and heard[1:] == ["yes"] * 50 + ["2 emergency on"]

    class Endless(queue.SimpleQueue[str]):
        def get(self, *_: Any) -> str:
            self.put("yes")
            return super().get()

    endless = Endless()
    endless.put("yes")
    buttons.press_buttons(endless, [])  # it ends


def test_help_is_quick() -> None:
    """Nothing heavy is imported for it."""
    done = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "rds.cli.main", "--help"], capture_output=True, text=True
    )
    assert done.returncode == 0
    assert all(word in done.stdout for word in ("demo", "run", "check", "machine", "compare"))
    imported = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert "typer" in imported
    assert not imported & {"numpy", "scipy", "pandas", "pyarrow", "matplotlib", "control", "numba", "can", "IPython"}


def test_progress_is_for_terminals(folder: Path) -> None:
    with progress_bars() as bar:
        bar("run")(1, 2)
    main, pipe = os.openpty()
    arguments = [sys.executable, "-m", "rds.cli.main", "run", "e.toml", "--out", "out", "--json"]
    on_terminal = subprocess.run(arguments, stdout=subprocess.PIPE, stderr=pipe, text=True, timeout=60)
    os.close(pipe)
    shown = os.read(main, 65536).decode(errors="replace")
    os.close(main)
    assert "simulation" in shown or "run" in shown
    only_json(on_terminal.stdout)  # in a pipe, nothing is shown: test_a_simulation


def test_ctrl_c_during_the_imports_is_no_traceback() -> None:
    program = """
import sys
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "typer":
            raise KeyboardInterrupt
sys.meta_path.insert(0, Finder())
from rds.__main__ import main
main()
"""
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "rds: stopped by Ctrl-C\n")


def test_the_package_is_the_command() -> None:
    shown = subprocess.run([sys.executable, "-m", "rds", "machine", "list"], capture_output=True, text=True, timeout=60)
    assert shown.returncode == 0 and "mini-cnc" in shown.stdout


def test_hints_fit_what_was_asked(tmp_path: Path) -> None:
    report = call("report", "acuracy", "x.csv")
    assert report.exit_code == 2 and "there is no report 'acuracy'" in report.stderr
    assert "from a file" not in report.stderr
    bus = call("scan", "--interface", "nothing", "--channel", "x")
    assert bus.exit_code == 2 and "check interface, channel and options" in bus.stderr
    for number in range(40):
        (tmp_path / f"table{number:02}.csv").write_text("time\n0\n")
    several = call("compare", str(tmp_path), str(tmp_path))
    assert several.exit_code == 2 and "table05.csv and 34 more); name one" in several.stderr
    assert "table06.csv" not in several.stderr


def test_a_command_is_built_alone_and_what_names_none_lists_all() -> None:
    def built(*words: str) -> set[str]:
        done = subprocess.run(
            [sys.executable, "-c", _BUILT, *words], capture_output=True, text=True, check=True, stdin=subprocess.DEVNULL
        )
        return set(done.stdout.split())

    everything = built()
    assert {"run", "fit", "grade", "machine"} <= everything
    assert built("bogus") == built("--help") == everything
    assert built("fit", "--help") < everything and "fit" in built("fit", "--help")
    assert "check" in built("grade", "check") and "machine" not in built("grade", "check")


def test_help_lists_every_command_under_a_heading_in_order() -> None:
    shown = call("--help").stdout
    places = [shown.index(f"─ {heading} ─") for heading in HEADINGS]
    assert places == sorted(places) and "─ Commands ─" not in shown
    listed = [line.split()[1] for line in shown[places[0] :].splitlines() if re.match("│ [a-z]", line)]
    assert listed == [name for names in HEADINGS.values() for name in names]


def test_it_tells_its_version() -> None:
    assert call("--version").stdout == f"rds {rds.__version__}\n"


_BUILT = """
import sys
from typer.main import get_command
from rds.cli.main import app, narrow
narrow(app, sys.argv[1:])
group = get_command(app)
names = [*group.commands]
if sys.argv[1:2] == ["grade"]:
    names += group.commands["grade"].commands
print(*names)
"""


def test_no_help_loses_a_word_in_brackets() -> None:
    """Rich takes `[word]` for markup and prints nothing of it; `\\[word]` and `[0, 1]` stand as they are."""
    from typer.main import get_command

    from rds.cli.main import app

    markup = re.compile(r"(?<!\\)\[[a-z#/@][^\[\]]*\]")
    known = re.compile(r"\[/?(bold|dim|italic)\]")
    seen, lost = 0, []
    open_ = [("rds", get_command(app))]
    while open_:
        name, command = open_.pop()
        open_ += [(f"{name} {key}", inner) for key, inner in getattr(command, "commands", {}).items()]
        texts = [command.help, command.epilog, *(getattr(parameter, "help", None) for parameter in command.params)]
        seen += 1
        lost += [f"{name}: {found[0]}" for text in texts for found in markup.finditer(known.sub("", text or ""))]
    assert seen > 60 and not lost, lost


def test_a_model_that_overflows_is_told_without_lines_of_the_package(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("def derivatives(t, x, u, params):\n    return [x[1], 1e9 * (u[0] - x[1])]\n")
    words = 'axis = "X"\nduration = 0.1\n[signal]\nkind = "constant"\nvalue = 2.0\n[model]\nfile = "mine.py"\n'
    (tmp_path / "loop.toml").write_text(words)
    done = command("run", str(tmp_path / "loop.toml"), "--out", str(tmp_path / "out"))
    assert done.returncode == 2 and "the model's position became" in done.stderr
    assert "integrate.py" not in done.stderr


def test_a_closed_stdin_leaves_its_number_to_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    """The lock of a channel got the number 0, which its hub took for a stdin: the hub was started again and again."""
    kept = os.dup(0)
    try:
        os.close(0)
        monkeypatch.setattr(sys, "stdin", None)
        open_streams()
        assert os.fstat(0).st_rdev == os.stat(os.devnull).st_rdev
        assert sys.stdin.read() == ""
    finally:
        os.dup2(kept, 0)
        os.close(kept)
