"""Hostile notebooks, zips, folders and names, handed in by one class: nobody gains, and nobody else notices."""

# ruff: noqa: E501 - what is handed in is easier to read on the line on which it is written
from __future__ import annotations

import csv
import io
import json
import os
import struct
import zipfile
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import pytest

from rds.grading.batch.outcome import BatchOutcome
from rds.grading.batch.run import run_batch
from rds.grading.exports.export import export
from rds.grading.exports.exported import ExportOptions
from rds.grading.grade import Status
from rds.grading.intake.names import shown
from rds.grading.sandbox import available
from tests.grading.batches import ASSIGNMENT, law, notebook, put
from tests.grading.made import assignment_in

pytestmark = pytest.mark.skipif(available() is not None, reason=str(available()))

SECRET = "hunter2-of-somebody-else"
OK, LOAD, REFUSED, MISSING = Status.OK, Status.FAILED_TO_LOAD, Status.REFUSED, Status.MISSING
MARKUP = "<img src=x onerror=alert(1)><script>alert(1)</script>"
Zip = Callable[[zipfile.ZipFile], object]


def cells(**more: object) -> dict[str, object]:
    """A notebook as a dict, with its law."""
    whole: dict[str, object] = json.loads(notebook(law()))
    return whole | more


def entry(
    name: str, mode: int = 0, date: tuple[int, int, int, int, int, int] = (2026, 1, 5, 1, 1, 2)
) -> zipfile.ZipInfo:
    """A file's entry in a zip."""
    made = zipfile.ZipInfo(name, date)
    made.external_attr = mode << 16
    return made


# by student: the notebook's text, and how it must end; with OK it earns what the same law earns of everybody
NOTEBOOKS: dict[str, tuple[str, Status]] = {
    "nb-runs-another": (notebook("%run ../honest/controller.py", law()), REFUSED),
    "nb-loads-a-secret": (notebook("%load ../../secret.txt", law()), REFUSED),
    "nb-shell": (notebook("!cat ../../secret.txt > stolen\nfiles = !ls /", law()), OK),
    "nb-bash-cell": (notebook("%%bash\ntouch stolen", law()), OK),
    "nb-leaves-at-once": (notebook("import os\nos._exit(0)", law()), OK),
    "nb-prints-markup": (notebook(f"print({MARKUP!r})", law()), OK),
    "nb-numbers-as-source": (json.dumps(cells(cells=[{"cell_type": "code", "source": [1, 2]}])), REFUSED),
    "nb-cells-are-texts": (json.dumps(cells(cells=["import os", 5, None])), REFUSED),
    "nb-of-format-3": (json.dumps({"nbformat": 3, "worksheets": [{"cells": []}]}), REFUSED),
    "nb-deep": ('{"cells": ' + "[" * 100_000 + "]" * 100_000 + "}", REFUSED),
    "nb-integer": (json.dumps(cells()).replace('"nbformat": 4', '"nbformat": ' + "9" * 5000), REFUSED),
    "nb-no-number": (json.dumps(cells(metadata={"x": float("nan")})), OK),
    "nb-other-kernel": (json.dumps(cells(metadata={"kernelspec": {"name": MARKUP, "language": "R"}})), OK),
    "nb-graded-already": (json.dumps(cells(metadata={"grade": 100, "score": 100, "nbgrader": {"points": 100}})), OK),
    "nb-half-a-character": (notebook("x = '\\ud800'", law()).replace("\\\\ud800", "\\ud800"), LOAD),
    "nb-null": (notebook("x = 1\x00", law()), LOAD),
    "nb-python": (law(), REFUSED),
    "nb-marks-of-cells": (notebook("# cell 99\nx = (", law()), LOAD),
    "nb-encoding": (notebook("# -*- coding: utf-7 -*-\n+AAo-raise", law()), LOAD),
    "nb-rebinds": (notebook(law(), "def control(*a): return 1e9, 0\n__name__ = 'x'", law()), OK),
}
ZIPS: dict[str, tuple[Zip, Status]] = {
    "zip-link": (lambda z: z.writestr(entry("controller.py", 0o120777), "../honest/controller.py"), REFUSED),
    "zip-device": (lambda z: z.writestr(entry("controller.py", 0o020666), ""), REFUSED),
    "zip-up": (lambda z: z.writestr(entry("../honest/controller.py"), law(1.0)), REFUSED),
    "zip-root": (lambda z: z.writestr(entry("/controller.py"), law()), REFUSED),
    "zip-backslash": (lambda z: z.writestr(entry("..\\..\\controller.py"), law()), REFUSED),
    "zip-drive": (lambda z: z.writestr(entry("C:/controller.py"), law()), REFUSED),
    "zip-of-honest": (lambda z: z.writestr(entry("honest/controller.py"), law(29.0)), OK),
    "zip-as-moodle": (lambda z: z.writestr(entry("Honest_501_assignsubmission_file_/controller.py"), law()), OK),
    "zip-lzma": (lambda z: z.writestr(entry("controller.py"), law(), zipfile.ZIP_LZMA), REFUSED),
    "zip-in-zip": (lambda z: z.writestr(entry("inner.zip"), b"PK\5\6" + bytes(18)), REFUSED),
    "zip-crowd": (lambda z: [z.writestr(entry(f"{k}.py"), "") for k in range(300)], REFUSED),
    "zip-bomb": (lambda z: z.writestr(entry("controller.py"), "#" * (32 << 20), zipfile.ZIP_DEFLATED), REFUSED),
    "zip-formula": (lambda z: [z.writestr(entry(f"{name}.py"), law()) for name in ("=1+1", "@SUM(1)")], OK),
    "zip-clutter": (lambda z: [z.writestr(entry("__MACOSX/._controller.py"), MARKUP), z.writestr(entry("a/controller.py"), law())], OK),
    "zip-beside": (lambda z: [z.writestr(entry(n), law()) for n in ("controller.py", "numpy.py", "sitecustomize.py", "rds/__init__.py")], OK),
    "zip-nothing": (lambda z: None, MISSING),
}  # fmt: skip
NAMES = (
    *("=1+1", "+cmd", "-rf", "@SUM(A1)", "\t=1", "$(touch stolen)", "`touch stolen`", "a;touch stolen", "%s%n%x"),
    *(
        "{{7*7}}",
        "\\input{x}",
        "<b>x",
        MARKUP.replace("/", "\u2044"),
        "a\r\nb",
        "a,b",
        'a"b',
        "'; --",
        "con",
        "__proto__",
    ),
    *("e\u0301", "\u00e9", "\u202exyz", "\u200b", "\u2028", "😀" * 40, "index.html", "grades.csv", "batch.json"),
)
HONEST = ("honest", "honest-2")


