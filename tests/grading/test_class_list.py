"""The class list: read, matched, and submissions of groups folded into one."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from rds.core.errors import InputError
from rds.grading.assignment.late_rules import LateRules
from rds.grading.batch.run import _unlisted
from rds.grading.course.class_list import ClassList, Member, read_class_list
from rds.grading.course.groups import by_group, with_groups_of_export, without_groups_of_export
from rds.grading.grade import Status
from rds.grading.intake import HandedIn, Intake
from rds.grading.review.class_grades import class_grades
from rds.grading.review.entries import Review
from tests.grading.grades import grade

TEXT = """student,name,email,section,group,extension_days,late_days
ada,Ada Lovelace,ada@example.edu,A,red,0,3
ben,Ben Ó Sé,ben@example.edu,A,red,1.5,
cy,Cy Twombly,cy@example.edu,B,,,0
"""


def listed(folder: Path, text: str = TEXT) -> ClassList:
    (folder / "class.csv").write_text(text, encoding="utf-8")
    return read_class_list(folder / "class.csv")


def test_a_list_is_read_and_written_as_it_is(tmp_path: Path) -> None:
    found = listed(tmp_path)
    assert found.members[0] == Member("ada", "Ada Lovelace", "ada@example.edu", "A", "red", 0.0, 3)
    assert found.members[1].extension_days == 1.5 and found.members[1].late_days is None
    assert found.sections() == ("A", "B") and list(found.groups()) == ["red"]
    (tmp_path / "again.csv").write_bytes(found.to_csv())
    assert read_class_list(tmp_path / "again.csv") == found
    assert listed(tmp_path, "\ufeff" + TEXT.replace(",", ";")) == found  # as a German spreadsheet saves it


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("name\nada\n", "must have student"),
        ("student,grade\nada,1\n", "must have student"),
        ("student\nada\nada\n", "line 3"),
        ("student,late_days\nada,1.5\n", "whole number"),
        ("student,extension_days\nada,-1\n", "from 0 to 366"),
        ("student,extension_days\nada,nan\n", "from 0 to 366"),
        ("student,group\nada,ben\nben,ben\n", "a group and a student"),
        ("student,name\nada\n", "number of cells"),
        ("student\n", "no student"),
        ('student,name\nada,"Ada' + "\n" * 140_000, "class.csv: line .*quotation mark that is not closed"),
    ],
)
def test_a_list_that_will_not_do_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        listed(tmp_path, text)


def test_students_are_found_by_identifier_address_and_name(tmp_path: Path) -> None:
    found = listed(tmp_path)

    def name(student: str, **source: str) -> str:
        member = found.find(student, source)
        return "" if member is None else member.student

    assert name("Ada Lovelace_501", name="Ada Lovelace", id="501") == "ada"
    assert name("x", email="BEN@example.edu") == "ben"
    assert name("Lovelace") == "" and name("ada") == "ada"


def test_a_german_spreadsheet_s_list_has_commas_in_its_numbers(tmp_path: Path) -> None:
    found = listed(tmp_path, "student;extension_days;late_days\nada;1,5;3\n")
    assert (found.members[0].extension_days, found.members[0].late_days) == (1.5, 3)


def test_the_number_of_a_participant_in_moodle_is_no_student_s() -> None:
    known = ClassList((Member("501", "Grace Hopper"), Member("900", "Ada Lovelace")))
    about = {"name": "Ada Lovelace", "id": "501"}
    found = [known.find("Ada Lovelace_501", about | {"platform": each}) for each in ("moodle", "canvas")]
    assert [member.student for member in found if member] == ["900", "501"]


def row(student: str, hour: int | None = None, **more: object) -> HandedIn:
    time = None if hour is None else datetime(2026, 1, 10, hour, tzinfo=UTC)
    given: dict[str, object] = {"read": student.encode} | more
    return HandedIn(student, f"{student}.py", time=time, **given)  # type: ignore[arg-type]


def test_the_last_file_of_a_group_counts_and_nobody_is_forgotten(tmp_path: Path) -> None:
    found = by_group(Intake("files", (row("ada", 9), row("ben", 11), row("zoe"))), listed(tmp_path))
    rows = {each.student: each for each in found.rows}
    assert set(rows) == {"red", "cy", "zoe"}
    assert rows["red"].name == "ben.py" and "ben" in rows["red"].notes[0]
    assert rows["cy"].status is Status.MISSING
    assert set(rows["red"].source["handed_in_by"]) == {"ada", "ben"}


def test_a_group_that_is_graded_again_keeps_what_the_export_says_of_each_member(tmp_path: Path) -> None:
    ada = row("ada", 9, source={"id": "501"})
    once = by_group(Intake("files", (ada, row("ben", 11))), listed(tmp_path))
    assert by_group(once, listed(tmp_path)) == once
    nothing = by_group(Intake("files", ()), listed(tmp_path))
    assert by_group(nothing, listed(tmp_path)) == nothing


def test_nobody_guesses_which_file_of_a_group_was_the_last(tmp_path: Path) -> None:
    found = by_group(Intake("files", (row("ada"), row("ben", 11))), listed(tmp_path))
    (red,) = (each for each in found.rows if each.student == "red")
    assert red.status is Status.REFUSED and "ada, ben" in red.reason


def test_late_days_are_taken_off_for_the_next_assignment(tmp_path: Path) -> None:
    after = listed(tmp_path).with_late_days({"ada": 2, "cy": 1})
    assert [each.late_days for each in after.members] == [1, None, 0]
    assert all(each.extension_days == 0.0 for each in after.members)


def test_two_files_of_one_student_of_the_list_refuse_each_other_and_nobody_else(tmp_path: Path) -> None:
    """One student can bring this about, by another's number or name; the class is graded all the same."""
    handed_in = (row("cy"), row("somebody", source={"email": "cy@example.edu"}), row("zoe"))
    rows = {each.student: each for each in by_group(Intake("files", handed_in), listed(tmp_path)).rows}
    assert set(rows) == {"cy", "somebody", "zoe", "red"} and rows["zoe"].status is None
    assert all(rows[name].status is Status.REFUSED for name in ("cy", "somebody"))
    assert rows["cy"].reason.startswith("cy, somebody are one student of the class list, cy; keep one")


