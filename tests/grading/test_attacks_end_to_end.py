"""A class of attackers and one honest student, graded in one batch as an instructor does."""

from __future__ import annotations

import csv
import os
import zipfile
from html.parser import HTMLParser
from pathlib import Path

import pytest
from waiting import wait_for

from rds.grading.batch.outcome import BatchOutcome
from rds.grading.batch.run import run_batch
from rds.grading.grade import Status
from rds.grading.intake.names import shown
from rds.grading.sandbox import available
from tests.grading.attacked import below
from tests.grading.batches import ASSIGNMENT, law, put
from tests.grading.made import assignment_in

pytestmark = pytest.mark.skipif(available() is not None, reason=str(available()))

MORE = """
[[criterion]]
name = "work"
kind = "work"
case = "sine"
points = 5.0
full = 10.0
none = 300.0
unit = "events"

[limits]
cpu_seconds = 3.0
wall_seconds = 6.0
load_seconds = 1.0
call_seconds = 0.5
memory_bytes = 268435456
output_bytes = 20000
"""
OK, LOAD, CONTRACT = Status.OK, Status.FAILED_TO_LOAD, Status.BROKE_CONTRACT
KILLED, TIMED_OUT, REFUSED = Status.KILLED, Status.TIMED_OUT, Status.REFUSED
MARKUP = "</pre><script>alert(1)</script><img src=x onerror=alert(1)>"
CANARY = "/tmp/rds-attack-canary"
FORGE = """
import json, sys
kept = []
sys.settrace = sys.setprofile = kept.append
sys.gettrace = sys.getprofile = lambda: kept[-1]
for name, module in list(sys.modules.items()):
    if name.startswith("rds.grading.sandbox.inside") and hasattr(module, "counted"): module.counted = None
"""
REPORT = f"""
for name in ("grade.json", "journal.jsonl", "../grades.csv", {CANARY!r}):
    try: open(name, "w").write("100")
    except OSError: pass
"""
FEW = "initial_state = 0\ndef control(t, r, y, state, params):\n    if t < 0.05: return 0.0, 0\n    "

