"""Build: the student's files checked, each fault at its line."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from rds.core.errors import InputError
from rds.panels.equipment.build import Builds

GOOD = "def control(t, r, y, state, params):\n    return 10.0 * (r.position - y), state\n"


def write(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text)
    return folder / name


def test_a_good_file_is_checked_once_until_it_changes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from rds import checks

    calls = []
    real = checks.check_file
    monkeypatch.setattr(checks, "check_file", lambda *a, **k: calls.append(a) or real(*a, **k))
    builds, path = Builds(), write(tmp_path, "mine.py", GOOD)
    first = builds.check("controller", path, 0.001)
    assert first.ok and "keeps its interface" in first.sentence and first.text == GOOD
    assert builds.check("controller", path, 0.001) is first and len(calls) == 1
    path.write_text(GOOD.replace("10.0", "20.0"))
    assert builds.check("controller", path, 0.001).ok and len(calls) == 2


def test_a_file_is_checked_again_when_one_that_it_imports_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []
    report = SimpleNamespace(reports=[], warnings=[], interfaces=["controller"])
    monkeypatch.setattr("rds.checks.check_file", lambda *a, **k: calls.append(a) or report)
    builds, path = Builds(), write(tmp_path, "mine.py", "import math\nfrom gains import Kp\n" + GOOD)
    for number, text in enumerate(("", "from more import Kp\nimport mine\n", "Kp = 1.0\n"), start=1):
        write(tmp_path, "gains.py", text)
        for _ in range(2):
            builds.check("controller", path, 0.001)
        assert len(calls) == number
    write(tmp_path, "gains.py", "from more import Kp\n")
    write(tmp_path, "more.py", "Kp = 2.0\n")
    builds.check("controller", path, 0.001)
    write(tmp_path, "more.py", "Kp = 3.0\n")
    builds.check("controller", path, 0.001)
    write(tmp_path, "beside.py", "Kp = 3.0\n")  # which nobody imports
    builds.check("controller", path, 0.001)
    assert len(calls) == 5


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        (GOOD.replace("return", "retrun"), 2, "syntax"),
        (GOOD.replace("r.position", "r.positoin"), 2, "positoin"),
        ("import no_such_module_at_all\n" + GOOD, 1, "no_such_module_at_all"),
        ("last = 0.0\n\n\ndef control(t, r, y, state, params):\n    global last\n    last = last + r.position - y\n"
         "    return last, state\n", 5, "state"),
        ("\n\ndef control(t, r, y, state, params):\n    while True:\n        pass\n", 4, "does not return"),
    ],
)  # fmt: skip
def test_a_fault_is_marked_at_its_line(
    text: str, line: int, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rds import checks

    real = checks.check_file
    monkeypatch.setattr(checks, "check_file", lambda path, T, **more: real(path, T, time_limit=2.0, **more))
    checked = Builds().check("controller", write(tmp_path, "mine.py", text), 0.001)
    assert not checked.ok
    assert any(mark.line in (line, line + 1) and words in mark.text for mark in checked.marks), checked.marks


def test_a_message_names_its_line_once(tmp_path: Path) -> None:
    path = write(tmp_path, "mine.py", "def control(t, r, y, state, params)\n    return 0.0, state\n")
    (mark,) = Builds().check("controller", path, 0.001).marks
    assert mark.line == 1 and mark.text.startswith("syntax error: expected ':'")


def test_a_key_that_params_lacks_is_told_in_words(tmp_path: Path) -> None:
    text = "params = {'Kp': 1.0}\n\n\ndef control(t, r, y, state, params):\n    return params['Kd'] * y, state\n"
    checked = Builds().check("controller", write(tmp_path, "mine.py", text), 0.001)
    assert "mine.py, line 5" in checked.sentence and "KeyError: 'Kd' (the dict has no such key)" in checked.sentence


def test_what_is_no_such_part_is_said(tmp_path: Path) -> None:
    builds = Builds()
    assert "there is no such file" in builds.check("controller", tmp_path / "none.py", 0.001).sentence
    model = write(tmp_path, "model.py", "def derivatives(t, x, u, params):\n    return [x[1], u[0]]\n")
    assert "it holds a model and no controller" in builds.check("controller", model, 0.001).sentence
    rows = write(tmp_path, "rows.csv", "time,value\n0,1\n1,2\n0.5,3\n")
    (mark,) = builds.check("signal", rows, 0.001).marks
    assert mark.line == 4 and "times must increase" in mark.text
    with pytest.raises(InputError, match=r"rows.csv, line 4: .*times must increase"):
        builds.require([("signal", rows)], 0.001)