def _zip(path: Path, fill: Zip) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        fill(archive)


def _broken_zips(folder: Path) -> None:
    """Zips whose bytes are changed: cut, encrypted, pointing elsewhere, with a lie of the size."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr(entry("controller.py"), law())
    data, at = stream.getvalue(), stream.getvalue().rindex(b"PK\1\2")
    changes = {
        "zip-cut": data[:-30],
        "zip-encrypted": data[: at + 8] + struct.pack("<H", 1) + data[at + 10 :],
        "zip-elsewhere": data[: at + 42] + struct.pack("<I", 2**31) + data[at + 46 :],
        "zip-size": data[: at + 24] + struct.pack("<I", 2**32 - 2) + data[at + 28 :],
        "zip-date": data[: at + 12] + bytes(4) + data[at + 16 :],
        "zip-noise": os.urandom(9) * 999,
    }
    for name, changed in changes.items():
        put(folder, {f"{name}/.keep": ""})
        (folder / name / "mine.zip").write_bytes(changed)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The assignment in `task`, the class in `in`, a secret that no submission may reach."""
    folder = tmp_path_factory.mktemp("class")
    assignment_in(folder / "task", ASSIGNMENT, law())
    (folder / "secret.txt").write_text(SECRET)
    put(folder / "in", {f"{name}/controller.py": law() for name in HONEST})
    put(folder / "in", {f"{name}/controller.ipynb": text for name, (text, _) in NOTEBOOKS.items()})
    for name, (fill, _) in ZIPS.items():
        (folder / "in" / name).mkdir()
        _zip(folder / "in" / name / "mine.zip", fill)
    _broken_zips(folder / "in")
    put(folder / "in", {f"{name}/controller.py": law() for name in NAMES})
    beside = (
        "numpy.py",
        "sitecustomize.py",
        "assignment.toml",
        "grade.json",
        "review.jsonl",
        "timestamps.csv",
        "x.pth",
    )
    put(folder / "in/f-beside", dict.fromkeys(beside, f"raise SystemExit({SECRET!r})\n"))
    put(folder / "in/f-beside", {"controller.py": law(), "rds/__init__.py": "1 / 0", "conftest.py": "1 / 0"})
    put(folder / "in/f-deep", {"/".join("d" * 40) + "/controller.py": law()})
    for name in ("f-link", "f-folder-link", "f-sparse", "f-hard", "f-pipe"):
        (folder / "in" / name).mkdir()
    (folder / "in/f-link/controller.py").symlink_to(folder / "secret.txt")
    (folder / "in/f-folder-link/sub").symlink_to(folder / "in/honest")
    os.truncate(os.open(folder / "in/f-sparse/controller.py", os.O_CREAT | os.O_RDWR, 0o600), 4 << 30)
    os.link(folder / "secret.txt", folder / "in/f-hard/controller.py")
    os.mkfifo(folder / "in/f-pipe/controller.py")
    put(folder / "one", {"honest/controller.py": law()})
    return folder


