"""Runs that end badly, in real processes: killed at random, the disk full, memory leaked, Ctrl-C; counted, as a page.

python -m benchmarks.endings [--minutes 3] [--soak MINUTES] [--case NAME ...] [--seed 1] [--write docs/endings.md]

Each trial is a run of two seconds at 100 Hz by the command line, in a folder and a runtime directory of its own. It is
*right* if the command ends within a minute with an exit code of the documents, its record opens or stderr says why
there is none, and no process and no shared memory of it is left.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from rds.core.errors import RdsError
from rds.modes.process.recorder import PROCESSES
from rds.results import open_result

_ABOUT = """Runs that end badly, in real processes; `python -m benchmarks.endings --write docs/endings.md` makes this
page. Each is a run of three axes for two seconds at 100 Hz, by `rds run`; what is done to it is done at a random
moment, most often while it starts or runs. *Right* means: the command ends within a minute with an exit code of
[the documents](commands.md), the record opens or stderr says why there is none, and no process and no shared memory is
left. Ctrl-C before Python has loaded the first line of ours is Python's own affair. A disk without room is a limit on
the size of files, which every process of the run has.
""".splitlines()
PATIENCE = 60.0  # s for a command to end
LINGER = 20.0  # s for its hub and its machine to notice that nobody needs them
CODES = (0, 1, 2, 130)
HERE = Path(__file__).resolve().parents[1]
_EXPERIMENT = """
machine = "mini-cnc"
axes = ["X", "Y", "Z"]
duration = {seconds}
sample_period = 0.01
[reference]
kind = "sinusoid"
amplitude = 1.0
frequency = 1.0
[controller]
{controller}
"""
_LAW = 'name = "pid"\nPgain = 10.0'
_LEAK = """
kept = []
def control(t, r, y, state, params):
    kept.append(bytearray(6_000_000))
    return 10.0 * (r.position - y), state
"""


@dataclass
class Trial:
    """One run, and what was done to it."""

    folder: Path
    runtime: Path
    command: subprocess.Popen[str]
    chance: random.Random

    def until(self, fraction: float = 1.0) -> None:
        """Wait for some moment: from the command's start to beyond the middle of its run."""
        end = time.monotonic() + self.chance.uniform(0.0, 6.0) * fraction
        while time.monotonic() < end and self.command.poll() is None:
            time.sleep(0.01)

    def process(self, name: str) -> int | None:
        """A process of the run, once there is one: "target", "recorder"; None if it ends before."""
        while self.command.poll() is None:
            with suppress(OSError, ValueError, KeyError):
                return int(json.loads((self.folder / "out" / PROCESSES).read_text())[name])
            time.sleep(0.01)
        return None

    def others(self, word: str) -> list[int]:
        """Processes of this trial whose command has a word in it, once there are any."""
        while self.command.poll() is None:
            if found := [number for number, command in processes(self.runtime).items() if word in command]:
                return found
            time.sleep(0.02)
        return []


