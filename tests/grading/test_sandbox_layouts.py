"""What a submission sees where Python and RDS lie otherwise than here: a prefix of its own, with RDS in it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import pytest

import rds
from rds.grading.sandbox import available
from rds.grading.sandbox.bubblewrap import view

_LOOK = """
import os
def attack():
    seen = {"packages": [], "files": []}
    for root, folders, files in os.walk("/"):
        if root == "/opt/packages":
            folders.clear()
        if root.endswith("-packages"):
            seen["packages"].append([root, sorted(folders), sorted(files)])
        seen["files"] += [root + "/" + name for name in files if name in ("secret.toml", "pid.py", "solution.py")]
    try:
        from rds.controllers import pid
        seen["law"] = str(pid)
    except ImportError as error:
        seen["law"] = type(error).__name__
    import ctypes, sqlite3, ssl, numpy  # what the interpreter's own libraries are for
    return seen
"""
_GRADER = """
import json, sys
from rds.grading.sandbox import Limits, Pool, available
fault = available()
if fault: sys.exit(fault)
with Pool() as pool, pool.open(sys.argv[1], Limits(call_seconds=20.0), kind="functions") as subject:
    print(json.dumps(subject.call("attack")))
"""


def _linked(source: str, target: str) -> None:
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)


def _copied(source: Path, target: Path, *without: str) -> None:
    ignored = shutil.ignore_patterns("__pycache__", "test", "tests", *without)
    shutil.copytree(source, target, symlinks=True, copy_function=_linked, ignore=ignored)


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A Python of its own below the temporary folder, with RDS and what it needs in its site-packages, as conda's."""
    if fault := available():
        pytest.skip(fault)
    base, name = Path(sys.base_prefix).resolve(), f"python{sys.version_info.major}.{sys.version_info.minor}"
    if not (base / "lib" / name / "os.py").is_file() or base == Path("/usr"):
        pytest.skip("this Python has no prefix of its own that could be copied")
    made = tmp_path_factory.mktemp("prefix")
    (made / "bin").mkdir()
    shutil.copyfile(base / "bin" / name, made / "bin" / name)
    (made / "bin" / name).chmod(0o755)
    _copied(base / "lib", made / "lib", "site-packages", "idlelib", "ensurepip", "lib2to3")
    packages = made / "lib" / name / "site-packages"
    for package in ("numpy", "pyseccomp"):
        files = metadata.files(package) or []
        for top in {file.parts[0] for file in files if file.parts[0] not in ("..", "__pycache__")}:
            source = Path(str(next(file for file in files if file.parts[0] == top).locate())).parents
            found = next(parent / top for parent in source if (parent / top).exists())
            if found.is_dir():
                _copied(found, packages / top)
            else:
                shutil.copyfile(found, packages / top)
    _copied(Path(rds.__file__).parent, packages / "rds")
    (packages / "secret.toml").write_text("secret = 1\n")
    (made / "lib" / "other").mkdir()
    (made / "lib" / "other" / "secret.toml").write_text("secret = 1\n")
    yield made
    shutil.rmtree(made)


def _seen(python: Path, folder: Path) -> dict[str, object]:
    attack = folder / "submission.py"
    attack.write_text(_LOOK)
    words = [str(python), "-s", "-P", "-c", _GRADER, str(attack)]
    own = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "LD_"))}
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, env=own, cwd=folder, check=False)
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout))


def test_a_python_with_rds_in_it_below_the_temporary_folder_shows_nothing_more(prefix: Path, tmp_path: Path) -> None:
    name = next(each.name for each in (prefix / "bin").iterdir())
    place = f"/opt/python/lib/{name}/site-packages"
    found = _seen(prefix / "bin" / name, tmp_path)
    assert found == {"packages": [[place, [], []]], "files": [], "law": "ModuleNotFoundError"}


def test_an_environment_with_the_systems_packages_shows_nothing_more(prefix: Path, tmp_path: Path) -> None:
    name = next(each.name for each in (prefix / "bin").iterdir())
    words = [prefix / "bin" / name, "-m", "venv", "--system-site-packages", "--without-pip", tmp_path / "venv"]
    subprocess.run([str(word) for word in words], check=True, timeout=60)
    found = _seen(tmp_path / "venv" / "bin" / "python", tmp_path)
    assert found["files"] == [] and found["law"] == "ModuleNotFoundError"


def test_this_package_is_hidden_in_a_tree_of_libraries(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A checkout, or an environment, below a folder that is bound as a whole."""
    from rds.grading.sandbox import bubblewrap

    package = Path(rds.__file__).resolve().parent
    monkeypatch.setattr(bubblewrap, "_system", lambda: [package.parents[1]])
    hidden = bubblewrap.view().hidden
    assert str(package.parent) in hidden


def test_only_what_is_listed_is_bound() -> None:
    """The interpreter, libraries of the system, the fixed interfaces, the packages of submissions."""
    places = {bind.place for bind in view().binds}
    kinds = ("/opt/python/", "/opt/rds/rds/", "/opt/packages/", "/usr/", "/lib", "/etc/ld.so.cache")
    assert [place for place in places if not place.startswith(kinds)] == []
    assert not {"/usr", "/usr/local", "/usr/local/lib"} & places
