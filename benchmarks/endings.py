"""Runs that end badly, in real processes: killed at random, the disk full, memory leaked, Ctrl-C; counted, as a page.

python -m benchmarks.endings [--minutes 3] [--soak MINUTES] [--case NAME ...] [--append FILE] [--write docs/endings.md]

Each trial is a run of two seconds at 100 Hz by the command line, in a folder and a runtime directory of its own. It is
*right* if the command ends within a minute with an exit code of the documents, its record opens or stderr says why
there is none, and no process and no shared memory of it is left. With `--append` each trial is a line of JSON in a
file, and the next call goes on where the last one ended, until each case has had as many as it should.
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
from dataclasses import asdict, dataclass
from itertools import chain
from pathlib import Path

from rds.core.errors import RdsError
from rds.modes.process.recorder import PROCESSES
from rds.results import open_result

_ABOUT = """Runs that end badly, in real processes; `python -m benchmarks.endings --write docs/endings.md` makes this
page. Each is a run of three axes for two seconds at 100 Hz, by `rds run`; what is done to it is done at a random
moment, most often while it starts or runs. *Right* means: the command ends within a minute with an exit code of
[the documents](commands.md), the record opens or stderr says why there is none, and no process and no shared memory is
left. *Hangs* means: it had not ended after a minute (why: `benchmarks/README.md`).
Ctrl-C before Python has loaded the first line of RDS is answered by Python alone. The full disk is a limit on the size
of files, which every process of the run has.
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
    trials: int = 10  # of each mode, for the page


CASES = {
    "undisturbed": Case("nothing"),
    "ctrl-c": Case("Ctrl-C at a random moment, its start included", _interrupt, trials=50),
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
class Ended:
    """How one trial of a case and mode ended, and what was wrong, or nothing."""

    case: str
    mode: str
    ending: str
    wrong: str


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
            preexec_fn=lambda: _begin(case.room),
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
        if not wrong and (forgotten := _forgotten(rings)):
            wrong = f"left in shared memory: {forgotten}"
    shutil.rmtree(runtime, ignore_errors=True)
    return ending, wrong


def _begin(room: int | None) -> None:
    """As at a terminal, where Ctrl-C is heard, also if this program runs in the background."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if room is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))


def _judge(code: int, out: Path, said: str, runtime: Path) -> tuple[str, str]:
    killed = code == -signal.SIGKILL
    ours = set(re.findall(rf"{re.escape(str(HERE))}/(rds/[\w/]+\.py)", said))
    is_early = (code == -signal.SIGINT and not said) or (code in (1, -signal.SIGINT) and "Traceback" in said)
    if is_early and ours <= {"rds/__init__.py"}:  # whose imports Python makes before rds/__main__.py can heed Ctrl-C
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


def _forgotten(before: set[Path]) -> set[Path]:
    """Shared memory that was not there before, and that no process, of whichever run, has for a while."""
    left = set(Path("/dev/shm").glob("rds-*")) - before
    for _ in range(2):
        for maps in Path("/proc").glob("[0-9]*/maps"):
            with suppress(OSError):
                text = maps.read_text()
                left = {ring for ring in left if str(ring) not in text}
        if left:
            time.sleep(2.0)
            left = {ring for ring in left if ring.exists()}
    return left


def run(minutes: float, chosen: list[str] | None, seed: int, before: list[Ended]) -> Iterator[Ended]:
    """Trials of the case and mode that has had fewest, each one once at least, until the time is over or it has all."""
    chance = random.Random(seed + len(before))
    end = time.monotonic() + 60.0 * minutes
    done = {(name, mode): 0 for name in CASES if not chosen or name in chosen for mode in CASES[name].modes}
    for earlier in before:
        if (earlier.case, earlier.mode) in done:
            done[earlier.case, earlier.mode] += 1
    while True:
        name, mode = min(done, key=lambda pair: done[pair] / CASES[pair[0]].trials)
        so_far = done[name, mode]
        if so_far >= CASES[name].trials or (so_far and time.monotonic() > end):
            return
        yield Ended(name, mode, *attempt(CASES[name], mode, chance))
        done[name, mode] += 1


def soak(minutes: float) -> Iterator[Ended]:
    """Three axes for so long, once in each mode."""
    for mode in ("emulation", "implementation"):
        ending, wrong = attempt(CASES["undisturbed"], mode, random.Random(1), 60.0 * minutes)
        yield Ended(f"nothing, for {minutes:g} min", mode, ending, wrong)


def read_trials(path: Path) -> list[Ended]:
    """The trials of a file that `--append` has written; its last line may be torn."""
    found = []
    for line in path.read_text().splitlines() if path.exists() else []:
        with suppress(ValueError):
            found.append(Ended(**json.loads(line)))
    return found


def page(trials: list[Ended]) -> str:
    """The counts as a page of the documentation."""
    lines = [
        "# Endings",
        "",
        *_ABOUT,
        "",
        f"{len(trials)} runs, {sum(not trial.wrong for trial in trials)} right.",
        "",
        "| what is done | mode | runs | right | endings |",
        "| --- | --- | --- | --- | --- |",
    ]
    order = list(CASES)
    pairs = dict.fromkeys((trial.case, trial.mode) for trial in trials)
    for name, mode in sorted(pairs, key=lambda pair: order.index(pair[0]) if pair[0] in CASES else len(order)):
        these = [trial for trial in trials if (trial.case, trial.mode) == (name, mode)]
        counts = Counter(trial.ending for trial in these).most_common()
        endings = ", ".join(f"{number} {ending}" for ending, number in counts)
        right = sum(not trial.wrong for trial in these)
        what = CASES[name].what if name in CASES else name
        lines.append(f"| {what} | {mode} | {len(these)} | {right} | {endings} |")
    wrong = [f"- {trial.case}, {trial.mode}: {_shortened(trial.wrong)}" for trial in trials if trial.wrong]
    return "\n".join([*lines, *(["", "Wrong:", "", *wrong] if wrong else [])]) + "\n"


def _shortened(text: str) -> str:
    return re.sub(r"\s+", " ", text)[:600]


def main() -> int:
    """Exit code 0 if all ended right."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.endings", description=__doc__)
    parser.add_argument("--minutes", type=float, default=3.0)
    parser.add_argument("--soak", type=float, default=0.0, help="and a run of so many minutes in each mode")
    parser.add_argument("--case", action="append", choices=CASES, help="only this one; repeatable")
    parser.add_argument("--seed", type=int, default=1, help="of the moments at which something is done")
    parser.add_argument("--append", type=Path, metavar="FILE", help="keep each trial there, and go on from it")
    parser.add_argument("--write", type=Path, help="the page's file; else it is printed")
    options = parser.parse_args()
    trials = [] if options.append is None else read_trials(options.append)
    news = run(options.minutes, options.case, options.seed, list(trials))
    for trial in chain(news, soak(options.soak) if options.soak else ()):
        trials.append(trial)
        if options.append is not None:
            with open(options.append, "a") as file:
                file.write(json.dumps(asdict(trial)) + "\n")
    text = page(trials)
    if options.write is None:
        sys.stdout.write(text)
    else:
        options.write.write_text(text, encoding="utf-8")
    return 1 if any(trial.wrong for trial in trials) else 0


if __name__ == "__main__":
    sys.exit(main())