def processes(runtime: Path) -> dict[int, str]:
    """Processes that have this runtime directory in their environment, but for those that are ending."""
    found = {}
    for environ in Path("/proc").glob("[0-9]*/environ"):
        with suppress(OSError):
            if str(runtime).encode() in environ.read_bytes():
                command = (environ.parent / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
                if command:
                    found[int(environ.parent.name)] = command
    return found


def _kill(name: str) -> Callable[[Trial], None]:
    def kill(trial: Trial) -> None:
        number = trial.process(name)
        trial.until(0.8)
        _end(number)

    return kill


def _kill_others(word: str) -> Callable[[Trial], None]:
    def kill(trial: Trial) -> None:
        found = trial.others(word)
        trial.until(0.8)
        for number in found:
            _end(number)

    return kill


def _end(number: int | None, how: signal.Signals = signal.SIGKILL) -> None:
    if number is not None:
        with suppress(ProcessLookupError):
            os.kill(number, how)


def _interrupt(trial: Trial) -> None:
    trial.until()
    _end(trial.command.pid, signal.SIGINT)


def _interrupt_often(trial: Trial) -> None:
    for _ in range(3):
        trial.until(0.4)
        _end(trial.command.pid, signal.SIGINT)


def _kill_host(trial: Trial) -> None:
    trial.until()
    _end(trial.command.pid)


def _nothing(trial: Trial) -> None:
    """The run itself is the trouble."""


@dataclass(frozen=True)
class Case:
    """What is done to a run, in which modes."""

    what: str
    does: Callable[[Trial], None] = _nothing
    modes: tuple[str, ...] = ("emulation", "implementation")
    room: int | None = None  # bytes that a file of it may have
    leaks: bool = False


CASES = {
    "undisturbed": Case("nothing"),
    "ctrl-c": Case("Ctrl-C at a random moment, its start included", _interrupt),
    "ctrl-c-thrice": Case("Ctrl-C three times", _interrupt_often),
    "host": Case("the command is killed", _kill_host),
    "target": Case("the process of the loop is killed", _kill("target")),
    "recorder": Case("the recorder is killed", _kill("recorder")),
    "server": Case("the modules' server is killed in the middle", _kill_others(".server"), ("implementation",)),
    "hub": Case("the bus's hub is killed", _kill_others("rds.bus.hub.hub"), ("implementation",)),
    "full-0": Case("no room on the disk at all", room=0),
    "full-4k": Case("room for 4 KiB a file: the record begins", room=4096),
    "full-32k": Case("room for 32 KiB a file: the results end in the middle", room=32_768),
    "full-200k": Case("room for 200 KiB a file: the report or a picture ends in the middle", room=200_000),
    "leak": Case("the controller leaks 1.2 GB", modes=("emulation",), leaks=True),
}


@dataclass
class Count:
    """Of one case and mode."""

    runs: int = 0
    right: int = 0
    endings: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)


def attempt(case: Case, mode: str, chance: random.Random, seconds: float = 2.0) -> tuple[str, str]:
    """One trial: how it ended, and what was wrong, or nothing."""
    runtime = Path(tempfile.mkdtemp(prefix="rds", dir="/tmp"))
    rings = set(Path("/dev/shm").glob("rds-*"))
    with tempfile.TemporaryDirectory(prefix="rds-endings-") as name:
        folder = Path(name)
        (folder / "leak.py").write_text(_LEAK)
        controller = 'file = "leak.py"' if case.leaks else _LAW
        (folder / "run.toml").write_text(_EXPERIMENT.format(seconds=seconds, controller=controller))
        command = subprocess.Popen(
            [sys.executable, "-m", "rds", "run", str(folder / "run.toml"), "--mode", mode, "-o", str(folder / "out")],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            cwd=HERE,
            env=os.environ | {"XDG_RUNTIME_DIR": str(runtime)},
            preexec_fn=None if case.room is None else lambda: _limit(case.room or 0),
        )
        try:
            case.does(Trial(folder, runtime, command, chance))
            _, said = command.communicate(timeout=PATIENCE + seconds)
        except subprocess.TimeoutExpired:
            command.kill()
            _, said = command.communicate()
            return "hangs", f"it had not ended after {PATIENCE:g} s: {said[-300:]}"
        ending, wrong = _judge(command.returncode, folder / "out", said, runtime)
        left = _left(runtime)
        if not wrong and left:
            wrong = f"left running: {left}"
        if not wrong and (forgotten := set(Path("/dev/shm").glob("rds-*")) - rings) and not _mapped(forgotten):
            wrong = f"left in shared memory: {forgotten}"
    shutil.rmtree(runtime, ignore_errors=True)
    return ending, wrong


def _limit(size: int) -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def _judge(code: int, out: Path, said: str, runtime: Path) -> tuple[str, str]:
    killed = code == -signal.SIGKILL
    if code in (1, -signal.SIGINT) and "Traceback" in said and f"{HERE}/rds/" not in said:
        return "before Python had begun", ""
    if not killed and code not in CODES:
        return f"exit code {code}", f"exit code {code}: {said[-300:]}"
    if "Traceback" in said:
        return "traceback", said[:200] + " ... " + said[-300:]
    if killed:  # the run goes on without its host, to its end
        end = time.monotonic() + LINGER
        while any("recorder" in command for command in processes(runtime).values()) and time.monotonic() < end:
            time.sleep(0.1)
    try:
        return str(open_result(out / "result.csv" if (out / "result.csv").exists() else out).meta["ending"]), ""
    except RdsError as error:
        if killed or said.strip():
            return "no record, and why", ""
        return "no record", str(error)


