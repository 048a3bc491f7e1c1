"""cyclictest of the rt-tests: the lateness of an empty loop in C, as a measure of the system."""

from __future__ import annotations

import shutil
import signal
import subprocess

COMMAND = ("cyclictest", "-m", "-p90", "-i1000")
_LONGEST = 100_000  # µs; what is later counts in the maximum only


class Cyclictest:
    """Runs from `start()` to `stop()`; `obstacle` says why it can't, else it is empty."""

    def __init__(self) -> None:
        self.obstacle = "" if shutil.which(COMMAND[0]) else "skipped: cyclictest is not installed (Debian: rt-tests)"
        self._process: subprocess.Popen[str] | None = None

    def start(self) -> None:
        """Begin, unless it is running or can't."""
        if self._process is None and not self.obstacle:
            command = [*COMMAND, "-q", "-h", str(_LONGEST)]
            self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    def stop(self) -> dict[str, float]:
        """Lateness p50, p99 and max in µs, whole ones; empty where there is none."""
        if self._process is None:
            return {}
        process, self._process = self._process, None
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate()
        counts = [tuple(map(int, line.split())) for line in output.splitlines() if line[:1].isdigit()]
        most = [line.split(":")[1] for line in output.splitlines() if line.startswith("# Max Latencies")]
        total = sum(count for _, count in counts)
        if not total or not most:
            self.obstacle = f"skipped: cyclictest said {(output.strip().splitlines() or ['nothing'])[0]}"
            return {}
        return {"p50": _percentile(counts, total, 0.5), "p99": _percentile(counts, total, 0.99), "max": float(most[0])}


def version() -> str:
    """Its version; OSError where it is not installed."""
    text = subprocess.run([COMMAND[0], "--help"], capture_output=True, text=True)
    return (text.stdout + text.stderr).splitlines()[0].strip()


def _percentile(counts: list[tuple[int, ...]], total: int, part: float) -> float:
    seen = 0
    for late, count in counts:
        seen += count
        if seen >= part * total:
            return float(late)
    return float(_LONGEST)
