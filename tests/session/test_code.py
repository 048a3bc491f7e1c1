"""Code in the page, without a browser: templates that work, files, faults with their remedy, versions."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from ipywidgets import Button
from waiting import wait_for

from rds.core.errors import InputError
from rds.core.types import ArcSegment, LineSegment, Source
from rds.interpolators.interpolator import Interpolator
from rds.interpolators.path import interpolate
from rds.panels.code.advice import told
from rds.panels.code.completions import words
from rds.panels.code.file import CodeFile, code_files
from rds.panels.code.state import Code, syntax_fault
from rds.panels.code.templates import TEMPLATES
from rds.panels.code.versions import FOLDER, change_sentence, changes, keep, versions
from rds.panels.code.view import CodeView, changes_html, verdict
from rds.panels.equipment.build import Builds, Checked, Mark
from rds.panels.equipment.state import Equipment
from rds.panels.kit.ticker import Ticker
from rds.panels.session import Session
from rds.panels.session.file_params import file_params

CONTROLLER = TEMPLATES["controller"].text


def code(folder: Path, role: str = "controller") -> Code:
    return Code(Session(folder), role, Builds(), lambda: 0.001)


def found(code: Code) -> Checked:
    checked = wait_for(code.tick)
    assert checked is not None
    return checked


@pytest.mark.parametrize("role", TEMPLATES)
def test_a_template_keeps_its_interface(role: str, tmp_path: Path) -> None:
    made = code(tmp_path, role)
    assert made.file.is_new and not made.file.path.exists()  # to look costs no file
    made.new(TEMPLATES[role].name)
    checked = Builds().check(role, made.file.path, 0.001)
    assert checked.marks == () and made.files() == [TEMPLATES[role].name]


def test_the_template_of_a_controller_runs_and_is_kept_as_a_version(tmp_path: Path) -> None:
    equipment = Equipment(Session(tmp_path), "control")
    code(tmp_path).new()
    for name, value in {"controller": "user", "controller_file": "my_controller.py", "duration": 0.2}.items():
        equipment.choices.set(name, value)
    run = equipment.run().start()
    assert run.wait(60) and run.error is None
    kept = versions(tmp_path, "my_controller.py")
    assert [(each.run, each.text) for each in kept] == [(run.folder.name, CONTROLLER)]


def test_the_interpolator_s_template_follows_lines_and_arcs() -> None:
    space: dict[str, Any] = {}
    exec(TEMPLATES["interpolator"].text, space)
    path = [
        LineSegment((0.0, 0.0, 0.0), (10.0, 0.0, 0.0), 10.0),
        ArcSegment((10.0, 0.0, 0.0), (10.0, 0.0, -1.0), (5.0, 0.0, 0.0), 10.0, clockwise=True),
        ArcSegment((10.0, 0.0, -1.0), (0.0, 0.0, -1.0), (5.0, 0.0, 0.0), 10.0),
    ]
    done = interpolate(path, 0.001, Interpolator("mine", space["interpolate"], Source("mine")))
    assert abs(done.path_error).max() < 1e-9 and done.length == pytest.approx(done.programmed_length, rel=1e-6)
    assert done.position[-1] == pytest.approx([0.0, 0.0, -1.0], abs=1e-9)


def test_a_fault_is_found_at_its_line_with_its_remedy_and_the_check_follows_the_text(tmp_path: Path) -> None:
    made = code(tmp_path)
    assert made.tick() is None and not made.checking  # what is only looked at is not run
    made.edit(CONTROLLER.replace("r.position", "r.positoin"))
    checked = found(made)
    (mark,) = checked.marks
    line = checked.text.splitlines().index("    error = r.positoin - y  # mm") + 1
    assert mark.line == line and verdict(checked) == f"my_controller.py: 1 fault: line {line}"
    assert told(mark, checked.text, []).text.endswith(
        "'Reference' object has no attribute 'positoin'. Did you mean r.position? r has position, velocity, "
        "acceleration"
    )
    made.edit(CONTROLLER.replace("error = ", "error == "))
    made.edit("def control(t, r, y, state, params)\n    return 0.0, state\n")
    checked = found(made)
    assert checked.marks[0].line == 1 and "expected ':'" in checked.marks[0].text
    made.edit(CONTROLLER)
    assert found(made).ok and made.file.path.read_text() == CONTROLLER


@pytest.mark.parametrize(
    ("said", "remedy"),
    [
        ("KeyError: 'Kpp'", 'Did you mean params["Kp"]'),
        ("KeyError: 'gain'", "Write it into params at the top; there are Kp, Kv"),
        ("NameError: name 'np' is not defined", "`import numpy as np`"),
        ("NameError: name 'sin' is not defined", "`from math import sin`"),
        ("NameError: name 'Kp' is not defined", 'Write params["Kp"]'),
        ("NameError: name 'eror' is not defined", "Did you mean error?"),
        ("ZeroDivisionError: float division by zero", "In the first sample everything may be zero"),
        ("IndexError: list index out of range", "initial_state must have as many values"),
    ],
)
def test_remedies(said: str, remedy: str) -> None:
    mark = Mark(3, f"control() failed in its first call: my.py, line 3, in control: {said}: `x` (rule: runs)")
    shown = told(mark, CONTROLLER, ["Kp", "Kv"]).text
    assert shown.startswith(f"control() failed in its first call: {said}. ") and remedy in shown


def test_a_text_that_python_cannot_read_needs_no_process() -> None:
    assert syntax_fault(CONTROLLER) is None
    fault = syntax_fault("x = (1,\n")
    assert fault is not None and fault.line == 1 and "was never closed" in fault.text


def test_files_are_listed_by_what_they_are_and_names_are_checked(tmp_path: Path) -> None:
    for role, template in TEMPLATES.items():
        (tmp_path / f"a_{role}.py").write_text(template.text)
    (tmp_path / "broken.py").write_text("def control(t, r, y, state, params)\n")
    (tmp_path / "other.py").write_text("x = 1\n")
    (tmp_path / "latin.py").write_bytes(b"# \xe9\ndef control(): pass\n")
    assert code_files(tmp_path, "controller") == ["a_controller.py", "broken.py"]
    assert code_files(tmp_path, "model") == ["a_model.py"]
    made = code(tmp_path)
    assert made.file.name == "a_controller.py"
    with pytest.raises(InputError, match=r"there is a a_controller\.py already"):
        made.new("a_controller")
    for bad in ("../x.py", "a/b.py", ".hidden.py"):
        with pytest.raises(InputError, match="no name of a file"):
            made.new(bad)
    made.new()
    made.new()
    assert made.file.name == "my_controller_2.py"
    with pytest.raises(InputError, match=r"latin.py: is no text at byte 3"):
        made.open("latin.py")


def test_a_file_that_is_dropped_replaces_none(tmp_path: Path) -> None:
    made = code(tmp_path)
    assert made.take("mine.py", CONTROLLER.encode()) == "mine.py"
    assert made.take("mine.py", CONTROLLER.encode()) == "mine.py"  # the same once more
    assert made.take("mine.py", CONTROLLER.replace("25.0", "30.0").encode()) == "mine_2.py"
    assert (tmp_path / "mine.py").read_text() == CONTROLLER and made.file.name == "mine_2.py"
    with pytest.raises(InputError, match="holds a model, not a controller"):
        made.take("axis.py", TEMPLATES["model"].text.encode())
    with pytest.raises(InputError, match=r"drop one that ends with \.py"):
        made.take("notes.txt", b"x")
    assert not (tmp_path / "axis.py").exists()


def test_what_another_program_writes_is_never_written_over(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(CONTROLLER)
    file = CodeFile(tmp_path, "mine.py", "controller")
    path.write_text(other := CONTROLLER.replace("25.0", "26.0"))
    with pytest.raises(InputError, match="changed by another program"):
        file.edit(CONTROLLER.replace("25.0", "27.0"))
    assert path.read_text() == other == file.text
    file.edit(CONTROLLER)
    path.unlink()
    file.edit(other)  # one that was deleted is there again
    assert path.read_text() == other
    path.write_bytes(latin := "# für\n".encode("latin-1"))
    with pytest.raises(InputError, match="is no text at byte 4"):
        file.edit(CONTROLLER)
    assert path.read_bytes() == latin


def test_a_file_that_cannot_be_edited_here_is_said(tmp_path: Path) -> None:
    view = CodeView(SimpleNamespace(ticker=Ticker()), {"controller": code(tmp_path)}, lambda *_: None, Button())
    (tmp_path / "laws").mkdir()
    (tmp_path / "laws" / "mine.py").write_text(CONTROLLER)
    view.open("controller", "laws/mine.py")
    assert view.code.file.name == "my_controller.py" and "is no name of a file in your folder" in view.said.value
    (tmp_path / "my_controller.py").write_bytes("# für\n".encode("latin-1"))
    view.refresh()
    assert "is no text at byte 4" in view.said.value


def test_versions_of_every_run_with_what_changed(tmp_path: Path) -> None:
    second = CONTROLLER.replace("25.0", "40.0")
    assert keep(tmp_path, "mine.py", CONTROLLER, "first") and keep(tmp_path, "mine.py", second, "second")
    assert not keep(tmp_path, "mine.py", second, "third")  # nothing has changed
    with (tmp_path / FOLDER / "mine.py.jsonl").open("a") as stream:
        stream.write('{"when": 1, "run": \n')  # damaged
    kept = versions(tmp_path, "mine.py")
    assert [each.run for each in kept] == ["second", "first"] and kept[1].text == CONTROLLER
    assert change_sentence(CONTROLLER, second) == "+1 −1 lines"
    rows = changes(CONTROLLER, second)
    assert [text.strip() for sign, text in rows if sign == "+"] == ['"Kp": 40.0,  # V/mm, proportional gain']
    assert '<b class="gone">-     &quot;Kp&quot;: 25.0' in changes_html(rows)
    assert (tmp_path / FOLDER / "mine.py.jsonl").stat().st_mode & 0o077 == 0


def test_completion_has_the_interface_and_the_file_s_own_params(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(CONTROLLER)
    offered = {(word["after"], word["label"]): word for word in words("controller", file_params(tmp_path / "mine.py"))}
    assert offered["r", "velocity"]["detail"] == "mm/s"
    assert offered["params", "Kp"]["info"] == "V/mm, proportional gain"
    (tmp_path / "marked.py").write_text("params = {'K': 2, 'n': 1%s}  # gain\n" % ("0" * 400), encoding="utf-8-sig")
    assert file_params(tmp_path / "marked.py") == [("K", 2.0, "gain")]  # n is no number that can be worked with
    assert ("segment", "feed_rate") in {(each["after"], each["label"]) for each in words("interpolator", [])}