def _left(runtime: Path) -> dict[int, str]:
    for number, command in processes(runtime).items():
        if "rds.bus.hub.hub" in command or "--exit-with-stdin" in command:  # they would stay for the next run
            _end(number, signal.SIGTERM)
    end = time.monotonic() + LINGER
    while (left := processes(runtime)) and time.monotonic() < end:
        time.sleep(0.1)
    for number in left:
        _end(number)
    return left


def _mapped(rings: set[Path]) -> bool:
    """Whether a process, of whichever run, still has one of these."""
    for maps in Path("/proc").glob("[0-9]*/maps"):
        with suppress(OSError):
            text = maps.read_text()
            if any(str(ring) in text for ring in rings):
                return True
    return False


def run(minutes: float, chosen: list[str] | None, seed: int) -> dict[tuple[str, str], Count]:
    """All cases in turn, again and again until the time is over; each at least once."""
    chance = random.Random(seed)
    counts: dict[tuple[str, str], Count] = {}
    end = time.monotonic() + 60.0 * minutes
    for name, mode in _turns(chosen):
        if time.monotonic() > end and (name, mode) in counts:
            break
        count = counts.setdefault((name, mode), Count())
        ending, wrong = attempt(CASES[name], mode, chance)
        _add(count, ending, wrong)
    return counts


def soak(minutes: float) -> dict[tuple[str, str], Count]:
    """Three axes for so long, once in each mode."""
    counts = {}
    for mode in ("emulation", "implementation"):
        ending, wrong = attempt(CASES["undisturbed"], mode, random.Random(1), 60.0 * minutes)
        _add(counts.setdefault((f"soak of {minutes:g} min", mode), Count()), ending, wrong)
    return counts


def _add(count: Count, ending: str, wrong: str) -> None:
    count.runs += 1
    count.right += not wrong
    count.endings[ending] += 1
    if wrong:
        count.wrong.append(re.sub(r"\s+", " ", wrong)[:600])


def _turns(chosen: list[str] | None) -> Iterator[tuple[str, str]]:
    while True:
        for name, case in CASES.items():
            for mode in case.modes:
                if not chosen or name in chosen:
                    yield name, mode


def page(counts: dict[tuple[str, str], Count]) -> str:
    """The counts as a page of the documentation."""
    total, right = (sum(getattr(count, key) for count in counts.values()) for key in ("runs", "right"))
    lines = [
        "# Endings",
        "",
        *_ABOUT,
        "",
        f"{total} runs, {right} right.",
        "",
        "| what is done | mode | runs | right | endings |",
        "| --- | --- | --- | --- | --- |",
    ]
    for (name, mode), count in counts.items():
        what = CASES[name].what if name in CASES else name
        endings = ", ".join(f"{number} {ending}" for ending, number in count.endings.most_common())
        lines.append(f"| {what} | {mode} | {count.runs} | {count.right} | {endings} |")
    wrong = [f"- {name}, {mode}: {text}" for (name, mode), count in counts.items() for text in count.wrong]
    return "\n".join([*lines, *(["", "Wrong:", "", *wrong] if wrong else [])]) + "\n"


def main() -> int:
    """Exit code 0 if all ended right."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.endings", description=__doc__)
    parser.add_argument("--minutes", type=float, default=3.0)
    parser.add_argument("--soak", type=float, default=0.0, help="and a run of so many minutes in each mode")
    parser.add_argument("--case", action="append", choices=CASES, help="only this one; repeatable")
    parser.add_argument("--seed", type=int, default=1, help="of the moments at which something is done")
    parser.add_argument("--write", type=Path, help="the page's file; else it is printed")
    options = parser.parse_args()
    counts = run(options.minutes, options.case, options.seed)
    if options.soak:
        counts |= soak(options.soak)
    text = page(counts)
    if options.write is None:
        sys.stdout.write(text)
    else:
        options.write.write_text(text, encoding="utf-8")
    return 0 if all(count.runs == count.right for count in counts.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
