"""`rds grade run` in a container, by Docker or Podman: the image is built when it is first needed.

The container is the grader; the sandbox in it is the same as on Linux. It needs user namespaces, which the container's
usual filter of system calls refuses, and a /proc of its own, which the kernel refuses while the container's has masks.
So both are switched off for the grader, which is trusted; submissions have the sandbox's own filter, which is narrower,
and see no process but theirs. The assignment and the submissions are mounted for reading only.

The grader is whoever calls, so that the grades are theirs to read. A grader who is root gives submissions another user,
for which a container needs CAP_SYS_ADMIN.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.core.installed import DISTRIBUTION
from rds.core.private_files import make_folder
from rds.grading.batch.record import FILE as RECORD

PROGRAMS = ("docker", "podman")
_PACKAGE = Path(__file__).resolve().parents[2]
_OPENED = ("--security-opt", "seccomp=unconfined", "--security-opt", "apparmor=unconfined")
_WHOLE_PROC = {"docker": ("--security-opt", "systempaths=unconfined"), "podman": ("--security-opt", "unmask=ALL")}
_KEPT = re.compile(r"extra == ['\"](grading|analysis|tables)['\"]")


def program() -> str:
    """Docker or Podman, whichever is there and answers. InputError with the remedy where none does."""
    there = [name for name in PROGRAMS if shutil.which(name)]
    for name in there:
        if subprocess.run([name, "info"], capture_output=True, stdin=subprocess.DEVNULL).returncode == 0:
            return name
    said = (
        f"{there[0]} is installed, but does not answer: start it" if there else "neither docker nor podman is installed"
    )
    raise InputError(f"grading in a container needs Docker or Podman, and {said}")


def run_in_container(
    assignment: Path, submissions: Path, out: Path, options: Sequence[str], mounted: Sequence[tuple[str, Path]] = ()
) -> int:
    """Grade into the folder `out`; the exit code of `rds grade run`.

    `options` go to the command as they are; `mounted` are options with a file or folder each, which the container gets
    to read. InputError where a place is missing, or no container can be had.
    """
    for path in (assignment, submissions, *(path for _, path in mounted)):
        if not path.exists():
            raise InputError("there is no such file or folder", str(path))
    name = program()
    image = build(name)
    make_folder(out)
    code = subprocess.run(command(name, image, assignment, submissions, out, options, mounted)).returncode
    _tell_place(out / RECORD, assignment)
    return code


def _tell_place(record: Path, assignment: Path) -> None:
    """The assignment's own place in the batch's record, in place of that in the container: a review reads it there."""
    if record.is_file():
        folder = assignment if assignment.is_dir() else assignment.parent
        told = json.loads(record.read_bytes()) | {"folder": str(folder.resolve())}
        write_whole(record, json.dumps(told, indent=1, sort_keys=True).encode() + b"\n")


def command(
    name: str,
    image: str,
    assignment: Path,
    submissions: Path,
    out: Path,
    options: Sequence[str],
    mounted: Sequence[tuple[str, Path]] = (),
) -> list[str]:
    """What is run; paths in the container are of its own."""
    # keeps the name, by which nbgrader's folders of an assignment are known
    places = {
        f"/assignment/{assignment.resolve().name}": (assignment, "ro"),
        f"/submissions/{submissions.resolve().name}": (submissions, "ro"),
        "/out": (out, "rw"),
    }
    inside = list(places)
    words = [inside[0], inside[1], "-o", inside[2], *options]
    for number, (option, path) in enumerate(mounted):
        place = f"/more/{number}/{path.resolve().name}"
        places[place] = path, "ro"
        words += [option, place]
    volumes = [f"--volume={path.resolve()}:{place}:{mode}" for place, (path, mode) in places.items()]
    opened = [*_OPENED, *_WHOLE_PROC[name], *_caller(name)]
    return [name, "run", "--rm", "--init", "--network=none", *opened, *volumes, image, *words]


def _caller(name: str) -> list[str]:
    """Who grades in the container: the caller. Windows tells no user's number, so that root grades in its Docker."""
    user = os.getuid() if hasattr(os, "getuid") else None
    label = ["--security-opt", "label=disable"] if name == "podman" else []
    if user == 0 or (user is None and name == "docker"):
        return ["--cap-add=SYS_ADMIN", *label]
    if name == "podman":
        return ["--userns=keep-id", *label]
    return [f"--user={user}:{os.getgid()}", "--env=HOME=/tmp"]


def build(name: str) -> str:
    """The image of this very copy of the package; built if it is not there. InputError with what the builder said."""
    with tempfile.TemporaryDirectory(prefix="rds-image-") as folder:
        context = Path(folder)
        write_context(context)
        image = f"rds-grader:{_digest(context)}"
        if subprocess.run([name, "image", "inspect", image], capture_output=True).returncode == 0:
            return image
        words = [name, "build", "--tag", image, "--file", str(context / "Containerfile"), str(context)]
        done = subprocess.run(
            words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        if done.returncode != 0:
            raise InputError(f"the grader's image cannot be built: {done.stdout[-2000:].strip()}")
        return image


def write_context(folder: Path) -> None:
    """What the image is made from: the package as it is installed here, and what it requires to grade."""
    ignored = shutil.ignore_patterns("__pycache__", "*.pyc", ".*", "docs")
    shutil.copytree(_PACKAGE, folder / "rds", ignore=ignored)
    shutil.copy(Path(__file__).with_name("Containerfile"), folder / "Containerfile")
    (folder / "requirements.txt").write_text("\n".join(requirements()) + "\n", encoding="utf-8")


def requirements() -> list[str]:
    """The packages of an installation that grades, as this copy's metadata name them."""
    from importlib.metadata import PackageNotFoundError, requires

    try:
        said = requires(DISTRIBUTION) or []
    except PackageNotFoundError:
        raise InputError("this copy of rds was never installed, so nobody knows what it requires; install it") from None
    found = []
    for each in said:
        what, _, marker = each.partition(";")
        if not what.strip().startswith(DISTRIBUTION) and ("extra" not in marker or _KEPT.search(marker)):
            found.append(what.strip())
    return sorted(set(found))


def _digest(folder: Path) -> str:
    """Of all that goes into the image: another copy of the package has another image."""
    total = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            total.update(path.relative_to(folder).as_posix().encode())
            total.update(hashlib.sha256(path.read_bytes()).digest())
    return total.hexdigest()[:16]
