"""What an installed package needs: its documents once each, little else; and what says how to install the rest."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import PathDistribution, requires
from pathlib import Path

import pytest
from documents import ROOT
from packaging.requirements import Requirement
from typer.testing import CliRunner

import rds.cli.fit as fit_command
import rds.core.compiling as compiling
import rds.panels.help.build as build
from rds.cli.main import app
from rds.core import extras, installed
from rds.core.errors import InputError
from rds.grading.sandbox.packages import package_paths
from rds.identification.structures.structures import structure
from rds.panels.app import serve

MOST = 250e6  # bytes that the package may take with all that it cannot do without
EXTRAS = {"pandas", "pyarrow", "scipy", "control", "numba", "ipywidgets"}  # some of what it can do without
COPIED = ("rds", "docs", "pyproject.toml", "README.md", "CHANGELOG.md", "LICENSE")
MOVE = (
    "from rds.interpolators.motion.point_to_point import point_to_point as p; p([0], [1], [10], [100], [1000], 0.001)"
)


def test_the_documents_of_a_wheel_are_there_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    installed = shutil.copytree(ROOT / "docs", tmp_path / "help" / "docs")
    for name in ("README.md", "CHANGELOG.md"):
        shutil.copy(ROOT / name, installed)
    checkout = set(build.sources())
    monkeypatch.setattr(build, "_HERE", installed.parent)
    assert set(build.sources()) == checkout
    assert all(path.is_file() and installed in path.parents for path in build.sources().values())


# --- what is missing is named, with a command that installs it ----------------------------------------------------


def test_a_page_without_its_extra_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def without(*_: object, **__: object) -> None:
        raise ModuleNotFoundError("No module named 'ipywidgets'", name="ipywidgets")

    monkeypatch.setattr(serve, "serve", without)
    done = CliRunner().invoke(app, ["app", "--no-browser"])
    assert done.exit_code == 2
    wanted = f"the page needs ipywidgets, which is not installed; install it with: {extras.remedy('lab')}"
    assert wanted in done.stderr


def test_a_fit_that_is_not_compiled_says_so(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    monkeypatch.setattr(compiling, "COMPILED", True)
    fit_command._say_if_slow(structure("axis"))
    assert not capsys.readouterr().err
    monkeypatch.setattr(compiling, "COMPILED", False)
    fit_command._say_if_slow(structure("axis"))
    assert f"install it with: {extras.remedy('fast')}" in capsys.readouterr().err


def test_only_what_an_extra_brings_is_asked_for() -> None:
    said = r"e\.mf4: a log needs asammdf, which is not installed; .*; or use \.blf"
    with pytest.raises(InputError, match=said), extras.needed_for("a log", "use .blf", "e.mf4"):
        raise ModuleNotFoundError(name="asammdf.blocks")
    with pytest.raises(ModuleNotFoundError), extras.needed_for("a log"):
        raise ModuleNotFoundError(name="my_helpers")


def test_a_law_that_hides_a_package_is_named(tmp_path: Path) -> None:
    """Beside a notebook, or a script, Python finds it first."""
    (tmp_path / "control.py").write_text("def control(t, r, y, state, params):\n    return 0.0, state\n")
    (tmp_path / "design.py").write_text(
        "import rds\nfrom rds.core.extras import needed_for, python_control\n"
        "try:\n    python_control('this design')\nexcept rds.InputError as error:\n    print(error)\n"
        "with needed_for('a DataFrame'):  # which does not need it\n    import json\n"
    )
    done = subprocess.run([sys.executable, "design.py"], cwd=tmp_path, capture_output=True, text=True)
    assert done.stdout == (
        f"{tmp_path / 'control.py'}: this design needs the package control, and this file is found in its place: "
        "rename it and start Python anew\n"
    ), done.stderr


def test_the_folder_that_one_works_in_hides_no_package_from_the_command(tmp_path: Path) -> None:
    (tmp_path / "can.py").write_text("raise SystemExit('this is not python-can')\n")
    done = subprocess.run(
        [sys.executable, "-m", "rds", "scan", "-c", "nobody"], cwd=tmp_path, capture_output=True, text=True
    )
    assert "no module answers" in done.stdout + done.stderr


def test_each_package_is_in_the_extra_that_messages_name() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["name"] == installed.DISTRIBUTION
    lists = {"": project["dependencies"], **project["optional-dependencies"]}
    for module, (extra, package) in extras._PACKAGES.items():
        assert package in {Requirement(line).name for line in lists[extra]}, f"{module} is not in the extra {extra!r}"


def test_nothing_names_a_distribution_that_may_be_anybody_s() -> None:
    """No index has ours: a command that would fetch it from one fetches what somebody else has put there."""
    texts = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")]
    texts += [path for folder in ("rds", "notebooks", "examples") for path in (ROOT / folder).rglob("*.*")]
    ours = rf"['\"]?(rds|{installed.DISTRIBUTION})"
    wrong = re.compile(rf"pip install (-\S+ )*{ours}(\[[\w,]*\])?['\"]?(?! @)(?![\w.\[-])")
    for path in texts:
        if path.suffix in (".md", ".py", ".ipynb", ".sh", ".toml"):
            assert not wrong.search(path.read_text(encoding="utf-8")), path


PIP = [sys.executable, "-m", "pip", "install"]


@pytest.mark.parametrize(
    ("origin", "command"),
    [
        ('{"url": "FOLDER", "dir_info": {}}', [*PIP, "{folder}[lab]"]),
        ('{"url": "FOLDER", "dir_info": {"editable": true}}', [*PIP, "-e", "{folder}[lab]"]),
        ('{"url": "FOLDER/a.whl", "archive_info": {}}', [*PIP, "{folder}/a.whl[lab]"]),
        ('{"url": "FOLDER/gone.whl", "archive_info": {}}', [*PIP, "k3d>=2.16", "numba>=0.60"]),
        ("", [*PIP, "k3d>=2.16", "numba>=0.60"]),  # from an index, whose name nobody knows here
        ("{", [*PIP, "k3d>=2.16", "numba>=0.60"]),
        (
            '{"url": "https://example.org/r.git", "vcs_info": {"vcs": "git", "commit_id": "abc"}}',
            [*PIP, "mini-cnc-rds[lab] @ git+https://example.org/r.git@abc"],
        ),
        ('{"url": "https://example.org/a.whl"}', [*PIP, "mini-cnc-rds[lab] @ https://example.org/a.whl"]),
    ],
)
def test_the_remedy_is_from_where_this_copy_came(
    origin: str, command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "my copy"
    about = tmp_path / "mini_cnc_rds-1.dist-info"
    for each in (folder, about):
        each.mkdir()
    (folder / "pyproject.toml").touch()
    (folder / "a.whl").touch()
    (about / "direct_url.json").write_text(origin.replace("FOLDER", folder.as_uri()))
    (about / "METADATA").write_text(
        "Name: mini-cnc-rds\nVersion: 1\nRequires-Dist: numpy\nRequires-Dist: k3d>=2.16; extra == 'lab'\n"
        "Requires-Dist: mini-cnc-rds[fast]; extra == 'lab'\nRequires-Dist: numba>=0.60; extra == 'fast'\n"
    )
    monkeypatch.setattr(installed, "_distribution", lambda: PathDistribution(about))
    monkeypatch.setattr(installed, "find_spec", lambda name: object())  # pip is there
    assert installed.install_command("lab") == installed._line([word.format(folder=folder) for word in command])


def test_the_remedy_is_for_this_interpreter_and_its_installer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installed, "_distribution", lambda: None)  # a checkout
    monkeypatch.setattr(installed, "find_spec", lambda name: None)  # no pip
    monkeypatch.setattr(sys, "prefix", str(tmp_path / "env"))
    with_uv = ["uv", "pip", "install", "--python", sys.executable, "-e", f"{ROOT}[lab]"]
    monkeypatch.setattr(shutil, "which", lambda name: "/bin/uv")
    assert installed.install_command("lab") == installed._line(with_uv)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    assert installed.install_command("lab").startswith(installed._line([sys.executable, "-m", "ensurepip"]) + " && ")
    (tmp_path / "env").mkdir()
    (tmp_path / "env" / ".installed").touch()
    by_make = ["make", "-C", str(ROOT), "-B", "setup", f"VENV={tmp_path / 'env'}"]
    assert installed.install_command("lab") == installed._line(by_make)


# --- a bare installation ------------------------------------------------------------------------------------------


def required() -> dict[str, Path]:
    """Files and folders of all that the package cannot do without, as they are installed here."""
    names = [Requirement(line).name for line in requires(installed.DISTRIBUTION) or () if "extra ==" not in line]
    return package_paths(tuple(names))


def test_what_it_cannot_do_without_is_small() -> None:
    assert not EXTRAS & set(required())
    files = [file for path in required().values() for file in (path.rglob("*") if path.is_dir() else [path])]
    size = sum(file.stat().st_size for file in files if file.is_file() and file.suffix != ".pyc")
    assert 50e6 < size < MOST


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder like one that was unpacked from a download, with a blank in its name."""
    folder = tmp_path_factory.mktemp("unpacked") / "my copy"
    folder.mkdir()
    for name in COPIED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / name, folder)
    return folder


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory, copy: Path) -> Iterator[Path]:
    """The interpreter of an environment with the package's wheel and what that requires: no extra, no pip."""
    if shutil.which("uv") is None:
        pytest.skip("uv is not installed, which makes the environments of these tests")
    pytest.importorskip("hatchling", reason="hatchling, which builds the wheel, is not installed: make setup does it")
    folder = tmp_path_factory.mktemp("bare")
    run("uv", "venv", "-q", "--python", sys.executable, str(folder / "env"))
    python = folder / "env" / ("Scripts" if os.name == "nt" else "bin") / "python"
    site = Path(run(str(python), "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").stdout.strip())
    for name, path in required().items():  # as copies: no index is asked, and what is installed there stays there
        (shutil.copytree if path.is_dir() else shutil.copy2)(path, site / name)
    options = ("--wheel", "--no-build-isolation", "--python", sys.executable)
    run("uv", "build", "-q", *options, str(copy), "-o", str(folder))
    install(python, str(next(folder.glob("*.whl"))))
    yield python


