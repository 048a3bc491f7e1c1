"""Which distribution this package was installed by, from where, and the command that installs an extra beside it.

No index is asked for the distribution by its name: whoever registers a name there decides what that command runs. What
was installed from a folder, a file or a repository is named by that place (PEP 610, `direct_url.json`); otherwise the
extra's own packages are named.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlsplit

if TYPE_CHECKING:
    from importlib.metadata import Distribution

DISTRIBUTION = "mini-cnc-rds"
_STAMP = ".installed"  # which the Makefile leaves in the environment that it made
_PACKAGE = Path(__file__).resolve().parents[1]


def version() -> str:
    """The version of this copy; "unknown" for one that was never installed."""
    found = _distribution()
    return "unknown" if found is None else found.version


def install_command(extra: str = "", packages: Sequence[str] = ()) -> str:
    """What to type so that `extra` is installed beside this copy; "" repairs what it cannot do without.

    `packages` are named where neither this copy's origin nor its metadata say what the extra is.
    """
    found = _distribution()
    about = {} if found is None else _origin(found)
    if found is None and (_PACKAGE.parent / "pyproject.toml").is_file():  # a checkout that was never installed
        about = {"url": _PACKAGE.parent.as_uri(), "dir_info": {"editable": True}}
    folder = _folder(about)
    if folder is not None and _by_make(folder):
        return _made_by_make(folder)
    place = _place(about)
    if place is not None:
        editable = ["-e"] if about.get("dir_info", {}).get("editable") else []
        return pip_install(*editable, f"{place[0]}[{extra}]{place[1]}" if extra else "".join(place))
    wanted = [] if found is None else _requirements(found, extra)
    return pip_install(*(wanted or packages))


def _distribution() -> Distribution | None:
    """What installed this very package, and not another copy of it; None where nothing did."""
    from importlib.metadata import distributions

    for found in distributions(name=DISTRIBUTION):
        folder = _folder(about) if (about := _origin(found)).get("dir_info", {}).get("editable") else None
        package = (folder or Path(str(found.locate_file("")))) / _PACKAGE.name
        if package.resolve() == _PACKAGE:
            return found
    return None


def _origin(found: Distribution) -> dict[str, Any]:
    """`direct_url.json`; empty for what came from an index."""
    try:
        about = json.loads(found.read_text("direct_url.json") or "{}")
    except ValueError:
        return {}
    return about if isinstance(about, dict) and isinstance(about.get("url", ""), str) else {}


def _local(about: dict[str, Any]) -> Path | None:
    """The folder or file it was installed from, where that is still there."""
    parts = urlsplit(about.get("url", ""))
    if parts.scheme != "file" or "vcs_info" in about:
        return None
    path = Path(_path_of(parts.path)) / about.get("subdirectory", "")
    return path if path.exists() else None


def _path_of(path: str) -> str:
    """The path of a file URL, as this system writes it."""
    if os.name != "nt":
        return unquote(path)
    from urllib.request import url2pathname  # which brings the whole of HTTP along

    return url2pathname(path)


def _folder(about: dict[str, Any]) -> Path | None:
    path = _local(about)
    return path if path is not None and (path / "pyproject.toml").is_file() else None


def _place(about: dict[str, Any]) -> tuple[str, str] | None:
    """Where this copy can be had again, as pip takes it: what stands before and behind the extra's name."""
    url, vcs = about.get("url", ""), about.get("vcs_info")
    below = f"#subdirectory={about['subdirectory']}" if about.get("subdirectory") else ""
    if isinstance(vcs, dict) and {"vcs", "commit_id"} <= vcs.keys():
        return DISTRIBUTION, f" @ {vcs['vcs']}+{url}@{vcs['commit_id']}{below}"
    if urlsplit(url).scheme in ("http", "https"):
        return DISTRIBUTION, f" @ {url}{below}"
    path = _local(about)
    return None if path is None or not (path.is_file() or _folder(about)) else (str(path), "")


def _requirements(found: Distribution, extra: str) -> list[str]:
    """What the metadata require for the extra, without the markers of systems; "" is what is required always."""
    wanted = []
    for line in found.requires or ():
        requirement, _, marker = (part.strip() for part in line.partition(";"))
        of = re.search(r"""extra\s*==\s*['"]([^'"]+)['"]""", marker)
        if (of[1] if of else "") != extra:
            continue
        others = re.match(rf"{DISTRIBUTION}\[([^\]]*)\]", requirement)  # an extra that has others
        if others is None:
            wanted.append(requirement)
        for other in others[1].split(",") if others else ():
            wanted += _requirements(found, other.strip())
    return list(dict.fromkeys(wanted))


def _by_make(folder: Path) -> bool:
    return (Path(sys.prefix) / _STAMP).is_file() and (folder / "Makefile").is_file()


def _made_by_make(folder: Path) -> str:
    """`make setup` installs all extras; -B does so even where its stamp says that this was done."""
    own = Path(sys.prefix).resolve() == (folder / ".venv").resolve()
    return _line(["make", "-C", str(folder), "-B", "setup", *([] if own else [f"VENV={sys.prefix}"])])


def pip_install(*words: str) -> str:
    """The command that installs something by pip, or by uv for an environment that has no pip."""
    pip = [sys.executable, "-m", "pip", "install", *words]
    if find_spec("pip") is not None:
        return _line(pip)
    if shutil.which("uv") is not None:
        return _line(["uv", "pip", "install", "--python", sys.executable, *words])
    return f"{_line([sys.executable, '-m', 'ensurepip'])} && {_line(pip)}"


def _line(words: Sequence[str]) -> str:
    return subprocess.list2cmdline(words) if os.name == "nt" else shlex.join(words)
