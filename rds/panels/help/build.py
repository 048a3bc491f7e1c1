"""Building the help pages: once for each state of the documents, into the user's cache."""

from __future__ import annotations

import atexit
import hashlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from rds.core.errors import InputError
from rds.core.extras import missing
from rds.core.private_files import make_folder, umask, write_private

_HERE = Path(__file__).parent
FIRST = "index"
_PULSE = 0.1  # s


def sources() -> dict[str, Path]:
    """The documents by name; InputError where the package was installed without them."""
    for folder in (_HERE / "docs", _HERE.parents[2] / "docs"):  # installed, or a checkout
        if (folder / "experiments.md").is_file():
            found = {path.stem.lower(): path for path in sorted(folder.glob("*.md"))}  # FIRST has their order
            for name in ("README", "CHANGELOG"):
                beside = (folder if folder.parent == _HERE else folder.parent) / f"{name}.md"
                if beside.is_file():
                    found[name.lower()] = beside
            return found
    raise InputError("the documents are not installed; install rds from a wheel or a checkout that has docs/")


def pictures(documents: dict[str, Path]) -> dict[str, Path]:
    """The pictures of the documents, by the names that they have beside the pages."""
    folder = documents[FIRST].parent / "pictures"
    return {path.name: path for path in sorted(folder.glob("*.png"))}


def help_pages(out: Path | None = None, pulse: Callable[[], None] = lambda: None) -> Path:
    """The folder with the built pages (`index.html`), by default in the user's cache, built if they are not there.

    `pulse()` is called ten times a second meanwhile: what it raises ends the building. InputError where sphinx is
    missing, the documents have faults, or the folder cannot be written to.
    """
    documents = sources()
    place = out or _cache() / _fingerprint(documents)
    if out is None and (place / f"{FIRST}.html").is_file():
        return place
    if out is not None and place.exists():
        _check_replaceable(place)
    try:
        make_folder(place.parent)
        with tempfile.TemporaryDirectory(prefix=".rds-help-", dir=place.parent) as work:
            built = _built(documents, Path(work), pulse)
            if out is not None and place.exists():
                shutil.rmtree(place)
            if not place.exists():  # else another process was quicker
                os.replace(built, place)
    except OSError as error:
        raise InputError(f"the help cannot be written: {error.strerror or error}", str(place)) from error
    return place


def page_file(name: str) -> str:
    """The file of the page on a subject, as panels name it; the first page for a subject without one."""
    known = sources()
    return f"{name if name in known else FIRST}.html"


def _built(documents: dict[str, Path], work: Path, pulse: Callable[[], None]) -> Path:
    for package in ("sphinx", "myst_parser", "furo"):
        if importlib.util.find_spec(package) is None:
            raise missing(package, "building the help")
    source, target = work / "source", work / "html"
    make_folder(source)
    make_folder(target)
    for name, path in documents.items():
        if name == FIRST:
            continue
        write_private(source / f"{name}.md", _local(path.read_text(encoding="utf-8"), set(documents)).encode())
    index = _local(documents[FIRST].read_text(encoding="utf-8"), set(documents))
    write_private(source / f"{FIRST}.md", (index + _contents(index)).encode())
    for name, path in pictures(documents).items():
        write_private(source / name, path.read_bytes())
    # in a process of its own: sphinx changes docutils for the whole process
    command = [sys.executable, "-m", "sphinx", "-q", "-b", "html", "-c", str(_HERE), "-d", str(work / "doctrees")]
    code, said = _run([*command, str(source), str(target)], pulse)
    faults = "\n".join(line for line in said.splitlines() if "WARNING" in line or "ERROR" in line)
    if code or faults:
        raise InputError(f"the documents have faults: {(faults or said).strip()[:2000]}", str(source))
    return target


def _run(command: list[str], pulse: Callable[[], None]) -> tuple[int, str]:
    """Exit code and stderr of a command, which ends with this call and with this process."""
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        umask=umask() if os.name == "posix" else -1,
    )

    def end() -> None:
        process.kill()
        process.wait()

    atexit.register(end)  # before the folder that it writes into is taken away, if a page's kernel ends meanwhile
    try:
        while True:
            try:
                said = process.communicate(timeout=_PULSE)[1]
                return process.returncode, said
            except subprocess.TimeoutExpired:
                pulse()
    finally:
        atexit.unregister(end)
        end()


def contents(index: str) -> dict[str, list[str]]:
    """The names of the documents by the headings of the first page, in its order."""
    found = {}
    for part in re.split(r"^## ", index, flags=re.M)[1:]:
        names = [Path(target).stem.lower() for target in re.findall(r"\]\(([^)\s#]+\.md)", part)]
        found[part.partition("\n")[0]] = names
    return found


def _contents(index: str) -> str:
    """The first page's order, for the navigation beside all pages."""
    return "".join(
        f"\n```{{toctree}}\n:hidden:\n:maxdepth: 1\n:caption: {heading}\n\n" + "\n".join(names) + "\n```\n"
        for heading, names in contents(index).items()
    )


def _local(text: str, known: set[str]) -> str:
    """Links between documents and pictures side by side, as they lie here; links to other files become text."""

    def link(match: re.Match[str]) -> str:
        words, target = match.group(1), match.group(2)
        if re.match(r"[a-z]+:|#", target):
            return match.group(0)
        path, _, place = target.partition("#")
        name = Path(path).stem.lower() if path.endswith(".md") else ""
        if name in known:
            return f"[{words}]({name}.md{'#' + place if place else ''})"
        return words

    text = re.sub(r"(?<=\]\()[\w./-]*pictures/(?=[\w-]+\.png\))", "", text)
    return "".join(
        part if part.startswith("```") else re.sub(r"(?<!!)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)", link, part)
        for part in _parts(text)
    )


def _parts(text: str) -> Iterator[str]:
    """Prose and fenced blocks in turn: what stands in a block is left alone."""
    return iter(re.split(r"(^```.*?^```$)", text, flags=re.M | re.S))


def _fingerprint(documents: dict[str, Path]) -> str:
    ours = [_HERE / "conf.py", Path(__file__), *sorted((_HERE / "static").iterdir())]
    ours += pictures(documents).values()
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in ours))
    for name, path in sorted(documents.items()):
        digest.update(name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def _cache() -> Path:
    home = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    return (Path(home) if home else Path.home() / ".cache") / "rds" / "help"


def _check_replaceable(place: Path) -> None:
    if not place.is_dir():
        raise InputError("is no folder; choose a new one", str(place))
    if any(place.iterdir()) and not (place / "searchindex.js").is_file():
        raise InputError("is a folder with other things in it; choose a new one", str(place))