def run(*command: str, code: int | None = 0, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=cwd or ROOT.anchor)
    assert code is None or done.returncode == code, done.stdout + done.stderr
    return done


def install(python: Path, *what: str) -> None:
    run("uv", "pip", "install", "-q", "--no-deps", "--python", str(python), *what)


def packages(python: Path) -> dict[str, str]:
    """Version of each installed package."""
    found = json.loads(run("uv", "pip", "list", "-q", "--format", "json", "--python", str(python)).stdout)
    return {each["name"]: each["version"] for each in found}


EXPERIMENT = """
axis = "X"
duration = 0.3
[reference]
kind = "sinusoid"
amplitude = 1.0
frequency = 5.0
[controller]
name = "tracking"
poles = [[-32, 24], [-32, -24]]
observer_pole = -80
"""
OPENED = """
import sys
import rds
from rds.core.errors import InputError
first, second = (rds.open_result(name) for name in ("simulation", "emulation/result.mat"))
assert (first["X_measured"] == second["X_measured"]).all() and len(first) == 300
assert first.save("again.mat").is_file() and first.save("again.csv").is_file()
assert (rds.open_result("again.csv")["X_voltage"] == rds.open_result("again.mat")["X_voltage"]).all()
for verb in (lambda: first.table, lambda: first.save("again.parquet")):
    try:
        verb()
    except InputError as error:
        assert "[tables]" in str(error), error
    else:
        raise AssertionError("pandas or pyarrow is here")
assert not {"pandas", "pyarrow", "scipy", "control"} & set(sys.modules)
"""


