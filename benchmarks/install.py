"""What an installation takes: megabytes on disk and seconds, from an empty cache and without the download.

Each is made from this folder by uv in an environment of its own that is removed again. `compiled` is what it grows to
when Python has compiled all of it, which pip does while it installs.
"""

from __future__ import annotations

import compileall
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.figures import Figure

ROOT = Path(__file__).resolve().parents[1]
EXTRAS = ("", "lab", "dev")
MOST, LONGEST = 250.0, 20.0  # MB and s, of what simulation, emulation and the built-in bus need


def run() -> list[Figure]:
    """Size and times of each extra; the targets are those of the bare installation."""
    if shutil.which("uv") is None:
        return [Figure("installation", note="uv is not installed")]
    return [figure for extra in EXTRAS for figure in _measured(extra)]


def _measured(extra: str) -> list[Figure]:
    name = f"[{extra}]" if extra else "bare"
    most, longest = (None, None) if extra else (MOST, LONGEST)
    with tempfile.TemporaryDirectory(prefix="rds-install-") as folder:
        place = Path(folder)
        cold = _installed(place, extra)
        again = _installed(place, extra)  # from uv's cache
        site = next((place / "env").rglob("site-packages"))
        size = _megabytes(site)
        compileall.compile_dir(site, quiet=2, workers=0)
        return [
            Figure(f"{name}: size", "MB", (size,), most),
            Figure(f"{name}: size, compiled", "MB", (_megabytes(site),), most),
            Figure(f"{name}: from an empty cache, with the download", "s", (cold,), note="the network's time is in it"),
            Figure(f"{name}: without the download", "s", (again,), longest),
        ]


def _installed(place: Path, extra: str) -> float:
    shutil.rmtree(place / "env", ignore_errors=True)
    environment = os.environ | {"UV_CACHE_DIR": str(place / "cache")}
    python = place / "env" / ("Scripts" if os.name == "nt" else "bin") / "python"
    what = f"{ROOT}[{extra}]" if extra else str(ROOT)
    began = time.perf_counter()
    for command in (
        ["venv", "-q", "--python", sys.executable, str(place / "env")],
        ["pip", "install", "-q", "--python", str(python), what],
    ):
        subprocess.run(["uv", *command], env=environment, check=True, capture_output=True)
    return time.perf_counter() - began


def _megabytes(folder: Path) -> float:
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file()) / 1e6