def test_of_two_with_one_name_none_gets_a_zero_for_the_file_of_the_other() -> None:
    known = ClassList(
        (Member("a1", "Ada Lovelace"), Member("a2", "Ada Lovelace"), Member("b", "Ben"), Member("c", "Cy"))
    )
    ada = row("Ada Lovelace_501", source={"platform": "moodle", "name": "Ada Lovelace", "id": "501"})
    rows = {each.student: each for each in by_group(Intake("moodle", (ada, row("b"))), known).rows}
    assert {name: each.status for name, each in rows.items() if each.status} == {
        "a1": Status.GRADER_ERROR,
        "a2": Status.GRADER_ERROR,
        "c": Status.MISSING,
    }
    assert "'Ada Lovelace_501' may be this student's or a namesake's" in rows["a1"].reason
    mended = ClassList((Member("Ada Lovelace_501", "Ada Lovelace"), *known.members[1:]))
    rows = {each.student: each for each in by_group(Intake("moodle", (ada, row("b"))), mended).rows}
    assert rows["Ada Lovelace_501"].status is None and rows["a2"].status is Status.MISSING
    team = ClassList((*(replace(each, group="red") for each in known.members[:1]), *known.members[1:]))
    rows = {each.student: each for each in by_group(Intake("moodle", (ada,)), team).rows}
    assert rows["red"].status is rows["a2"].status is Status.GRADER_ERROR


def test_each_member_of_a_group_of_gradescope_gets_its_grade() -> None:
    people = [
        {"name": name, "sid": sid, "email": f"{name}@x"} for name, sid in (("Ada", "1"), ("Ben", ""), ("Cy", "9"))
    ]
    about = {**people[0], "submission": "submission_7", "members": people}
    handed_in = Intake("gradescope", (row("1", 9, source=about), row("zoe")))
    known = ClassList((Member("1"), Member("b", email="ben@x"), Member("dan"), Member("zoe")))
    intake, with_groups = with_groups_of_export(handed_in, known)
    assert {each.student: each.group for each in with_groups.members if each.group} == dict.fromkeys(
        "1b", "submission_7"
    )
    rows = {each.student: each for each in by_group(intake, with_groups).rows}
    assert {name: each.status for name, each in rows.items()} == {
        "submission_7": None,
        "dan": Status.MISSING,
        "zoe": None,
    }
    own_row = Intake("gradescope", (*handed_in.rows, row("b")))  # who handed in apart, whatever others say
    for one, other in ((own_row, known), (handed_in, ClassList((Member("1", email="mal@x"), *known.members[1:])))):
        assert not {each.student for each in with_groups_of_export(one, other)[1].members if each.group} >= {"1", "b"}
    sources = {name: each.source for name, each in rows.items()}
    assert without_groups_of_export(with_groups, sources) == known  # in the list for the next assignment
    assert _unlisted(with_groups, by_group(intake, with_groups)) == ["not in the class list: 9"]
    for later in (intake, handed_in):  # graded again, and resumed
        again = with_groups_of_export(later, with_groups)
        assert again == (intake, with_groups)
    measured = grade("submission_7", details={"source": rows["submission_7"].source})
    found = class_grades([measured], with_groups, Review(), LateRules())
    assert {name: (each.score, each.details["source"].get("sid")) for name, (each, _) in found.items()} == {
        "1": (26.0, "1"),
        "b": (26.0, None),
    }


@pytest.mark.parametrize("team", ["", "red", "SS26-A"])
def test_moodle_s_copies_of_a_group_s_file_are_its_members(team: str) -> None:
    def copy(name: str, number: str, text: bytes = b"same", hour: int | None = 9) -> HandedIn:
        about = {"platform": "moodle", "name": f"SS26-A-{name}", "id": number}
        return row(f"SS26-A-{name}_{number}", hour, source=about, read=lambda: text)

    known = ClassList((Member("a", "Ada Lovelace", group=team), Member("b", "Ben Bär-Maß", group=team)))
    for hour in (9, None):
        copies = copy("Ada Lovelace", "501", hour=hour), copy("Ben Bär-Maß", "502", hour=hour)
        rows = by_group(Intake("moodle", copies), known).rows
        assert [each.status for each in rows] == [None] * (1 if team else 2) and not any(each.notes for each in rows)
    others = copy("Ada Lovelace", "501"), copy("Ben Bär-Maß", "502", b"other")
    assert by_group(Intake("moodle", others), known).rows[0].status is (Status.REFUSED if team else None)
