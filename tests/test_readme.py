"""The README and the first tutorial are true: their files, commands and code are run in order, in an empty folder, as
their reader would.
"""

from __future__ import annotations

import inspect
import re
import shlex
import signal
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import can
import numpy as np
import pictures
import pytest
from documents import ROOT, Block, blocks, environment, is_real_time, run, save, shorten
from typer.main import get_command
from typer.testing import CliRunner
from waiting import wait_for

from rds.cli.main import app

README = blocks("README.md")
BLOCKS = [*README, *blocks("docs/first-axis.md")]
INSTALLATION, HARDWARE = blocks("docs/installation.md"), blocks("docs/hardware.md")
DOCUMENTS = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md", *(f"docs/{path.name}" for path in ROOT.glob("docs/*.md"))]
SCREEN = 90  # lines of the README: one screen to the first sine, one to everything else
ELSEWHERE = (
    "make ",
    "source ",
    "jupyter lab",
    "rds app",
)  # not run by this test
SHORT = 0.5  # s, of real-time runs


@pytest.mark.realtime
def test_the_first_ten_minutes(alone: Path) -> None:
    ran = 0
    server = None
    try:
        for block in BLOCKS:
            save([block], alone)
            if block.language == "python" and block.words == "run":
                _run_python(block)
            for command, output in _commands(block):
                if command.startswith(ELSEWHERE):
                    continue
                words = shlex.split(command)
                assert words[0] == "rds", command
                if words[1:3] == ["machine", "serve"]:
                    server = _serve(words[1:])
                else:
                    _run_command(words[1:], output, in_a_process=ran == 0)  # the others take as long to start
                ran += 1
    finally:
        if server is not None:
            server.send_signal(signal.SIGINT)
            assert server.wait(60) == 0
    assert ran >= 12


def test_the_readme_is_two_screens() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= SCREEN
    assert re.findall("^## (.*)", text, re.MULTILINE) == ["The first sine", "Everything else"]


def test_its_picture_is_what_its_commands_draw() -> None:
    """Pixel by pixel, but for what another release of matplotlib may do to the edges of letters."""
    kept, drawn = (np.asarray(image.convert("RGB"), float) for image in pictures.kept_and_drawn("first-sine"))
    assert kept.shape == drawn.shape
    assert np.abs(kept - drawn).mean() < 1.0, f"draw it afresh: {pictures.COMMAND}"
    assert pictures.path("first-sine").stat().st_size < 40_000


def test_its_files_are_the_examples() -> None:
    files = {block.file: block.text for block in BLOCKS if block.file}
    for name in ("my_controller.py", "my_model.py", "experiment.toml"):
        assert files[name] == (ROOT / "examples" / name).read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "block", [b for b in HARDWARE if b.words == "bus"], ids=lambda b: re.findall(r'"(\w+)"', b.text)[0]
)
def test_bus_tables_are_what_python_can_takes(block: Block) -> None:
    import tomllib

    table = tomllib.loads(block.text)["bus"]
    module, name = can.interfaces.BACKENDS[table.pop("interface")]
    parameters = inspect.signature(getattr(import_module(module), name)).parameters
    assert set(table) <= set(parameters)


def test_make_targets_exist() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = [command for block in [*README, *INSTALLATION] for command, _ in _commands(block)]
    targets = [command.split()[1] for command in targets if command.startswith("make ")]
    assert targets == ["setup", "demo", "test"]
    assert all(re.search(rf"^{target}:.*##", makefile, re.MULTILINE) for target in targets)


def test_the_page_of_commands_names_every_command() -> None:
    rows = [row for row in (ROOT / "docs/commands.md").read_text(encoding="utf-8").splitlines() if "`rds " in row]
    missing = []
    for name, command in get_command(app).commands.items():  # type: ignore[attr-defined]
        named = " ".join(row for row in rows if f"`rds {name}" in row)
        words = list(getattr(command, "commands", [])) or [name]
        missing += [f"{name} {word}" for word in words if not re.search(rf"[ `]{word}[ `]", named)]
    assert not missing


@pytest.mark.parametrize("document", DOCUMENTS)
def test_links_lead_somewhere(document: str) -> None:
    text = (ROOT / document).read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if target.startswith("http"):
            continue
        path, _, anchor = target.partition("#")
        file = (ROOT / document).parent / path if path else ROOT / document
        assert file.exists(), target
        if anchor:
            assert anchor in _anchors(file), target


def _commands(block: Block) -> list[tuple[str, list[str]]]:
    """The commands of a console block, each with the lines of output shown after it."""
    found: list[tuple[str, list[str]]] = []
    if block.language == "console":
        for line in block.text.splitlines():
            if line.startswith("$ "):
                found.append((line[2:], []))
            elif line:
                found[-1][1].append(line)
    return found


def _run_command(words: list[str], output: list[str], in_a_process: bool) -> None:
    real_time = words[0] == "run" and is_real_time(words)
    if real_time:
        shorten(Path(words[1]), SHORT)
    if in_a_process:
        process = run(["-m", "rds.cli.main", *words])
        code, stdout, stderr = process.returncode, process.stdout, process.stderr
    else:
        done = CliRunner().invoke(app, words)
        code, stdout, stderr = done.exit_code, done.stdout, done.stderr
    assert "ended early" not in stderr
    # a machine that is busy with other tests may be late; everything else must be as the README says
    assert code in ((0, 1) if real_time else (0,)), stderr
    said = [line.rstrip() for line in stdout.splitlines()]
    for line in output:
        assert line.rstrip() in said


def _run_python(block: Block) -> None:
    script, changes = re.subn(r"duration=[\d.]+", f"duration={SHORT}", block.text)
    assert changes == 1
    Path("script.py").write_text(script, encoding="utf-8")
    done = run(["script.py"])
    assert done.returncode == 0, done.stderr
    assert Path("x.png").stat().st_size > 10_000


def _serve(words: list[str]) -> subprocess.Popen[bytes]:
    log = Path("server.log")
    with open(log, "wb") as output:
        server = subprocess.Popen(
            [sys.executable, "-m", "rds.cli.main", *words], env=environment(), stdout=output, stderr=output
        )
    wait_for(lambda: b"Ctrl-C" in log.read_bytes() or server.poll() is not None)
    assert server.poll() is None, log.read_text()
    return server


def _anchors(file: Path) -> set[str]:
    """The anchors that GitHub gives to the headings of a Markdown file."""
    text = re.sub(r"^```.*?^```$", "", file.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    anchors: set[str] = set()
    for heading in re.findall(r"^#+ (.*)$", text, re.MULTILINE):
        anchor = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        number = 0
        while (name := f"{anchor}-{number}" if number else anchor) in anchors:
            number += 1
        anchors.add(name)
    return anchors
