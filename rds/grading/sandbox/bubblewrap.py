"""bubblewrap's command line for a warm interpreter: what it can see, and what it cannot do."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rds.grading.sandbox.packages import package_paths

PROGRAM = "bwrap"
SITE, SOURCES = "/opt/packages", "/opt/rds"

ROOMS = (
    *("__init__.py", "core", "checks", "models", "modes", "machines"),
    *(f"network/{name}.py" for name in ("__init__", "delays", "distributions", "links")),  # which a plan may have
    *("grading/__init__.py", "grading/grade.py", "grading/sandbox"),
)
"""What of this package is visible inside: the fixed interfaces. The laws and methods of the library are not: to write
such a thing is what an assignment asks for."""

_DEVICES = ("/dev/null", "/dev/random", "/dev/urandom")  # not zero: mapped, it is memory that nobody counts
_LIBRARIES = ("/usr/lib", "/usr/lib64", "/usr/libexec", "/lib", "/lib64", "/etc/ld.so.cache")
_ENVIRONMENT = {
    "HOME": "/tmp",
    "LANG": "C.UTF-8",
    "MPLBACKEND": "Agg",
    "MPLCONFIGDIR": "/tmp",
    "PATH": "/usr/bin",
    "PYTHONHASHSEED": "0",
    "TZ": "UTC",
    # one thread each: answers that do not depend on the number of processors, and no threads before the fork
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS"), "1"),
}


class Bind(NamedTuple):
    """A file or folder from outside, and its place inside; read-only."""

    source: Path
    place: str


def binds(preload: Sequence[str]) -> list[Bind]:
    """Everything that is visible inside, for an interpreter that imports `preload`."""
    return [*_interpreter(), *_sources(), *(Bind(path, f"{SITE}/{name}") for name, path in package_paths().items())]


def command(
    sources: Sequence[str], places: Sequence[str], preload: Sequence[str], control: int, filter_fd: int
) -> list[str]:
    """The whole command. `sources[i]` appears at `places[i]`.

    `control` is the socket that requests come over, `filter_fd` holds the filter for the warm interpreter.
    """
    wrap = [PROGRAM, "--unshare-user", "--unshare-all", "--die-with-parent", "--new-session", "--cap-drop", "ALL"]
    wrap += ["--uid", "65534", "--gid", "65534", "--hostname", "sandbox", "--clearenv"]
    for name, value in _ENVIRONMENT.items():
        wrap += ["--setenv", name, value]
    wrap += _links()
    for source, place in zip(sources, places, strict=True):
        wrap += ["--ro-bind", source, place]
    for device in _DEVICES:
        wrap += ["--dev-bind", device, device]
    wrap += ["--proc", "/proc", "--tmpfs", "/tmp", "--remount-ro", "/", "--chdir", "/", "--seccomp", str(filter_fd)]
    start = (
        f"import sys; sys.path[:] = [p for p in sys.path if p] + [{SITE!r}, {SOURCES!r}]; "
        f"from rds.grading.sandbox.inside.warm import main; main({control}, {list(preload)!r})"
    )
    # -S: no site-packages but those named above; not -I, which would ignore PYTHONHASHSEED
    return [*wrap, "--", str(_executable()), "-s", "-S", "-P", "-B", "-X", "utf8", "-c", start]


def _executable() -> Path:
    """The interpreter itself, not a virtual environment's link to it."""
    base = getattr(sys, "_base_executable", None) or sys.executable
    return Path(base).resolve()


def _interpreter() -> list[Bind]:
    prefix = Path(sys.base_prefix).resolve()
    standard = prefix / "lib" / f"python{sys.version_info.major}.{sys.version_info.minor}"
    found = [Path(name) for name in _LIBRARIES if Path(name).exists() and not Path(name).is_symlink()]
    if not any(standard.is_relative_to(path) for path in found):
        found.append(prefix / "lib")
    found.append(_executable())
    return [Bind(path, str(path)) for path in found]


def _links() -> list[str]:
    """`/lib -> usr/lib` and the like, where this system has them."""
    words: list[str] = []
    for name in _LIBRARIES:
        if Path(name).is_symlink():
            words += ["--symlink", str(Path(name).readlink()), name]
    return words


def _sources() -> list[Bind]:
    package = Path(__file__).resolve().parents[2]
    return [Bind(package / name, f"{SOURCES}/rds/{name}") for name in ROOMS]