@pytest.fixture(scope="module")
def outcome(place: Path) -> BatchOutcome:
    """All graded in one batch."""
    return run_batch(place / "task", place / "in", place / "out", jobs=2)


def test_each_ends_as_it_must_and_nobody_earns_more_than_the_law_is_worth(outcome: BatchOutcome) -> None:
    statuses = {name: status for table in (NOTEBOOKS, ZIPS) for name, (_, status) in table.items()}
    found = {name: outcome.grades[name].status for name in statuses}
    assert found == statuses, [(n, outcome.grades[n].reason) for n in statuses if found[n] is not statuses[n]]
    honest = outcome.grades["honest"].score
    assert honest > 10.0
    for name, grade in outcome.grades.items():
        assert grade.score <= honest + 0.5, name  # every plant is another
        assert grade.status is OK or not grade.score, name
        assert grade.status is not Status.GRADER_ERROR, (name, grade.reason)
    assert {outcome.grades[shown(name)].status for name in NAMES} == {OK}


def test_the_honest_are_graded_as_if_they_were_alone(place: Path, outcome: BatchOutcome, tmp_path: Path) -> None:
    alone = run_batch(place / "task", place / "one", tmp_path / "alone", jobs=1).grades["honest"]
    assert alone.to_json() == outcome.grades["honest"].to_json()
    assert outcome.grades["honest-2"].score > outcome.grades["honest"].score - 0.5


def test_nothing_is_stolen_and_nothing_left(place: Path, outcome: BatchOutcome) -> None:
    for path in (place / "out").rglob("*"):
        assert not path.is_symlink() and path.resolve().is_relative_to(place / "out")
        assert not path.is_file() or SECRET.encode() not in path.read_bytes(), path
    assert not list(place.rglob("stolen")) and not Path("stolen").exists()
    folders = [path.name for path in (place / "out/students").iterdir()]
    assert len({name.casefold() for name in folders}) == len(outcome.grades)
    assert all(name.isascii() and name.isprintable() and "/" not in name for name in folders)


class _Active(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found += [tag] if tag in ("script", "iframe", "object", "embed", "form", "meta") and not attrs else []
        self.found += [n for n, v in attrs if n.startswith("on") or (v or "").strip().lower().startswith("javascript:")]


def test_pages_and_gradebooks_do_nothing(place: Path, outcome: BatchOutcome) -> None:
    out = place / "out"
    tables = [out / "grades.csv"]
    for to in ("moodle", "nbgrader", "gradescope", "prairielearn"):
        tables += [path for path in map(Path, export(out, to, None, ExportOptions()).files) if path.suffix == ".csv"]
    for page in out.rglob("*.html"):
        parser = _Active()
        parser.feed(page.read_text(encoding="utf-8"))
        assert parser.found == [], page
    for table in tables:
        with open(table, newline="", encoding="utf-8-sig") as stream:
            rows = list(csv.reader(stream))
        assert len({len(row) for row in rows}) == 1, table
        is_ours = table.name == "grades.csv"  # platforms find students by the very text of their names
        cells_ = [cell for row in rows for cell in row] if is_ours else []
        assert not [cell for cell in cells_ if cell.startswith(("=", "+", "-", "@", "\t", "\r"))], table
    for path in out.rglob("results.json"):
        said = json.loads(path.read_text(encoding="utf-8"))
        parser = _Active()
        parser.feed(str(said.get("output", "")))
        assert parser.found == [], path
