"""An assignment is read strictly: what is wrong is told with file, line and remedy."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest

from rds.core.errors import InputError
from rds.grading.assignment.assignment import read_assignment
from rds.grading.assignment.hand_out import hand_out
from rds.grading.sandbox.limits import Limits
from tests.grading.made import HEAD, RMS, SINE, assignment_in

WHOLE = HEAD + SINE + RMS


def line_of(text: str, words: str) -> int:
    return text[: text.index(words)].count("\n") + 1


def test_a_whole_assignment(tmp_path: Path) -> None:
    text = WHOLE.replace('kind = "controller"', 'kind = "controller"\ndue = 2026-11-30T23:59:00+01:00', 1)
    text += "[limits]\ncpu_seconds = 5\nprocesses = 4\n[late]\npercent_per_day = 10\n"
    read = read_assignment(assignment_in(tmp_path, text))
    assert read.title == "Tracking" and read.kind == "controller" and read.files == ("my_controller.py",)
    assert read.due is not None and read.due.utcoffset() == timedelta(hours=1)
    assert read.limits == Limits(cpu_seconds=5.0, processes=4)
    assert read.late.percent_per_day == 10.0
    assert read.max_score == 10.0
    assert [case.name for case in read.cases] == ["sine"]
    assert read.criteria[0].bands.full == 0.05 and read.criteria[0].unit == "mm"


@pytest.mark.parametrize(
    "old, new, said",
    [
        ('kind = "rms-error"', 'kind = "rms-eror"', "did you mean 'rms-error'"),
        ('case = "sine"', 'case = "sin"', "no case; there are sine"),
        ("full = 0.05", "full = 0.6", "must be more than full"),
        ("full = 0.05", "full = 0.5", "must be more than full"),
        ("full = 0.05", 'full = "0.05"', "without quotes"),
        ("points = 10", "point = 10", "is 'point' meant to be it"),
        ('unit = "mm"', 'unit = "m"', "must be 'mm'"),
        ('unit = "mm"', "", 'write `unit = "mm"`'),
        ("amplitude = 2.0", "amplitud = 2.0", "amplitud"),
        ("amplitude = 2.0", "amplitude = 200.0", "travels from -75"),
        ("duration = 1.0", "duration = 1.0\nmode = 'emulation'", "no place in a case"),
        ("duration = 1.0", "duration = 1.0\nruns = 0", "from 1 to 1000"),
        ("duration = 1.0", "duration = 1.0\nnoize = 0.1", "did you mean 'noise'"),
        ("duration = 1.0", "duration = 1.0\nprogram = '../x.ngc'", "outside the assignment"),
        ('axis = "X"', 'axis = "W"', "it has X, Y, Z"),
        ('secret = "not told to anybody"', 'secret = "short"', "8 characters"),
        ('secret = "not told to anybody"', "", "8 characters"),
        ("my_controller.py", "a/../my_controller.py", "without a folder"),
        ("my_controller.py", "my_controller.exe", ".py or .ipynb"),
        ('kind = "controller"', 'kind = "controler"', "did you mean 'controller'"),
        ('kind = "controller"', 'kind = "model"', "reference has no place in a model"),
        ('solution = "solution.py"', 'solution = "nothing.py"', "there is no file"),
        ('title = "Tracking"', 'due = "tomorrow"', "is no time"),
        ('title = "Tracking"', "due = 2026-11-30T23:59:00", "time zone"),
        ('title = "Tracking"', "tile = 'Tracking'", "unknown key 'tile'"),
        ('title = "Tracking"', "self_check = 'yes'", "known: visible, blind, off"),
        ("frequency = 1.0", "frequency = 1.0\n[case.vary]\ntaw = '±10 %'", "no parameter 'taw'"),
        ("frequency = 1.0", "frequency = 1.0\n[case.vary]\ntau = 'ten'", "must be a range"),
        ("frequency = 1.0", "frequency = 1.0\n[case.vary]\ntau = '±150 %'", "tau"),
        ("frequency = 1.0", "frequency = 1.0\n[case.disturbance]\nkind = 'stairs'", "stairs"),
        ("frequency = 1.0", "frequency = 1.0\n[case.disturbance]\nkind='constant'\nvalue=1.0\nstart=9.0", "no sample"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(old: str, new: str, said: str, tmp_path: Path) -> None:
    text = WHOLE.replace(old, new, 1)
    assert text != WHOLE
    with pytest.raises(InputError) as error:
        read_assignment(assignment_in(tmp_path, text))
    assert said in str(error.value)
    assert "assignment.toml" in str(error.value)


def test_a_path_is_no_reference_of_a_case(tmp_path: Path) -> None:
    path = 'kind = "path"\nstart = [0.0]\nfeed = 600\nsegment = [{kind = "line", end = [1.0]}]\n'
    text = HEAD + SINE.replace("duration = 1.0\n", "").split("kind =")[0] + path + RMS
    with pytest.raises(InputError, match=r"assignment\.toml.*no path for its reference: give `program`"):
        read_assignment(assignment_in(tmp_path, text))


def test_the_line_is_that_of_the_right_table_of_several(tmp_path: Path) -> None:
    second = SINE.replace('"sine"', '"other"').replace("amplitude = 2.0", "amplitude = true")
    text = HEAD + SINE + second + RMS
    with pytest.raises(InputError, match=f"assignment.toml, line {line_of(text, 'amplitude = true')}: "):
        read_assignment(assignment_in(tmp_path, text))
    text = WHOLE + RMS.replace('"rms"', '"again"').replace("none = 0.5", "none = 0.0")
    with pytest.raises(InputError, match=f"line {line_of(text, 'none = 0.0')}: "):
        read_assignment(assignment_in(tmp_path, text))


SECOND = RMS.replace('"rms"', '"b"')


@pytest.mark.parametrize(
    "more, said",
    [
        (RMS, "given to two criteria"),
        (SINE, "given to two cases"),
        (SINE.replace('"sine"', '"unused"'), "used by no criterion"),
        (SECOND + 'requires = ["c"]\n', "no criterion; there are rms, b"),
        (SECOND + 'requires = ["b"]\n', "the criterion itself"),
        (SECOND + "requires = [1]\n", "must be a list of the names of criteria"),
        (SECOND + "requires = 1\n", "must be a list of the names of criteria"),
        (SECOND.replace("rms-error", "noise-error"), "needs a case with noise"),
        (SECOND.replace("rms-error", "model-fit"), "is for model assignments"),
        (SECOND.replace("rms-error", "unit-tests"), "need no case"),
        (
            SECOND.replace("rms-error", "unit-tests").replace('case = "sine"\n', ""),
            "it has no test",
        ),
        (SECOND.replace('case = "sine"', "cases = []"), "must be a list of the names of cases"),
        (SECOND + 'cases = ["sine"]\n', "give one of them"),
        (SECOND.replace("rms-error", "path-followed"), "tolerance is missing"),
        (SECOND + "from = -1.0\n", "at least 0"),
        (SECOND + "partial = 2.0\n", "from 0 to 1"),
    ],
)
def test_tables_that_do_not_go_together(more: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        read_assignment(assignment_in(tmp_path, WHOLE + more))
    assert said in str(error.value)


def test_no_assignment(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"there is no assignment.toml"):
        read_assignment(tmp_path)
    with pytest.raises(InputError, match="has no criterion"):
        read_assignment(assignment_in(tmp_path, HEAD))


def test_its_sha256_changes_with_a_file_that_it_reads(tmp_path: Path) -> None:
    text = WHOLE.replace('kind = "sinusoid"\namplitude = 2.0\nfrequency = 1.0', 'kind = "user"\nfile = "r.csv"')
    folder = assignment_in(tmp_path, text)
    (folder / "r.csv").write_text("0,0\n1,1\n")
    first = read_assignment(folder)
    (folder / "r.csv").write_text("0,0\n1,2\n")
    assert first.cases[0].files == ("r.csv",)
    assert read_assignment(folder).sha256 != first.sha256
    assert replace(first, folder=folder).seed("ada") == first.seed("ada") != first.seed("bob")


HIDDEN = (
    SINE.replace('"sine"', '"secret case"').replace("duration = 1.0", "duration = 1.234\nvisible = false")
    + RMS.replace('"rms"', '"blind"').replace('"sine"', '"secret case"').replace("points = 10", "points = 7")
    + "visible = false\n"
)


def test_a_hand_out_tells_nothing_of_what_is_hidden(tmp_path: Path) -> None:
    text = WHOLE.replace("secret =", "# the answer is 42\nsecret =") + HIDDEN
    read = read_assignment(assignment_in(tmp_path / "a", text))
    files = hand_out(read, tmp_path / "out")
    assert [path.name for path in files] == ["assignment.toml"]
    told = files[0].read_text()
    for word in ("secret case", "blind", "1.234", "not told", "solution", "42"):
        assert word not in told
    again = read_assignment(tmp_path / "out")
    assert again.hidden.criteria == 1 and again.hidden.points == 7.0
    assert again.max_score == 10.0
    with pytest.raises(InputError, match="is there already"):
        hand_out(read, tmp_path / "out")


def test_a_hand_out_of_hidden_criteria_only_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    read = read_assignment(assignment_in(tmp_path / "a", HEAD + HIDDEN))
    with pytest.raises(InputError, match="no criterion can be shown"):
        hand_out(read, tmp_path / "out")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a"]


def test_a_hand_out_promises_no_points_that_a_hidden_gate_takes(tmp_path: Path) -> None:
    read = read_assignment(assignment_in(tmp_path / "a", WHOLE + 'requires = ["blind"]\n' + HIDDEN))
    with pytest.raises(InputError, match="rms: it is visible, but requires blind, which students cannot see"):
        hand_out(read, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_points_of_a_hidden_criterion_tell_its_value_in_steps_only(tmp_path: Path) -> None:
    text = WHOLE + HIDDEN
    shown, hidden = read_assignment(assignment_in(tmp_path / "a", text)).criteria
    values = [shown.bands.none + k / 1000 * (shown.bands.full - shown.bands.none) for k in range(1001)]
    assert len({shown.score(value, "").score for value in values}) == 1001
    points = [hidden.score(value, "").score for value in values]
    assert len(set(points)) == 21 and points == sorted(points)
    assert points[0] == 0.0 < points[1] and points[-2] < points[-1] == hidden.max_score