@pytest.mark.realtime
def test_a_bare_installation_runs_all_modes_and_reopens_what_it_saved(bare: Path, alone: Path) -> None:
    (alone / "e.toml").write_text(EXPERIMENT)
    for mode in ("simulation", "emulation", "implementation"):
        done = run(str(bare), "-m", "rds", "run", "e.toml", "--mode", mode, "--out", mode, code=None, cwd=alone)
        assert done.returncode in (0, 1), done.stderr  # 1: its timing may be missed on a busy computer
        assert {"result.csv", "result.json", "result.mat", "report.html", "X.png"} <= set(os.listdir(alone / mode))
        assert not (alone / mode / "result.parquet").exists()
    compared = run(str(bare), "-m", "rds", "compare", "simulation", "emulation", cwd=alone)
    assert "identical sample for sample" in compared.stdout
    run(str(bare), "-c", OPENED, cwd=alone)
    (alone / "part.ngc").write_text("G21 G90 G94\nG1 X2 F600\nG2 X3 Y1 I0 J1\nM2\n")
    for command in (["nc", "run", "part.ngc", "--out", "part"], ["nc", "check", "part.ngc"], ["check", "e.toml"]):
        done = run(str(bare), "-m", "rds", *command, code=None, cwd=alone)
        assert "Traceback" not in done.stderr
    assert (alone / "part" / "result.csv").is_file()
    refused = run(str(bare), "-m", "rds", "fit", "simulation", "--structure", "axis", code=2, cwd=alone)
    assert "a fit needs scipy, which is not installed; install it with: uv pip install --python" in refused.stderr
    assert ".whl[analysis]" in refused.stderr


@pytest.mark.parametrize("origin", ["wheel", "folder", "editable"])
def test_the_printed_remedy_works(origin: str, bare: Path, copy: Path, tmp_path: Path) -> None:
    if run("uv", "pip", "install", "-q", "--dry-run", "--python", str(bare), "ruckig", code=None).returncode:
        pytest.skip("no package index is reached, and ruckig is not in uv's cache")
    if origin != "wheel":  # which the environment has by now
        run("uv", "pip", "uninstall", "-q", "--python", str(bare), installed.DISTRIBUTION)
        install(bare, *(["-e"] if origin == "editable" else []), str(copy))
    code = f"from rds.core.errors import InputError\ntry:\n    {MOVE}\nexcept InputError as error:\n    print(error)"
    said = run(str(bare), "-c", code, cwd=tmp_path).stdout
    assert "a jerk-limited move in the least time needs ruckig, which is not installed; install it with: " in said
    place = {"wheel": ".whl[motion]'", "folder": f"'{copy}[motion]'", "editable": f"-e '{copy}[motion]'"}[origin]
    command = said.strip().partition("install it with: ")[2]
    assert command.endswith(place)
    before = packages(bare)
    subprocess.run(command, shell=True, check=True, capture_output=True, timeout=120, cwd=tmp_path)
    run(str(bare), "-c", MOVE, cwd=tmp_path)
    assert {name: number for name, number in packages(bare).items() if before.get(name) != number}.keys() == {"ruckig"}
    run("uv", "pip", "uninstall", "-q", "--python", str(bare), "ruckig")
