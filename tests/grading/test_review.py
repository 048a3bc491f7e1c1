"""What graders say: points, comments, excuses, extensions; two graders; an audit trail; attempts."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.grading.assignment.assignment import read_assignment
from rds.grading.assignment.late_rules import LateRules
from rds.grading.batch.finished import read_finished
from rds.grading.course.class_list import ClassList, Member, read_class_list
from rds.grading.exports.export import export
from rds.grading.exports.exported import ExportOptions
from rds.grading.feedback.feedback import feedback_page
from rds.grading.grade import Band, CriterionScore, Grade, Status
from rds.grading.review.applied import is_changed, of_review, reviewed
from rds.grading.review.best import best
from rds.grading.review.class_grades import class_grades
from rds.grading.review.entries import FILE, Entry, Kind, Review, add, read_review
from rds.grading.review.new_entries import marks_table, read_marks, say
from rds.grading.review.regrade import _kept, changes_of
from tests.grading.grades import batch_in, grade, score
from tests.grading.made import RMS, SINE, assignment_in

LATE = LateRules(percent_per_day=10.0, free_days=2)
HEAD = 'title = "Tracking"\nkind = "controller"\nsecret = "not told to anybody"\n'


def points(value: float, by: str = "ann", criterion: str = "rms", **more: object) -> Entry:
    return Entry(Kind.POINTS, by, "ada", criterion=criterion, value=value, **more)  # type: ignore[arg-type]


def made(folder: Path, *grades: Grade, words: str = "") -> Path:
    """A batch with pages, and the assignment that it was graded by."""
    read = read_assignment(assignment_in(folder / "task", HEAD + SINE + RMS))
    given = grades or (grade("ada"), grade("ben"))
    pages = {each.student: feedback_page(read, each) for each in given}
    record = {"folder": str(read.folder), "assignment": read.sha256, "late": {"percent_per_day": 10.0}}
    out = batch_in(folder / "out", given, pages=pages, **record)
    if words:
        (out / "class.csv").write_text(words)
    return out


def test_points_by_hand_replace_those_that_were_measured() -> None:
    found = reviewed(grade(), LATE, None, [points(9.0, comment="x")])
    assert found.score == 29.0 and found.criteria[0].score == 9.0 and found.criteria[0].value == 0.23
    assert found.criteria[0].sentence.endswith("from 6 as measured.")
    assert not reviewed(grade(), LATE, None, [points(0.0)]).criteria[0].score


def test_a_grader_settles_what_could_not_be_measured() -> None:
    unknown = replace(score(), band=Band.REVIEW, value=None)
    found = reviewed(grade("ada", Status.OK, unknown), LATE, None, [points(10.0)])
    assert not found.for_review and found.criteria[0].band is Band.FULL


def behind(name: str, factor: float, **more: object) -> CriterionScore:
    """A criterion of 10 points that earned 8 before the gate `rms`, which leaves `factor` of them."""
    left = 8.0 * factor
    return score(name, left, ungated=8.0, gates={"rms": factor}, gate="Error rms" if factor < 1.0 else "", **more)


def test_points_by_hand_open_and_close_what_needs_them() -> None:
    shut = grade("ada", Status.OK, score(points=0.0), behind("effort", 0.0), behind("other", 0.0, visible=False))
    found = reviewed(shut, LATE, None, [points(10.0)])
    assert [each.score for each in found.criteria] == [10.0, 8.0, 8.0] and found.score == 26.0
    effort = found.criteria[1]
    assert (effort.gate, effort.band) == ("", Band.PARTIAL)
    assert effort.sentence.endswith("Error rms was set by hand: 8 of 10 points count here, from 0 as measured.")
    found = reviewed(shut, LATE, None, [points(1.0)])  # 10 % of a gate that takes nothing from 25 % on
    assert [each.score for each in found.criteria] == [1.0, 3.2, 3.0]  # hidden ones in steps of a twentieth
    found = reviewed(shut, LATE, None, [points(10.0), points(0.0, criterion="effort")])
    assert [each.score for each in found.criteria] == [10.0, 0.0, 8.0]
    full = grade("ada", Status.OK, score(), behind("effort", 1.0))
    found = reviewed(full, LATE, None, [points(0.0)])
    assert found.score == 0.0 and found.criteria[1].gate == "Error rms" and found.criteria[1].band is Band.NONE
    assert reviewed(full, LATE, None, [points(5.0)]).criteria[1] == full.criteria[1]
    assert reviewed(found, LATE, None, [points(6.0)]).score == 14.0  # the best of attempts is reviewed once more
    given = reviewed(shut, LATE, None, [points(3.0, criterion="effort")])
    assert reviewed(given, LATE, None, [points(10.0)]).criteria[1].score == 3.0  # what a grader gave stays there
    two = replace(behind("effort", 0.0), gates={"rms": 0.0, "hidden": 0.5})
    found = reviewed(grade("ada", Status.OK, score(points=0.0), score("hidden", 1.0), two), LATE, None, [points(9.0)])
    assert (found.criteria[2].score, found.criteria[2].gate) == (4.0, "Error hidden")


def test_the_command_says_what_else_points_by_hand_change(tmp_path: Path) -> None:
    shut = grade("ada", Status.OK, score(points=0.0), behind("effort", 0.0))
    out = made(tmp_path, shut, replace(shut, student="ben"))
    told = CliRunner().invoke(
        app, ["grade", "review", str(out), "--student", "ada", "--criterion", "rms", "--points", "9", "--by", "ann"]
    )
    lines = told.output.splitlines()
    assert lines == ["entry 1: points of ada, by ann", "  Error effort needs it: 8 points, from 0 as measured"]
    old = grade("eve", Status.OK, score(points=0.0), score("effort", 0.0, gate="Error rms"))  # of an earlier version
    out = made(tmp_path / "old", old)
    told = CliRunner().invoke(
        app, ["grade", "review", str(out), "--student", "eve", "--criterion", "rms", "--points", "9", "--by", "ann"]
    )
    assert told.output.splitlines()[1] == "  Error effort needs it and keeps 0 points; set them by hand, too"


def test_two_graders_count_by_their_mean_until_a_final_word() -> None:
    two = [points(8.0), points(3.0), points(6.0, "bob")]
    found = reviewed(grade(), LATE, None, two)
    assert found.criteria[0].score == 4.5 and of_review(found)["differ"] == ["rms"]
    found = reviewed(grade(), LATE, None, [*two, points(7.0, "cy", is_final=True)])
    assert found.criteria[0].score == 7.0 and of_review(found)["differ"] == []


@pytest.mark.parametrize(
    ("extension", "left", "lost"), [(0.0, None, 1), (0.0, 0, 3), (0.0, 1, 2), (1.0, 0, 2), (1.0, 5, 0), (9.0, 0, 0)]
)
def test_extensions_and_late_days_move_what_is_lost(extension: float, left: int | None, lost: int) -> None:
    late = replace(grade(), late_days=2.5, score=23.4, details={"late_share": 0.1})
    member = Member("ada", extension_days=extension, late_days=left)
    found = reviewed(late, LATE, member, [])
    assert found.score == pytest.approx(26.0 * (1.0 - 0.1 * lost))
    excused = reviewed(late, LATE, member, [Entry(Kind.EXCUSE, "ann", "ada")])
    assert of_review(excused)["late_days_spent"] == 0
    for comment, reason in (("ill", "ill"), ("", "excused by a grader")):
        found = reviewed(grade(), LATE, None, [Entry(Kind.EXCUSE, "ann", "ada", comment=comment)])
        assert (found.status, found.reason, found.score) == (Status.EXCUSED, reason, 0.0)


def test_a_grader_extends_as_the_class_list_does_and_late_days_stay() -> None:
    late = replace(grade(), late_days=2.5, score=23.4, details={"late_share": 0.1})
    extend = Entry(Kind.EXTEND, "ann", "ada", value=1.0)
    found = reviewed(late, LATE, None, [extend, points(6.0)])  # points are no days
    assert (found.late_days, found.score, of_review(found)["late_days_spent"]) == (1.5, 26.0, 2)
    found = reviewed(late, LATE, Member("ada", extension_days=1.0), [extend])
    assert (found.late_days, of_review(found)["extension_days"]) == (0.5, 2.0)
    again = reviewed(reviewed(late, LATE, None, [extend]), LATE, None, [extend])  # of the best of attempts
    assert (again.late_days, of_review(again)["extension_days"]) == (0.5, 2.0)
    # late days of an attempt stay where it is reviewed as the best
    first = reviewed(late, LATE, Member("ada", late_days=1), [])
    found = reviewed(first, LATE, None, [points(10.0)])
    assert (found.score, of_review(found)["late_days_spent"]) == (24.0, 1)
    assert of_review(reviewed(first, LATE, Member("ada", late_days=0), []))["late_days_spent"] == 0
    assert of_review(reviewed(first, LATE, None, [Entry(Kind.EXTEND, "ann", "ada", value=2.0)]))["late_days_spent"] == 1


def test_a_grade_that_nobody_said_anything_of_is_left_alone() -> None:
    none = LateRules(percent_per_day=10.0)
    late = replace(grade(), late_days=1.0)
    assert reviewed(late, none, Member("ada"), []) is late and not is_changed(late)
    error = grade("ada", Status.GRADER_ERROR)
    assert reviewed(error, none, None, [points(9.0)]) is error
    for member in (Member("ada", extension_days=0.5), Member("ada", late_days=1)):
        assert of_review(reviewed(late, none, member, []))
    assert not is_changed(reviewed(late, none, Member("ada", late_days=1), []))
    assert is_changed(reviewed(late, none, Member("ada", extension_days=0.5), []))
    assert is_changed(reviewed(late, LATE, None, [])) and is_changed(reviewed(late, none, None, [points(6.0)]))


def test_points_behind_gates_change_only_by_the_gates() -> None:
    def after(*scores: CriterionScore, by_hand: float = 10.0) -> CriterionScore:
        given = [points(by_hand, criterion=each.name) for each in scores[:-1]]
        return reviewed(grade("ada", Status.OK, *scores), LATE, None, given).criteria[-1]

    shut = score(points=0.0)
    waits = behind("effort", 0.0, band=Band.REVIEW)
    assert after(shut, waits) == waits
    nothing = replace(behind("effort", 0.0), ungated=0.0)
    assert after(shut, nothing).sentence == nothing.sentence
    assert after(shut, replace(behind("effort", 0.0), max_score=0.0)).score == 0.0
    assert after(score(points=0.0, most=0.0), behind("effort", 0.0), by_hand=0.0).score == 0.0
    odd = replace(behind("effort", 0.0, visible=False), ungated=7.77)
    assert after(shut, odd).score == 7.77  # an open gate rounds nothing
    two = replace(behind("effort", 0.0), gates={"rms": 0.0, "speed": 0.0})
    assert "Error rms and Error speed were set by hand: 8 of 10" in after(shut, score("speed", 0.0), two).sentence


def test_an_excused_student_has_no_score_and_is_in_no_gradebook(tmp_path: Path) -> None:
    say(made(tmp_path), [Entry(Kind.EXCUSE, "ann", "ada", why="ill")])
    finished = read_finished(tmp_path / "out")
    assert [each.student for each in finished.to_hand_on] == ["ben"]
    assert [each.student for each in finished.excused] == ["ada"]
    for to in ("gradescope", "prairielearn"):
        export(tmp_path / "out", to, None, ExportOptions())
        text = (tmp_path / "out" / to / "ada/results.json").read_text()
        assert "excused" in text and "points" not in text and "score" not in json.loads(text)
    page = (tmp_path / "out/students/ada/feedback.html").read_text()
    assert "You are excused" in page and " of 30 points</p>" not in page


def test_the_trail_only_grows_and_notices_what_was_taken_out(tmp_path: Path) -> None:
    add(tmp_path, [points(1.0), points(2.0), Entry(Kind.UNDO, "ann", value=1.0)])
    review = read_review(tmp_path)
    assert [each.number for each in review.standing] == [2] and len(review.entries) == 3
    with pytest.raises(InputError, match="undone already"):
        add(tmp_path, [Entry(Kind.UNDO, "ann", value=1.0)])
    lines = (tmp_path / FILE).read_bytes().splitlines(keepends=True)
    (tmp_path / FILE).write_bytes(b"".join(lines[1:]))
    with pytest.raises(InputError, match="taken out"):
        read_review(tmp_path)


def test_a_word_about_nobody_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    out = made(tmp_path)
    for entry, said in (
        (points(11.0), "from 0 to 10"),
        (points(1.0, criterion="rsm"), "no criterion 'rsm'"),
        (replace(points(1.0), student="eve"), "no student or group"),
        (Entry(Kind.EXTEND, "ann", section="Q", value=1.0), "no section"),
    ):
        with pytest.raises(InputError, match=said):
            say(out, [entry])
    assert not (out / FILE).exists()


def test_pages_and_tables_follow_and_name_no_grader(tmp_path: Path) -> None:
    out = made(tmp_path)
    say(out, [points(10.0, by="grader-ann", comment="Well <b>argued</b>.", why="secret reason")])
    page = (out / "students/ada/feedback.html").read_text()
    assert "30 of 30 points" in page and "Well &lt;b&gt;argued" in page and "secret reason" not in page
    assert "grader-ann" not in page and "Points were set by hand" in page
    begin = page.index("What to change first")
    assert page.index("goes by the points as measured", begin) < page.index("</section>", begin)
    assert all(words in (out / "index.html").read_text() for words in ("secret reason", "grader-ann"))
    rows = list(csv.DictReader((out / "grades.csv").open(encoding="utf-8-sig")))
    assert [row["score"] for row in rows] == ["30", "26"]
    assert json.loads((out / "students/ada/grade.json").read_text())["score"] == 26.0  # as it was measured


def test_a_changed_assignment_stops_a_review(tmp_path: Path) -> None:
    out = made(tmp_path)
    with (tmp_path / "task/assignment.toml").open("a") as file:
        file.write("# mended\n")
    with pytest.raises(InputError, match="regrade"):
        say(out, [points(1.0)])
    assert not (out / FILE).exists()


def test_the_members_of_a_group_get_its_grade_and_words_of_their_own(tmp_path: Path) -> None:
    words = "student,section,group\nada,A,red\nben,B,red\n"
    out = made(tmp_path, grade("red"), words=words)
    say(out, [points(10.0), Entry(Kind.COMMENT, "ann", section="B", comment="for section B")])
    finished = read_finished(out)
    assert {each.student: each.score for each in finished.grades} == {"ada": 30.0, "ben": 26.0}
    assert "for section B" in (out / "students/ben/feedback.html").read_text()
    assert "for section B" not in (out / "students/ada/feedback.html").read_text()
    assert "<h2>Sections</h2>" in (out / "index.html").read_text()


def test_marks_come_and_go_as_a_table(tmp_path: Path) -> None:
    out = made(tmp_path)
    lines = marks_table(read_finished(out)).decode("utf-8-sig").splitlines()
    assert lines[0].startswith("student,criterion,points,comment,why") and len(lines) == 5
    lines[1] = lines[1].replace("ada,rms,,", "ada,rms,7.5,fine", 1)
    (tmp_path / "marks.csv").write_text("\n".join(lines))
    (entry,) = read_marks(tmp_path / "marks.csv", "bob")
    assert (entry.student, entry.criterion, entry.value, entry.comment) == ("ada", "rms", 7.5, "fine")


def test_marks_from_a_german_spreadsheet_and_for_a_name_like_a_formula(tmp_path: Path) -> None:
    out = made(tmp_path, grade("=1+1"))
    lines = marks_table(read_finished(out)).decode("utf-8-sig").splitlines()
    assert lines[1].startswith("'=1+1,rms,,")
    lines[1] = lines[1].replace("rms,,", "rms,7;5,fine", 1)
    (tmp_path / "marks.csv").write_text("\n".join(lines).translate(str.maketrans(",;", ";,")))
    (entry,) = read_marks(tmp_path / "marks.csv", "bob")
    assert (entry.student, entry.criterion, entry.value, entry.comment) == ("=1+1", "rms", 7.5, "fine")


def test_the_best_attempt_counts_with_what_was_said_of_it(tmp_path: Path) -> None:
    first = made(tmp_path / "1", grade("ada", score=1.0, before_penalty=1.0), grade("ben"))
    second = made(tmp_path / "2", grade("ada"))
    record = json.loads((first / "batch.json").read_text())
    for out in (first, second):  # one assignment in both
        (out / "batch.json").write_text(json.dumps(record | {"title": "Tracking"}))
    say(second, [points(10.0, comment="good")])
    finished = best([first, second], tmp_path / "best")
    assert {each.student: each.score for each in finished.grades} == {"ada": 30.0, "ben": 26.0}
    page = (tmp_path / "best/students/ada/feedback.html").read_text()
    assert "30 of 30 points" in page and "good" in page
    assert "2: 30 (counts)" in finished.grades[0].notes[-1]
    say(tmp_path / "best", [Entry(Kind.COMMENT, "bob", "ada", comment="well done")])
    page = (tmp_path / "best/students/ada/feedback.html").read_text()
    assert "well done" in page and "Points were set by hand." in page


def test_late_days_are_never_given_back_by_the_best_of_attempts(tmp_path: Path) -> None:
    run, after = CliRunner().invoke, tmp_path / "next.csv"
    first = made(tmp_path / "1", words="student,late_days\nada,3\nben,0\n")
    second = made(tmp_path / "2", words="student,late_days\nada,3\nben,0\n")
    (second / "batch.json").write_text((first / "batch.json").read_text())
    best([first, second], tmp_path / "best")
    done = run(app, ["grade", "late-days", str(tmp_path / "best"), "-o", str(after)])
    assert done.exit_code == 2 and "in the batch of each" in done.output and not after.exists()
    assert run(app, ["grade", "late-days", str(first), "-o", str(after)]).exit_code == 0
    assert [member.late_days for member in read_class_list(after).members] == [3, 0]


def test_a_grader_error_in_one_attempt_is_no_zero_beside_another(tmp_path: Path) -> None:
    def batch(number: int, **statuses: Status) -> Path:
        return made(tmp_path / str(number), *(grade(name, status) for name, status in statuses.items()))

    first = batch(1, ada=Status.MISSING, ben=Status.OK)
    second = batch(2, ada=Status.GRADER_ERROR, ben=Status.GRADER_ERROR)
    (second / "batch.json").write_text((first / "batch.json").read_text())
    ada, ben = best([first, second], tmp_path / "best").grades
    assert (ada.status, ben.status) == (Status.GRADER_ERROR, Status.OK)
    assert ben.notes[-1] == "Points of 2 attempts: 1: 26 (counts), 2: grader error."


def test_points_by_hand_for_nothing_handed_in_are_an_attempt(tmp_path: Path) -> None:
    first = made(tmp_path / "1", grade("ada", Status.MISSING, score(points=0.0)))
    second = made(tmp_path / "2", grade("ada", Status.OK, score(points=0.0)))
    (second / "batch.json").write_text((first / "batch.json").read_text())
    say(first, [points(5.0, comment="shown in the laboratory")])
    (ada,) = best([first, second], tmp_path / "best").grades
    assert ada.score == 5.0


def test_graders_name_students_as_the_class_list_does(tmp_path: Path) -> None:
    out = made(tmp_path / "1", replace(grade("Ada Lovelace_501"), details={"source": {"name": "Ada Lovelace"}}))
    (out / "class.csv").write_text("student,name\ns501,Ada Lovelace\n")
    _, finished = say(out, [replace(points(8.0), student="s501")])
    assert finished.grades[0].score == 28.0
    assert "student,class list,status" in (out / "grades.csv").read_text("utf-8-sig")
    assert "Ada Lovelace_501,s501,ok," in (out / "grades.csv").read_text("utf-8-sig")


def test_a_gate_that_takes_another_share_is_no_change_of_bands(tmp_path: Path) -> None:
    half = score(points=3.0, gate="Smooth", sentence="It is 0.23 mm (none from 1 mm on); 50 % of that count.")
    less = score(points=0.0, gate="Smooth", sentence="It is 0.23 mm (none from 1 mm on); it counts only where Smooth.")
    before, now = (read_finished(made(tmp_path / n, grade("ada", Status.OK, s))) for n, s in (("a", less), ("b", half)))
    (change,) = changes_of(before, now)
    assert change.why[0] == "rms: 0 → 3 points, because the gate Smooth takes another share"


def test_who_changes_is_told_with_the_reason(tmp_path: Path) -> None:
    before = read_finished(made(tmp_path / "1", grade("ada", Status.OK, score(), score("old", 1.0))))
    new = (replace(score(points=8.0), value=0.23), score("new", 2.0))
    now = read_finished(made(tmp_path / "2", grade("ada", Status.OK, *new)))
    (change,) = changes_of(before, now)
    assert (change.before, change.now) == (7.0, 10.0)
    assert change.why[0] == "rms: 6 → 8 points, because its bands are others (the same value, 0.23 mm)"
    assert "a new criterion" in change.why[1] or "no longer" in change.why[1]
    unknown = replace(score(points=2.0), value=None, band=Band.REVIEW)
    before = read_finished(made(tmp_path / "3", grade("ada", Status.OK, unknown)))
    (change,) = changes_of(before, read_finished(made(tmp_path / "4", grade("ada"))))
    assert change.why[0].endswith("because its value was not measured and is 0.23 mm")


def test_what_was_no_student_s_fault_is_none_when_it_is_graded_again(tmp_path: Path) -> None:
    statuses = {"ada": Status.OK, "ben": Status.GRADER_ERROR, "cy": Status.MISSING, "dan": Status.REFUSED}
    before = read_finished(made(tmp_path, *(grade(name, status) for name, status in statuses.items())))
    found = {row.student: row.status for row in _kept(before).rows}
    assert found == statuses | {"ada": Status.GRADER_ERROR}  # whose file is gone


def test_everyone_is_found_by_what_the_export_says() -> None:
    own = grade("Ada Lovelace_501", details={"source": {"name": "Ada Lovelace", "id": "501"}}, late_days=1.5)
    own = replace(own, details={**own.details, "late_share": 0.2}, score=20.8)
    found = class_grades(
        [own], ClassList((Member("ada", "Ada Lovelace", section="A", extension_days=1.0),)), Review(), LATE
    )
    (counting, measured) = found["Ada Lovelace_501"]
    assert counting.details["section"] == "A" and counting.score > measured.score


def test_a_user_without_a_name_gives_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def nobody() -> str:
        raise KeyError("getpwuid(): uid not found: 1000")

    monkeypatch.setattr("getpass.getuser", nobody)
    out = str(made(tmp_path))
    run = CliRunner().invoke
    assert run(app, ["grade", "review", out]).exit_code == 0
    said = run(app, ["grade", "review", out, "--student", "ada", "--comment", "x"])
    assert said.exit_code == 2 and "give --by NAME" in said.output


def test_the_command_says_what_waits_and_refuses_half_a_sentence(tmp_path: Path) -> None:
    unknown = replace(score(), band=Band.REVIEW, value=None)
    out = made(tmp_path, grade("ada", Status.OK, unknown))
    run = CliRunner().invoke
    assert "could not be" in run(app, ["grade", "review", str(out)]).output
    assert run(app, ["grade", "review", str(out), "--points", "3"]).exit_code == 2
    assert run(app, ["grade", "review", str(out), "--student", "ada"]).exit_code == 2
    for words, said in (
        (["--student", "ada", "--criterion", "rms", "--excuse"], "--criterion has no meaning with --excuse"),
        (["--student", "ada", "--undo", "1"], "--student has no meaning with --undo"),
        (["--marks", str(out / "grades.csv"), "--why", "late"], "--why has no meaning with --marks"),
        (["--student", "ada", "--points", "1", "--undo", "1"], "one thing at a time"),
    ):
        done = run(app, ["grade", "review", str(out), *words])
        assert done.exit_code == 2 and said in done.output
    words = ["--student", "ada", "--criterion", "rms", "--points", "3", "--by", "ann"]
    assert run(app, ["grade", "review", str(out), *words]).exit_code == 0
    assert "nothing waits" in run(app, ["grade", "review", str(out)]).output
    assert "ann" in run(app, ["grade", "review", str(out), "--log"]).output
