"""bubblewrap's command line for a warm interpreter: what it can see, and what it cannot do."""

from __future__ import annotations

import sys
import sysconfig
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

PROGRAM = "bwrap"
SITE, SOURCES = "/opt/packages", "/opt/rds"
PREFIX = "/opt/python"
"""Where an interpreter is that is not the system's: its own place can be one that the sandbox uses itself, as /tmp."""

ROOMS = (
    *("__init__.py", "core", "checks", "modes", "machines"),
    *(f"models/{name}.py" for name in ("__init__", "ode", "student")),  # that run a model, and are none
    *(f"network/{name}.py" for name in ("__init__", "delays", "distributions", "links")),  # which a plan may have
    *("grading/__init__.py", "grading/grade.py", "grading/sandbox"),
)
"""What of this package is visible inside: the fixed interfaces. The laws and methods of the library are not: to write
such a thing is what an assignment asks for."""

_METHODS = ("machines/kinematics", "machines/forces")
"""What holds methods in one of these rooms: it is not visible."""

_DEVICES = ("/dev/null", "/dev/random", "/dev/urandom")  # not zero: mapped, it is memory that nobody counts
_LIBRARIES = ("/usr/lib", "/usr/lib64", "/lib", "/lib64", "/etc/ld.so.cache")
_ENVIRONMENT = {
    "HOME": "/tmp",
    "LANG": "C",  # whose data are in no file, so that setlocale(LC_ALL, "") finds it; texts are UTF-8 by -X utf8
    "LD_LIBRARY_PATH": f"{PREFIX}/lib",  # of a prefix of its own: its libraries lie elsewhere than they were built for
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


class View(NamedTuple):
    """What is visible inside: `binds`, without the folders `hidden` (places inside), which are empty there."""

    binds: list[Bind]
    hidden: list[str]


def view() -> View:
    """Everything that is visible inside: interpreter, system libraries, fixed interfaces, packages of submissions."""
    from rds.grading.sandbox.packages import package_paths  # takes long to import, and `launch` needs none of it

    packages = [Bind(path, f"{SITE}/{name}") for name, path in package_paths().items()]
    interpreter = _interpreter()
    return View([*interpreter.binds, *_sources(), *packages], interpreter.hidden)


def command(
    sources: Sequence[str],
    places: Sequence[str],
    hidden: Sequence[str],
    preload: Sequence[str],
    control: int,
    filter_fd: int,
) -> list[str]:
    """The whole command. `sources[i]` appears at `places[i]`; the folders `hidden` are empty.

    `control` is the socket that requests come over, `filter_fd` holds the filter for the warm interpreter.
    """
    wrap = [PROGRAM, "--unshare-user", "--unshare-all", "--die-with-parent", "--new-session", "--cap-drop", "ALL"]
    wrap += ["--uid", "65534", "--gid", "65534", "--hostname", "sandbox", "--clearenv"]
    for name, value in _ENVIRONMENT.items():
        wrap += ["--setenv", name, value]
    wrap += _links()
    for source, place in zip(sources, places, strict=True):
        wrap += ["--ro-bind", source, place]
    for place in hidden:
        wrap += ["--tmpfs", place, "--remount-ro", place]
    for device in _DEVICES:
        wrap += ["--dev-bind", device, device]
    wrap += ["--proc", "/proc", "--tmpfs", "/tmp", "--remount-ro", "/", "--chdir", "/", "--seccomp", str(filter_fd)]
    start = (
        f"import sys; sys.path[:] = [p for p in sys.path if p] + [{SITE!r}, {SOURCES!r}]; "
        f"from rds.grading.sandbox.inside.warm import main; main({control}, {list(preload)!r})"
    )
    # -S: no site-packages but those named above; not -I, which would ignore PYTHONHASHSEED
    return [*wrap, "--", _place_of_executable(), "-s", "-S", "-P", "-B", "-X", "utf8", "-c", start]


def _executable() -> Path:
    """The interpreter itself, not a virtual environment's link to it."""
    base = getattr(sys, "_base_executable", None) or sys.executable
    return Path(base).resolve()


def _standard() -> str:
    return f"python{sys.version_info.major}.{sys.version_info.minor}"


def _is_of_the_system() -> bool:
    """Whether the standard library is among the system's libraries; else it has a prefix of its own."""
    return any((Path(name) / _standard() / "os.py").is_file() for name in _LIBRARIES) and _executable().is_relative_to(
        "/usr/bin"
    )


def _place_of_executable() -> str:
    return str(_executable()) if _is_of_the_system() else f"{PREFIX}/bin/{_executable().name}"


def _interpreter() -> View:
    """The interpreter without packages: whatever is installed beside it is none of a submission's business."""
    bound = [Bind(path, str(path)) for path in _system()]
    hidden: set[Path] = set()
    if not _is_of_the_system():
        prefix = Path(sys.base_prefix).resolve()
        for name in dict.fromkeys(("lib", sys.platlibdir)):
            if (prefix / name).is_dir() and not (prefix / name).is_symlink():
                bound.append(Bind(prefix / name, f"{PREFIX}/{name}"))
                folders = [each for each in (prefix / name).iterdir() if each.is_dir() and not each.is_symlink()]
                hidden |= {Path(PREFIX) / name / each.name for each in folders if each.name != _standard()}
    for bind in bound:
        if bind.source.is_dir():
            place, found = Path(bind.place), _packages(bind.source)
            hidden |= {place / each.relative_to(bind.source) for each in [*found, *_own(bind.source)]}
    outermost = sorted(str(each) for each in hidden if not hidden & set(each.parents))
    return View([*bound, Bind(_executable(), _place_of_executable())], outermost)


def _system() -> list[Path]:
    """The folders of the system's libraries; of Debian's /usr/lib, where applications are too, no others."""
    found = []
    for path in (Path(name) for name in _LIBRARIES if Path(name).exists() and not Path(name).is_symlink()):
        own = path / str(sysconfig.get_config_var("MULTIARCH"))
        if any(own.glob("libc.so*")):
            found += [own, path / _standard()] if _is_of_the_system() and (path / _standard()).is_dir() else [own]
        else:
            found.append(path)
    return found


def _packages(tree: Path) -> Iterator[Path]:
    """The folders of a tree that Python installs packages to."""
    for name in ("site-packages", "dist-packages"):
        yield from (each for each in (*tree.glob(name), *tree.glob(f"py*/{name}")) if not each.is_symlink())


def _own(tree: Path) -> list[Path]:
    """The folders of a tree that hold this package and its environment, where these lie below it."""
    package = Path(__file__).resolve().parents[2]
    around = package if package.parent == tree else package.parent
    environment = [Path(sys.prefix).resolve()] if sys.prefix != sys.base_prefix else []
    return [each for each in (around, *environment) if each.is_relative_to(tree) and each != tree]


def _links() -> list[str]:
    """`/lib -> usr/lib` and the like, where this system has them."""
    words: list[str] = []
    for name in _LIBRARIES:
        if Path(name).is_symlink():
            words += ["--symlink", str(Path(name).readlink()), name]
    return words


def _sources() -> list[Bind]:
    package = Path(__file__).resolve().parents[2]
    names: list[str] = []
    for room in ROOMS:
        if any(name.startswith(f"{room}/") for name in _METHODS):  # an empty folder could be imported
            inside = {f"{room}/{each.name}" for each in (package / room).iterdir() if each.name != "__pycache__"}
            names += sorted(inside - set(_METHODS))
        else:
            names.append(room)
    return [Bind(package / name, f"{SOURCES}/rds/{name}") for name in names]
