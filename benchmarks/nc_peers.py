"""Other readers of part programs, each in a process of its own.

    python -m benchmarks.nc_peers NAME FILE

reads the file and prints JSON: version, seconds, lines. What they do is less: gcodeparser and pygcode split lines into
words and know no state, rs274 (LinuxCNC's stand-alone interpreter, which is a program) does all.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any


def read_with_gcodeparser(text: str) -> int:
    """Lines found."""
    from gcodeparser import GcodeParser

    return len(GcodeParser(text).lines)


def read_with_pygcode(text: str) -> int:
    """Lines read."""
    from pygcode import Line

    return len([Line(line) for line in text.splitlines()])


PEERS = {"gcodeparser": read_with_gcodeparser, "pygcode": read_with_pygcode}


def call(name: str, file: Path, python: str = sys.executable) -> dict[str, Any] | str:
    """A peer's answer from a fresh process of the interpreter `python`, or why there is none."""
    root = Path(__file__).parents[1]
    words = [python, "-m", "benchmarks.nc_peers", name, str(file)]
    done = subprocess.run(words, cwd=root, capture_output=True, text=True)
    if done.returncode:
        return f"skipped: {(done.stderr.strip().splitlines() or ['ended without a word'])[-1]}"
    answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return answer


def rs274(file: Path) -> float | None:
    """Seconds that `rs274 -g FILE > /dev/null` takes, start included; None where it is not installed."""
    if shutil.which("rs274") is None:
        return None
    with tempfile.TemporaryDirectory() as place:
        home = Path(place)
        (home / "tool.tbl").write_text("T1 P1 Z0 D0.125\n")
        (home / "p.var").write_text("")
        words = ["rs274", "-t", str(home / "tool.tbl"), "-v", str(home / "p.var"), "-n", "2", "-g", str(file)]
        started = time.perf_counter()
        subprocess.run(
            words, env=os.environ | {"HOME": place}, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True
        )
        return time.perf_counter() - started


def rs274_version() -> str | None:
    """Of the Debian package that it comes with."""
    try:
        words = ["dpkg-query", "-W", "-f=${Version}", "linuxcnc-uspace"]
        return subprocess.run(words, capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        return None


def main() -> None:
    name, file = sys.argv[1:]
    text = Path(file).read_text()
    started = time.perf_counter()
    lines = PEERS[name](text)
    seconds = time.perf_counter() - started
    print(json.dumps({"version": f"{name} {version(name)}", "seconds": seconds, "lines": lines}))


if __name__ == "__main__":
    main()