# by who hands it in: the text, the status; with OK it earns what the honest law does, with all others nothing
ATTACKERS: dict[str, tuple[str, Status]] = {
    "forger": (FORGE + law(), OK),
    "reporter": (REPORT + "print('{\"score\": 100}')\n" + law(), OK),
    "markup": (f"print({MARKUP!r})\n" + law(), OK),
    "daemon": ("import os, time\nif os.fork() == 0:\n    os.setsid()\n    time.sleep(600)\n" + law(), OK),
    "=cmd|' calc'!A0": (law(), OK),
    "a\nb\u202e<b>": (law(), OK),
    "Honest": (law(), OK),
    "l" * 200: (law(), OK),
    "raiser": (f"{FEW}raise ValueError({MARKUP!r})\n", CONTRACT),
    "formula": ("raise type('=HYPERLINK(1)', (Exception,), {})('@SUM(1)')\n", LOAD),
    "text that fails": (f"class E(Exception):\n    def __str__(self): raise KeyError\n{FEW}raise E\n", CONTRACT),
    "text that floods": (f"class E(Exception):\n    def __str__(self): return '<' * 10 ** 7\n{FEW}raise E\n", CONTRACT),
    "leaver": ("import os; os._exit(0)\n", KILLED),
    "killer": ("import os\nos.kill(0, 9)\n" + law(), KILLED),
    "forker": ("import os\nwhile True:\n    try: os.fork()\n    except OSError: pass\n", TIMED_OUT),
    "sleeper": (f"import time\n{FEW}time.sleep(60)\n", TIMED_OUT),
    "eater": ("kept = [bytearray(1 << 20) for _ in range(4096)]\n", LOAD),
    "talker": ("while True: print('x' * 9999)\n", KILLED),
    "nobody": (f"{FEW}return float('nan'), 0\n", CONTRACT),
}
REFUSALS = ("link", "pipe", "bomb", "slip")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The assignment in `task`, everybody's submission in `in`, the honest one's alone in `one`."""
    folder = tmp_path_factory.mktemp("class")
    assignment_in(folder / "task", ASSIGNMENT + MORE, law())
    put(folder / "in", {"honest.py": law(), **{f"{name}.py": text for name, (text, _) in ATTACKERS.items()}})
    put(folder / "one", {"honest.py": law()})
    (folder / "in/link.py").symlink_to("honest.py")
    os.mkfifo(folder / "in/pipe.py")
    for name, inside, text in (("bomb", "controller.py", "#" * (64 << 20)), ("slip", "../../honest.py", "")):
        with zipfile.ZipFile(folder / f"in/{name}.zip", "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr(inside, text)
    return folder


@pytest.fixture(scope="module")
def outcome(place: Path) -> BatchOutcome:
    """All graded in one batch; afterwards nothing of it runs any more."""
    before = below(os.getpid())
    found = run_batch(place / "task", place / "in", place / "out", jobs=2)
    wait_for(lambda: below(os.getpid()) <= before)  # the kernel takes namespaces apart
    return found


def test_nobody_gains_anything_and_each_is_told_why(outcome: BatchOutcome) -> None:
    honest = outcome.grades["honest"]
    assert honest.status is OK and honest.score > 10.0
    assert len(outcome.grades) == 1 + len(ATTACKERS) + len(REFUSALS)
    statuses = [status for _, status in ATTACKERS.values()]
    assert outcome.counts()[OK] == 1 + statuses.count(OK) and outcome.counts()[REFUSED] == len(REFUSALS)
    for name, (_, status) in ATTACKERS.items():
        found = outcome.grades[shown(name)]
        assert found.status is status, (name, found.reason)
        low, high = (honest.score - 5.5, honest.score + 0.5) if status is OK else (0.0, 0.0)  # every plant is another
        assert low <= found.score <= high, name
        assert bool(found.reason) is (status is not OK) and len(found.reason) < 1000 and found.reason.isprintable()


def test_the_honest_grade_is_what_it_would_be_alone(place: Path, outcome: BatchOutcome) -> None:
    alone = run_batch(place / "task", place / "one", place / "alone", jobs=1).grades["honest"]
    assert alone.to_json() == outcome.grades["honest"].to_json()


def test_work_that_is_hidden_from_the_counter_is_counted(outcome: BatchOutcome) -> None:
    work = {name: outcome.grades[name].criteria[2].value for name in ("honest", "forger")}
    assert work["honest"] == work["forger"] != 0.0


def test_nothing_is_left_but_what_a_batch_leaves(place: Path, outcome: BatchOutcome) -> None:
    assert not os.path.lexists(CANARY)
    assert len(list((place / "in").iterdir())) == len(outcome.grades)
    assert (place / "in/honest.py").read_text() == law()
    known = {"batch.json", "grades.csv", "index.html", "journal.jsonl", "similarity.json", "students"}
    assert {path.name for path in (place / "out").iterdir()} == known
    files = {"columns.parquet", "feedback.html", "grade.json", "submission.py"}
    folders = list((place / "out/students").iterdir())
    assert len(folders) == len({path.name.casefold() for path in folders}) == len(outcome.grades)
    assert all({path.name for path in folder.iterdir()} <= files for folder in folders)


class _Active(HTMLParser):
    """Finds what a browser would run."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found += [tag] if tag in ("script", "iframe", "object", "embed") else []
        self.found += [
            name for name, value in attrs if name.startswith("on") or (value or "").startswith("javascript:")
        ]


def test_pages_run_nothing_and_tables_hold_no_formula(place: Path, outcome: BatchOutcome) -> None:
    pages = list((place / "out").rglob("*.html"))
    assert len(pages) == 1 + len(outcome.grades)
    for page in pages:
        parser = _Active()
        parser.feed(page.read_text())
        assert parser.found == [], page
    with open(place / "out/grades.csv", newline="") as stream:
        cells = [cell for row in csv.reader(stream) for cell in row]
    assert not [cell for cell in cells if cell.startswith(("=", "+", "-", "@", "\t", "\r"))]
