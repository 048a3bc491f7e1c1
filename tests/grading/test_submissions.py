"""What was handed in is found in every layout, and nothing hostile in it becomes more than a row with its reason."""

from __future__ import annotations

import io
import os
import socket
import tempfile
import zipfile
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.grading.course.class_list import ClassList, Member
from rds.grading.grade import Status
from rds.grading.intake import HandedIn, Intake, collect
from rds.grading.intake.archives import MOST_OWN
from rds.grading.intake.items import Refusal
from rds.grading.intake.names import safe_id, shown
from rds.grading.sandbox.submission import LARGEST
from tests.grading.batches import law, put, zipped

ACCEPTED = ("controller.py", "controller.ipynb")
CET = timezone(timedelta(hours=1))


def rows(intake: Intake) -> dict[str, HandedIn]:
    return {row.student: row for row in intake.rows}


def of(place: Path, **more: object) -> dict[str, HandedIn]:
    return rows(collect(place, ACCEPTED, **more))  # type: ignore[arg-type]


def test_flat_files_and_folders_of_students(tmp_path: Path) -> None:
    put(tmp_path, {"ada.py": "a", "ben/controller.py": "b", "cy/my law.py": "c", "dan/notes.txt": "", "readme.md": ""})
    (tmp_path / "eve").mkdir()
    intake = collect(tmp_path, ACCEPTED)
    found = rows(intake)
    assert list(found) == ["ada", "ben", "cy", "dan", "eve"]
    assert [found[name].read() for name in ("ada", "ben", "cy")] == [b"a", b"b", b"c"]
    assert found["dan"].status is found["eve"].status is Status.MISSING
    assert "notes.txt" in found["dan"].reason and found["dan"].notes == ()
    assert intake.ignored == ("readme.md",)


def test_a_student_whose_folder_in_a_zip_holds_clutter_alone_is_missing(tmp_path: Path) -> None:
    names = ("ada/controller.py", "ben/.DS_Store", "cy/__pycache__/controller.pyc", "__MACOSX/dan/._x", ".git/config")
    packed = zipped(tmp_path / "all.zip", dict.fromkeys(names, ""))
    assert {row.student: row.status for row in collect(packed, ACCEPTED).rows} == {
        "ada": None,
        "ben": Status.MISSING,
        "cy": Status.MISSING,
    }


def test_a_late_file_that_ilias_calls_otherwise_is_told_beside_the_one_that_is_graded(tmp_path: Path) -> None:
    names = ("controller.py", "Late Submission - controller (2).py", "helpers.py")
    put(tmp_path, {f"ada/{name}": name for name in names})
    ada = of(tmp_path)["ada"]
    assert ada.read() == b"controller.py"
    assert ada.notes == ("controller.py is graded, and not Late Submission - controller (2).py",)


def test_nbgrader_s_tree_with_its_time(tmp_path: Path) -> None:
    tree = {
        "submitted/ada/ps1/controller.py": "a",
        "submitted/ada/ps1/timestamp.txt": "2026-01-09 10:00:00.123456 UTC",
        "submitted/ada/ps2/controller.py": "other",
        "submitted/ben/ps2/controller.py": "other",
        "submitted/cy/ps1/controller.py": "c",
        "submitted/cy/ps1/timestamp.txt": "2026-01-09 10:00:00 America/Los_Angeles",
        "submitted/dan/ps1/controller.py": "d",
        "submitted/dan/ps1/timestamp.txt": "../../etc/passwd x y",
    }
    found = of(put(tmp_path, tree), assignments=("Tracking", "ps1"))
    assert list(found) == ["ada", "ben", "cy", "dan"]
    assert found["ada"].read() == b"a"
    assert found["ada"].time == datetime(2026, 1, 9, 10, 0, 0, 123456, UTC)
    assert found["ben"].status is Status.MISSING
    assert found["cy"].time == datetime(2026, 1, 9, 18, 0, tzinfo=UTC)
    assert found["dan"].time is None and "cannot be understood" in found["dan"].notes[0]
    assert of(tmp_path / "submitted", assignments=("ps1",)).keys() == found.keys()


@pytest.mark.parametrize(
    "stamp, hour",
    [
        ("2026-01-09 10:00:00.948203 PST", 18),  # what nbgrader writes in a course of this zone
        ("2026-07-09 10:00:00.948203 CEST", 8),
        ("2026-01-09 10:00:00.948203 CET", 9),
        ("2026-01-09 10:00:00.948203 +0530", 4),
        ("2026-01-09 10:00:00 -03", 13),
        ("2026-01-09T10:00:00Z", 10),
        ("2026-01-09T10:00:00.123456+01:00\n", 9),
        ("2026-01-09T10:00:00.123456", 10),
        ("2026-01-09 10:00:00", 10),
        ("2026-01-09 10:00:00 CST", None),  # America's or China's
        ("2026-01-09 10:00:00 Mars/Phobos", None),
        ("0001-01-01 00:00:00 +1400", None),  # before the first year of UTC, in which gradebooks have it
        ("9999-12-31 23:59:59 -1400", None),
        ("yesterday", None),
        ("", None),
    ],
)
def test_the_time_that_nbgrader_wrote_is_read_in_its_zone(stamp: str, hour: int | None, tmp_path: Path) -> None:
    tree = {"ada/ps1/controller.py": "a", "ada/ps1/timestamp.txt": stamp, "ben/ps1/controller.py": "b"}
    ada = of(put(tmp_path, tree), assignments=("ps1",))["ada"]
    if hour is None:
        assert ada.time is None and "cannot be understood" in ada.notes[0] and "timestamp.txt" in ada.notes[0]
    else:
        assert ada.time is not None and ada.time.astimezone(UTC).hour == hour


def test_of_several_assignments_one_must_be_named(tmp_path: Path) -> None:
    tree = {f"ada/{name}/{file}": "" for name in ("ps1", "ps2") for file in ("controller.py", "timestamp.txt")}
    with pytest.raises(InputError, match="several assignments \\(ps1, ps2\\)"):
        collect(put(tmp_path, tree), ACCEPTED, ("Tracking",))


@pytest.mark.parametrize("inside", ["ps1/controller.py", "x/timestamp.txt", "ps1/timestamp.txt"])
def test_what_one_student_s_folder_holds_changes_nobody_else_s_place(tmp_path: Path, inside: str) -> None:
    tree = {f"{name}/controller.py": name for name in ("ada", "ben", "mal")} | {f"mal/{inside}": "", "mal/y/a.txt": ""}
    found = of(put(tmp_path, tree), assignments=("Tracking", "ps1"))
    assert [found[name].status for name in ("ada", "ben")] == [None, None]
    assert [found[name].read() for name in ("ada", "ben")] == [b"ada", b"ben"]


def test_one_student_s_folders_are_not_the_course_s_assignments(tmp_path: Path) -> None:
    tree = {f"{name}/ps1/{file}": name for name in ("ada", "ben", "mal") for file in ("controller.py", "timestamp.txt")}
    found = of(put(tmp_path, tree | {"mal/ps9/timestamp.txt": "", "mal/x/a.py": ""}), assignments=("Tracking",))
    assert [found[name].read() for name in ("ada", "ben", "mal")] == [b"ada", b"ben", b"mal"]


def test_students_of_another_assignment_have_not_handed_in_this_one(tmp_path: Path) -> None:
    tree = {f"{name}/ps2/controller.py": "" for name in ("ben", "cy", "dan")} | {"ada/ps1/controller.py": "a"}
    found = of(put(tmp_path, tree), assignments=("ps1",))
    assert [found[name].status for name in ("ada", "ben", "cy", "dan")] == [None, *[Status.MISSING] * 3]


def test_a_file_s_date_is_of_no_concern() -> None:
    """Some file systems keep dates that are further than any calendar: others cut them off."""
    with tempfile.TemporaryDirectory(dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as folder:
        place = put(Path(folder), {"ada/controller.py": "a", "ben/controller.py": "b"})
        os.utime(place / "ada/controller.py", (1e13, 1e13))
        found = of(place)
        assert [found[name].read() for name in ("ada", "ben")] == [b"a", b"b"]


def test_moodle_s_zip(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {
        "Ada Lovelace_123_assignsubmission_file_/controller.py": "a",
        "Ben Ö_124_assignsubmission_file/law.py": "b",
        "Cy_125_assignsubmission_file_law.py": "c",
        "Dan_126_assignsubmission_onlinetext_/onlinetext.html": "<p>",
    }
    found = of(zipped(tmp_path / "all.zip", files), zone=CET)
    assert list(found) == ["Ada Lovelace_123", "Ben Ö_124", "Cy_125", "Dan_126"]
    assert [found[name].read() for name in list(found)[:3]] == [b"a", b"b", b"c"]
    assert found["Ada Lovelace_123"].source == {"platform": "moodle", "name": "Ada Lovelace", "id": "123"}
    assert found["Ada Lovelace_123"].time == datetime(2026, 1, 12, 11, tzinfo=CET)
    assert found["Dan_126"].status is Status.MISSING


def test_nobody_is_another_participant_of_moodle_by_a_name(tmp_path: Path) -> None:
    """Students choose their names there, and those of their files; Moodle puts the number behind the name."""
    files: dict[str, str | bytes] = {
        "Eve_124_assignsubmission_file_x_123_assignsubmission_file_/controller.py": "eve",
        "Mal_124_assignsubmission_file_x_125_assignsubmission_file_law.py": "mal",
        "Cy_126_assignsubmission_file_Cy_126_assignsubmission_file_law.py": "what cy had downloaded",
    }
    found = of(zipped(tmp_path / "all.zip", files))
    eve, cy = "Eve_124_assignsubmission_file_x_123", "Cy_126"
    (mal,) = found.keys() - {eve, cy}
    assert [found[name].source.get("id") for name in (eve, mal, cy)] == ["123", None, "126"]
    assert [found[name].read() for name in (eve, mal)] == [b"eve", b"mal"]
    assert "several numbers of participants (124, 125)" in found[mal].notes[0]


def test_canvas_s_zip(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {
        "lovelaceada_111_9001_controller.py": "first",
        "lovelaceada_111_9002_controller-1.py": "second",
        "benson_LATE_112_9003_controller.py": "late",
        "c_113_9004_a_5_6_b.py": "underscores",
        "odd.py": "no canvas name",
    }
    found = of(zipped(tmp_path / "all.zip", files))
    assert list(found) == ["benson_112", "c_113", "lovelaceada_111", "odd"]
    assert found["lovelaceada_111"].read() == b"second"
    assert "Canvas marks it as late" in found["benson_112"].notes[0] and found["benson_112"].time is None
    assert found["c_113"].read() == b"underscores"


@pytest.mark.parametrize(
    ("form", "students"),
    [
        ("{0}_11{1}_900{1}_{2}", ["ada_110", "bob_111", "eve_112"]),
        ("Task 1_{0}_attempt_2026-01-09-10-00-00_{2}", ["ada", "bob", "eve"]),
        ("11{1}-678 - {0} - Jan 5, 2026 1012 AM - {2}", ["ada_110", "bob_111", "eve_112"]),
    ],
    ids=["canvas", "blackboard", "brightspace"],
)
def test_who_names_files_as_moodle_does_decides_for_nobody_else(form: str, students: list[str], tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {form.format(*who, "controller.py"): "own" for who in [("ada", 0), ("bob", 1)]}
    files |= {form.format("eve", 2, f"x_1_assignsubmission_file_{n}.py"): "own" for n in range(9)}
    assert list(of(zipped(tmp_path / "all.zip", files))) == students
    alone = {form.format("eve", 2, "x_1_assignsubmission_file_law.py"): "own"}
    assert list(of(zipped(tmp_path / "one.zip", alone))) == students[2:]  # a class of one


def test_blackboard_s_zip_has_the_newest_attempt_of_each_student(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {
        "Task 1_ada_attempt_2026-01-09-10-00-00.txt": "Name: Ada (ada)",
        "Task 1_ada_attempt_2026-01-09-10-00-00_controller.py": "first",
        "Task 1_ada_attempt_2026-01-10-10-00-00_controller.py": "second",
        "Task 1_ben_attempt_2026-01-09-11-00-00_x_ada_attempt_2027-01-01-00-00-00_controller.py": "ben's own",
        "Task 1_cy_attempt_2026-01-09-12-00-00.txt": "text only",
    }
    found = of(zipped(tmp_path / "all.zip", files))
    assert list(found) == ["ada", "ben", "cy"]
    assert found["ada"].read() == b"second" and found["ada"].time == datetime(2026, 1, 10, 10, tzinfo=UTC)
    assert "the newest is graded (2026-01-10-10-00-00), and not 2026-01-09-10-00-00" in found["ada"].notes[0]
    assert found["ben"].read() == b"ben's own"
    assert found["cy"].status is Status.MISSING


def test_the_newest_attempt_counts_whatever_its_file_is_called(tmp_path: Path) -> None:
    inner = zipped(tmp_path / "inner.zip", {"controller.py": "second"}).read_bytes()
    files: dict[str, str | bytes] = {
        "Task 1_ada_attempt_2026-01-09-10-00-00_controller.py": "first",
        "Task 1_ada_attempt_2026-01-10-10-00-00_law.py": "second",
        "Task 1_ben_attempt_2026-01-09-10-00-00_controller.py": "first",
        "Task 1_ben_attempt_2026-01-10-10-00-00_all.zip": inner,
        "Task 1_cy_attempt_2026-01-09-10-00-00_controller.py": "second",
        "Task 1_cy_attempt_2026-01-10-10-00-00_report.pdf": "",
    }
    found = of(zipped(tmp_path / "all.zip", files))
    assert [found[name].read() for name in ("ada", "ben", "cy")] == [b"second"] * 3
    assert found["cy"].notes == (
        "there is no .py, .ipynb or .zip in the attempt 2026-01-10-10-00-00, and so it does not count",
    )


@pytest.mark.parametrize("form", ["{}/{}", "{} - {}"])
def test_brightspace_s_download_has_the_newest_attempt_of_each_student(form: str, tmp_path: Path) -> None:
    handed_in = {
        ("111-67890 - Ada Lovelace - Jan 9, 2026 1012 AM", "controller.py"): "first",
        ("111-67890 - Ada Lovelace - Jan 10, 2026 112 PM", "law.py"): "second",
        ("112-67890 - Ben - 9 January, 2026 942 PM", "controller.py"): "day first",
        ("113-67890 - Ben - Jan 9, 2026 1012", "controller.py"): "another Ben",
        ("114-67890 - Cy - 9 janv. 2026 1012", "controller.py"): "one",
        ("114-67890 - Cy - 9 févr. 2026 1012", "controller.py"): "two",
    }
    files: dict[str, str | bytes] = {form.format(*where): text for where, text in handed_in.items()}
    intake = collect(zipped(tmp_path / "all.zip", files | {"index.html": "<p>"}), ACCEPTED, zone=CET)
    found = rows(intake)
    assert list(found) == ["Ada Lovelace_111", "Ben_112", "Ben_113", "Cy_114"] and intake.ignored == ("index.html",)
    ada = found["Ada Lovelace_111"]
    assert ada.read() == b"second" and ada.time == datetime(2026, 1, 10, 13, 12, tzinfo=CET)
    assert "(Jan 10, 2026 112 PM), and not Jan 9, 2026 1012 AM" in ada.notes[0]
    assert found["Ben_112"].time == datetime(2026, 1, 9, 21, 42, tzinfo=CET)
    assert "another number (112) has the same name" in found["Ben_113"].notes[0]
    assert found["Cy_114"].status is Status.REFUSED and "2 attempts" in found["Cy_114"].reason
    assert "cannot be understood ('9 févr. 2026 1012')" in found["Cy_114"].notes[0]


def test_nobody_hands_in_earlier_by_a_name_in_brightspace(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {"111-67890 - Eve - Jan 1, 2020 100 AM - Jan 5, 2026 1012 AM/controller.py": ""}
    found = rows(collect(zipped(tmp_path / "all.zip", files), ACCEPTED, zone=CET))
    assert found["Eve - Jan 1, 2020 100 AM_111"].time == datetime(2026, 1, 5, 10, 12, tzinfo=CET)


def test_vpl_s_download_has_the_newest_attempt_of_each_student(tmp_path: Path) -> None:
    ada = {
        "Lovelace Ada 101 ada/2026-01-05-10-12-33/controller.py": "first",
        "Lovelace Ada 101 ada/2026-01-06-10-12-33/law.py": "second",
        "Lovelace Ada 101 ada/2026-01-06-10-12-33.ceg/compilation.txt": "what VPL said",
        "Report.txt": "Number of users: 1",
    }
    ben = {f"Ö Ben 7 x 102 ben/2026-01-05-10-12-34/{n}/2020-01-01-00-00-00/more.py": "" for n in range(9)}
    ben["Ö Ben 7 x 102 ben/2026-01-05-10-12-34/controller.py"] = "ben"
    group = {"red Group 12 /2026-01-05-10-12-35/controller.py": "group"}
    for files in ({**ada}, {**ada, **ben, **group, "Cy 103 cy/2026-01-05-10-12-33/report.pdf": ""}):
        put(tmp_path / f"{len(files)}", files)
        packed = zipped(tmp_path / "all.zip", {name: text.encode() for name, text in files.items()})
        for place in (packed, tmp_path / f"{len(files)}"):
            intake = collect(place, ACCEPTED, zone=CET)
            found = rows(intake)
            assert intake.layout == "vpl" and found["ada"].read() == b"second"
            assert found["ada"].time == datetime(2026, 1, 6, 10, 12, 33, tzinfo=CET)
            assert found["ada"].source == {"platform": "vpl", "name": "Lovelace Ada", "user": "101"}
            assert "the newest is graded (2026-01-06-10-12-33)" in found["ada"].notes[0]
    assert list(found) == ["ada", "ben", "cy", "red Group_12"]
    assert found["ben"].read() == b"ben" and found["cy"].status is Status.MISSING


@pytest.mark.parametrize(
    "around",
    ["eve/Task/Version 1", "Student Work/Submitted files/eve/Task/Version 1", "submitted/eve/ps1", "Eve 5 eve/{time}"],
)
def test_the_only_one_to_hand_in_hands_in_for_nobody_else(around: str, tmp_path: Path) -> None:
    folder = around.format(time="2026-01-05-10-12-33")
    files = {f"{folder}/{who}/controller.py": who.encode() for who in ("ada", "ben")}
    files |= {f"{folder}/timestamp.txt": b"2026-01-05 10:12:33 UTC"} if folder.endswith("ps1") else {}
    assert list(of(zipped(tmp_path / "all.zip", files))) == ["eve"]


def test_who_names_folders_by_times_decides_for_nobody_else(tmp_path: Path) -> None:
    files = {f"eve/2020-01-01-00-00-00/{n}.py": "eve" for n in range(9)}
    files |= {"Ada 7 x/controller.py": "ada", "Ben 8 y/controller.py": "ben"}
    found = of(zipped(tmp_path / "all.zip", {name: text.encode() for name, text in files.items()}))
    assert list(found) == ["Ada 7 x", "Ben 8 y", "eve"] and found["eve"].time is None


@pytest.mark.parametrize("around", ["", "Submitted files/", "Student Work/Submitted files/"])
@pytest.mark.parametrize("others", [{"Ben/Task/Version 1/controller.py": "only"}, {}])
def test_the_last_version_of_teams_counts(around: str, others: dict[str, str], tmp_path: Path) -> None:
    versions = {"Version 2/controller.py": "second", "Version 10/law.py": "tenth", "Version 11/report.pdf": ""}
    files = {f"Ada/Task/{name}": text for name, text in versions.items()} | others
    put(tmp_path / "in", {around + name: text for name, text in files.items()})
    packed = zipped(tmp_path / "all.zip", {around + name: text.encode() for name, text in files.items()})
    for place in (tmp_path / "in", packed):
        found = of(place)
        assert list(found) == ["Ada", "Ben"][: 1 + len(others)]
        assert found["Ada"].read() == b"tenth" and any("and not Version 2" in note for note in found["Ada"].notes)


@pytest.mark.parametrize("around", ["", "Student Work/"])
def test_drafts_in_teams_are_nobody_s(around: str, tmp_path: Path) -> None:
    files = {f"Submitted files/{who}/Task/Version 1/controller.py": who for who in ("Ada", "Ben")}
    files |= {f"Working files/{who}/Task/controller.py": "draft" for who in ("Ada", "Cy")}
    packed = zipped(tmp_path / "all.zip", {around + name: text.encode() for name, text in files.items()})
    found = collect(packed, ACCEPTED)
    assert {row.student: row.read().decode() for row in found.rows} == {"Ada": "Ada", "Ben": "Ben"}
    assert found.ignored == ("Working files",)


@pytest.mark.parametrize("title", ["Task", "Task_1"])
def test_blackboard_s_users_may_have_a_mark_in_their_names_that_titles_have_too(title: str, tmp_path: Path) -> None:
    users = ("a_l", "b_l", "bob_b", "b", "cy")
    files = {f"{title}_{user}_attempt_2026-01-09-10-00-00_controller.py": user for user in users}
    assert {name: row.read().decode() for name, row in of(put(tmp_path, files)).items()} == {u: u for u in users}


def test_blackboard_s_users_with_one_ending_are_kept_apart(tmp_path: Path) -> None:
    names = ("Task_a_l", "Work_b_l", "cy_cy")  # no title that all have
    files = {f"{name}_attempt_2026-01-09-10-00-00_controller.py": name for name in names}
    found = of(put(tmp_path, files))
    assert {name: row.read().decode() for name, row in found.items()} == {
        "Task_a_l": "Task_a_l",
        "Work_b_l": "Work_b_l",
        "cy": "cy_cy",
    }


ILIAS = {"Lovelace_Ada_x_1234": "ada", "von_der_Heide_Ben_bheide_1235": "ben"}


@pytest.mark.parametrize("folders", [ILIAS, dict([*ILIAS.items()][:1])])
@pytest.mark.parametrize("around", ["Sheet 1/Abgaben/", "Submissions/", ""])
@pytest.mark.parametrize("is_zipped", [True, False])
def test_ilias_s_folders_are_known_by_login_and_name(
    folders: dict[str, str], around: str, is_zipped: bool, tmp_path: Path
) -> None:
    files = {f"{around}{folder}/{name}": text for folder, text in folders.items() for name in ("controller.py", "h.py")}
    place = zipped(tmp_path / "all.zip", dict(files)) if is_zipped else put(tmp_path / "in", files)
    if is_zipped and not around and len(folders) == 1:
        place = put(tmp_path / "in", files)  # one folder in a zip may be the class's
    intake = collect(place, ACCEPTED)
    assert {row.student: row.read().decode() for row in intake.rows} == folders
    listed = ClassList((Member("a1", name="Ada Lovelace"), Member("bheide"), Member("cy")))
    found = [listed.find(row.student, row.source) for row in intake.rows]
    assert [each.student for each in found if each] == ["a1", "bheide"][: len(folders)]


def test_ilias_s_teams_are_found_in_their_folders(tmp_path: Path) -> None:
    files = {f"Sheet/Abgaben/Team {n}/A_B_ab_{n}/controller.py": str(n) for n in (1, 2)}
    for count in (1, 2):
        some = dict([*files.items()][:count])
        place = put(tmp_path / str(count), some)
        assert {name: row.read() for name, row in of(place).items()} == {
            f"Team {n + 1}": b"%d" % (n + 1) for n in range(count)
        }


@pytest.mark.parametrize("inside", [True, False])
def test_repositories_of_github_classroom_are_their_students(inside: bool, tmp_path: Path) -> None:
    files = {
        "ps1-ada/controller.py": "ada",
        "ps1-ada/tests/test_x.py": "",
        "ps1-ada/.git/config": "",
        "ps1-ben-b/controller.py": "ben",
    }
    place = put(tmp_path / "work/ps1-submissions", files)
    found = of(place if inside else place.parent)
    assert {name: row.read().decode() for name, row in found.items()} == {"ada": "ada", "ben-b": "ben"}
    put(place, {"someone/controller.py": "c"})
    assert list(of(place)) == ["ps1-ada", "ps1-ben-b", "someone"]


GRADESCOPE = """---
submission_1:
  :submitters:
  - :name: Ada Lovelace
    :sid: '0042'
    :email: ada@example.edu
  :created_at: 2026-01-09 10:00:00.5 Z
submission_2:
  :submitters:
  - :name: Ada Lovelace
    :sid: '0042'
    :email: ada@example.edu
  :created_at: 2026-01-08 10:00:00 Z
submission_3:
  :submitters:
  - :name: "Ben\\nOdd"
    :sid:
    :email: ben@example.edu
  - :name: Cy
    :sid: '7'
    :email: cy@example.edu
  :created_at: 2026-01-09 12:00:00 +01:00
"""


def test_gradescope_s_zip_takes_the_newest(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {
        "assignment_5_export/submission_metadata.yml": GRADESCOPE,
        "assignment_5_export/submission_1/controller.py": "newer",
        "assignment_5_export/submission_2/controller.py": "older",
        "assignment_5_export/submission_3/controller.py": "group",
    }
    found = of(zipped(tmp_path / "all.zip", files))
    assert list(found) == ["0042", "ben@example.edu"]
    assert found["0042"].read() == b"newer"
    assert found["0042"].time == datetime(2026, 1, 9, 10, 0, 0, 500000, UTC)
    assert found["0042"].source["email"] == "ada@example.edu"
    assert [each["name"] for each in found["ben@example.edu"].source["members"]] == ["Ben\\nOdd", "Cy"]


def test_nobody_is_graded_in_another_s_place_by_a_student_id(tmp_path: Path) -> None:
    """Users of Gradescope write their student ID themselves."""
    about = GRADESCOPE.replace("ada@example.edu", "eve@example.edu", 1)
    files: dict[str, str | bytes] = {
        "export/submission_metadata.yml": about,
        "export/submission_1/controller.py": "eve",
        "export/submission_2/controller.py": "ada",
    }
    found = of(zipped(tmp_path / "all.zip", files))
    assert list(found) == ["0042 (ada@example.edu)", "0042 (eve@example.edu)"]
    assert [each.read() for each in found.values()] == [b"ada", b"eve"]
    assert found["0042 (ada@example.edu)"].notes == ("somebody else has the same student ID (0042)",)


def test_gradescope_s_results_of_another_grader_are_of_any_type(tmp_path: Path) -> None:
    """They may hold Ruby's own types, and texts that are special in YAML; a number of a student keeps its zeros."""
    results = "  :results: !ruby/hash:ActiveSupport::HashWithIndifferentAccess\n    output: =\n    log: !binary 4pyT\n"
    text = GRADESCOPE.replace("submission_2:", f"{results}submission_2:").replace("'0042'", "0042")
    files: dict[str, str | bytes] = {"submission_metadata.yml": text, "submission_2/controller.py": ""}
    found = of(zipped(tmp_path / "all.zip", files))
    assert found["0042"].time == datetime(2026, 1, 8, 10, tzinfo=UTC)


@pytest.mark.parametrize("text", ["[", "- 1", "a: 1", "!!python/object/apply:os.system [id]", "x: &a [*a]"])
def test_gradescope_metadata_that_is_none(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputError, match=r"submission_metadata\.yml"):
        collect(put(tmp_path, {"submission_metadata.yml": text, "submission_1/controller.py": ""}), ACCEPTED)


def test_gradescope_metadata_that_is_not_opened_is_told_to_who_grades(tmp_path: Path) -> None:
    put(tmp_path, {"submission_1/controller.py": ""})
    (tmp_path / "submission_metadata.yml").symlink_to(tmp_path / "elsewhere.yml")
    with pytest.raises(InputError, match=r"submission_metadata\.yml: cannot be read: it is a link"):
        collect(tmp_path, ACCEPTED)


def test_times_of_the_instructor(tmp_path: Path) -> None:
    times = "student,timestamp\nada,2026-01-10T13:00:00\nben,2026-01-10T13:00:00Z\nJos\u00e9,2026-01-10T12:00:00\n"
    files = {"ada.py": "", "ben.py": "", "Jose\u0301.py": "", "timestamps.csv": times}  # as a Mac writes an accent
    found = of(put(tmp_path, files), zone=CET)
    assert found["Jose\u0301"].time == datetime(2026, 1, 10, 12, tzinfo=CET)
    assert found["ada"].time == datetime(2026, 1, 10, 13, tzinfo=CET)
    assert found["ben"].time == datetime(2026, 1, 10, 13, tzinfo=UTC)
    put(tmp_path, {"timestamps.csv": times.replace(",", ";")})  # as a German spreadsheet saves it
    assert of(tmp_path, zone=CET)["ada"].time == datetime(2026, 1, 10, 13, tzinfo=CET)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("who,when\n", "columns student and timestamp"),
        ("student,timestamp\nzoe,2026-01-10\n", "line 2: student 'zoe' handed nothing in"),
        ("student,timestamp\nada,soon\n", "line 2: timestamp = 'soon' is no time"),
        ("student,timestamp\nada,0001-01-01T00:00:00+14:00\n", "line 2: timestamp = .* is no time"),
        ("student,timestamp\nada,2026-01-10\nada,2026-01-12\n", "line 3: student 'ada' has a line above already"),
    ],
)
def test_times_that_will_not_do(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        collect(put(tmp_path, {"ada.py": "", "timestamps.csv": text}), ACCEPTED)


def test_which_file_of_several(tmp_path: Path) -> None:
    put(tmp_path, {f"ada/{name}": name for name in ("controller.py", "controller.ipynb", "old.py")})
    put(tmp_path, {f"ben/{name}": name for name in ("one.py", "two.py")})
    put(tmp_path, {f"cy/{name}": name for name in ("law.py", "law (1).py", "deep/other.py")})
    found = of(tmp_path)
    assert found["ada"].read() == b"controller.py"
    assert "controller.py is graded, and not controller.ipynb" in found["ada"].notes
    assert found["ben"].status is Status.REFUSED and "one.py, two.py" in found["ben"].reason
    assert found["cy"].read() == b"law (1).py"


def test_the_number_of_an_accepted_name_is_its_own(tmp_path: Path) -> None:
    """The next task's file in the same folder is no newer attempt of this one."""
    files = {"ada/task-1.py": "this", "ada/task-2.py": "next", "ben/task-1-1.py": "again", "ben/task-1.py": "before"}
    found = rows(collect(put(tmp_path, files), ("task-1.py",)))
    assert [found[name].read() for name in ("ada", "ben")] == [b"this", b"again"]


def test_copies_and_older_versions_beside_a_file_do_no_harm(tmp_path: Path) -> None:
    put(
        tmp_path,
        {
            "ada/controller.py": "new",
            "ada/old/controller.py": "old",
            "ben/one.py": "same",
            "ben/one - Copy.py": "same",
            "cy/v1/controller.py": "same",
            "cy/v2/controller.py": "same",
            "dan/v1/controller.py": "x",
            "dan/v2/controller.py": "y",
        },
    )
    found = of(tmp_path)
    assert {name: found[name].read() for name in ("ada", "ben", "cy")} == {"ada": b"new", "ben": b"same", "cy": b"same"}
    assert "controller.py is graded, and not old/controller.py" in found["ada"].notes
    assert found["dan"].status is Status.REFUSED and "2 files could be meant" in found["dan"].reason


CLASSES = {
    "folders of students": {"Exercise 1/ada/controller.py": b"a", "Exercise 1/bob/sub/controller.py": b"b"},
    "one with the right name": {"Exercise 1/ada/controller.py": b"a", "Exercise 1/bob/law.py": b"b"},
    "in two folders": {"Exercise 1/Submissions/ada/x.py": b"a", "Exercise 1/Submissions/bob/x.py": b"b"},
    "files of students": {"ps1/ada.py": b"a", "ps1/bob.py": b"b", "ps1/notes.txt": b""},
    "a table beside them": {"submissions/ada/x.py": b"a", "submissions/bob/controller.py": b"b", "list.xlsx": b""},
}


@pytest.mark.parametrize("files", CLASSES.values(), ids=CLASSES)
def test_the_folder_around_all_in_a_zip_is_nobody_s(files: dict[str, bytes], tmp_path: Path) -> None:
    found = of(zipped(tmp_path / "class.zip", files))
    assert {name: row.read() for name, row in found.items()} == {"ada": b"a", "bob": b"b"}


def test_one_student_s_folder_in_a_zip_is_that_student_s(tmp_path: Path) -> None:
    files = {"ada/controller.py": b"a", "ada/src/helper.py": b"", "ada/tests/try.py": b""}
    (row,) = of(zipped(tmp_path / "ada.zip", files)).values()
    assert (row.student, row.read()) == ("ada", b"a")
    parts = {"ada/src/controller.py": b"a", "ada/tests/try.py": b""}
    (row,) = of(zipped(tmp_path / "parts.zip", parts)).values()
    assert (row.student, row.read()) == ("ada", b"a")
    moodle = {f"Ada_501_assignsubmission_file_/{name}.py": name.encode() for name in ("one", "two")}
    (row,) = of(zipped(tmp_path / "moodle.zip", moodle)).values()
    assert row.student == "Ada_501" and "2 files could be meant (one.py, two.py)" in row.reason


def test_folders_that_may_be_one_student_s_are_told(tmp_path: Path) -> None:
    for number, files in enumerate(
        ({"src/a.py": b"", "tests/b.py": b""}, {"ada/first/a.py": b"", "ada/second/b.py": b""})
    ):
        found = of(zipped(tmp_path / f"{number}.zip", files))
        assert len(found) == 2 and all("is taken for a student" in row.notes[0] for row in found.values())
    put(tmp_path / "in", {"ada/a.py": "", "ben/b.py": ""})
    assert all(not row.notes for row in of(tmp_path / "in").values())


def test_files_that_are_none(tmp_path: Path) -> None:
    secret = tmp_path / "secret.txt"
    secret.write_text("x")
    place = tmp_path / "in"
    (place / "folder.py").mkdir(parents=True)
    (place / "link.py").symlink_to(secret)
    (place / "dangling.py").symlink_to(tmp_path / "nothing")
    (place / "around").symlink_to(tmp_path)
    os.mkfifo(place / "pipe.py")
    with socket.socket(socket.AF_UNIX) as bound:
        bound.bind(str(place / "socket.py"))
    put(place, {"good.py": "x", "ada/inner/controller.py": "x"})
    (place / "ada/controller.py").symlink_to(secret)
    found = of(place)
    bad = {name: row for name, row in found.items() if name not in ("good", "ada")}
    assert {row.status for row in bad.values()} == {Status.REFUSED}
    words = {"folder": "folder", "link": "link", "dangling": "link", "around": "link", "pipe": "FIFO"}
    assert all(word in bad[name].reason for name, word in {**words, "socket": "socket"}.items())
    assert set(bad) == {*words, "socket"}
    assert found["good"].read() == b"x"
    assert found["ada"].status is Status.REFUSED or found["ada"].read() == b"x"


def test_a_file_that_turns_into_a_link_is_not_followed(tmp_path: Path) -> None:
    put(tmp_path, {"in/ada.py": "x", "secret": "y"})
    row = of(tmp_path / "in")["ada"]
    (tmp_path / "in/ada.py").unlink()
    (tmp_path / "in/ada.py").symlink_to(tmp_path / "secret")
    with pytest.raises(Refusal, match="cannot be opened"):
        row.read()


@pytest.mark.skipif(os.open not in os.supports_dir_fd, reason="folders are opened one by one on POSIX alone")
@pytest.mark.parametrize("folder", ["ada", "ada/part"])
def test_a_folder_that_turns_into_a_link_is_not_followed(folder: str, tmp_path: Path) -> None:
    """A student who owns the folder could hand in the instructor's solution, which lies elsewhere."""
    put(tmp_path, {"in/ada/part/controller.py": "x", "task/part/controller.py": "y", "task/controller.py": "y"})
    row = of(tmp_path / "in")["ada"]
    assert row.read() == b"x"
    (tmp_path / "in" / folder).rename(tmp_path / "away")
    (tmp_path / "in" / folder).symlink_to(tmp_path / "task")
    with pytest.raises(Refusal, match="cannot be opened"):
        row.read()


def test_a_file_of_a_gigabyte_is_not_read(tmp_path: Path) -> None:
    with open(tmp_path / "ada.py", "wb") as file:
        file.truncate(1 << 30)
    with pytest.raises(Refusal, match=f"more than {LARGEST} bytes"):
        of(tmp_path)["ada"].read()


def test_whose_files_are_too_many_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rds.grading.intake.folders.MOST_FILES", 9)
    put(tmp_path, {"ada/controller.py": "", **{f"mal/{n}.txt": "" for n in range(9)}})
    with pytest.raises(InputError, match="more than 9 files, 9 of them in mal; move that one away"):
        collect(tmp_path, ACCEPTED)


def test_a_file_beside_a_folder_of_the_same_name_is_told(tmp_path: Path) -> None:
    put(tmp_path, {"kim.py": "x", f"kim/{ACCEPTED[0]}": "y", "lee.py": "z"})
    found = of(tmp_path)
    assert found["kim"].read() == b"y" and "kim.py lies beside a folder of the same name" in found["kim"].notes[0]
    assert found["lee"].notes == ()


def test_names_that_would_fool_somebody(tmp_path: Path) -> None:
    names = ["a\nb", "a\\nb", "\u202eabc", "..", "Ada", "ada", "\x1b[31m", "con", "x" * 120, "  ", "\u3164", "\u2800"]
    folder = put(tmp_path, {f"{name}.py" if name != ".." else "...py": "" for name in names})
    raw = os.fsencode(folder) + b"/\xff\xfe.py"
    Path(os.fsdecode(raw)).write_text("")
    students = [row.student for row in collect(folder, ACCEPTED).rows]
    assert len(set(students)) == len(students) == len(names) + 1
    assert all(name.isprintable() and name.strip("\u3164\u2800 ") for name in students)
    safe = [safe_id(name).lower() for name in students]
    assert len(set(safe)) == len(safe)


@given(st.lists(st.text(), unique=True, max_size=20))
def test_names_of_folders_are_plain_and_never_the_same(names: list[str]) -> None:
    made = [safe_id(shown(name)) for name in names]
    assert all(set(each) <= set("abcdefghijklmnopqrstuvwxyz0123456789_-~") and len(each) < 80 for each in made)
    assert len(set(made)) == len(names)


def test_a_zip_that_leads_out_of_itself(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {
        "../evil.py": "x",
        "/etc/cron.py": "x",
        "C:/evil.py": "x",
        "a/../../b.py": "x",
        "..\\win.py": "x",
        "ada.py": "good",
    }
    found = of(zipped(tmp_path / "all.zip", files))
    assert found["ada"].read() == b"good"
    others = [row for name, row in found.items() if name != "ada"]
    assert len(others) == 5
    assert {(row.status, row.reason) for row in others} == {(Status.REFUSED, "its name leads out of the zip")}
    assert not list(tmp_path.parent.glob("evil.py"))


def test_links_in_a_zip(tmp_path: Path) -> None:
    entry = zipfile.ZipInfo("ada.py")
    entry.external_attr = 0o120777 << 16
    with zipfile.ZipFile(tmp_path / "all.zip", "w") as archive:
        archive.writestr(entry, "/etc/passwd")
    assert "link or a device" in of(tmp_path / "all.zip")["ada"].reason


def own_zip(files: dict[str, bytes]) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return data.getvalue()


def test_zips_that_students_hand_in(tmp_path: Path) -> None:
    handed_in = {
        "good": own_zip({"project/controller.py": b"x", "project/data.csv": b"1"}),
        "bomb": own_zip({"controller.py": b"0" * (64 << 20)}),
        "large": own_zip({"controller.py": os.urandom(LARGEST) + b"0"}),
        "many": own_zip({f"{n}.py": b"" for n in range(MOST_OWN + 1)}),
        "nested": own_zip({"inner.zip": own_zip({"controller.py": b"x"})}),
        "broken": b"PK\x03\x04 no zip",
        "empty": own_zip({}),
        "history": own_zip({"controller.py": b"x", **{f".git/objects/{n:03}": b"" for n in range(MOST_OWN)}}),
    }
    for place in (".venv/bin", "venv/lib/python3.12/site-packages", ".mypy_cache/3.12", ".vscode"):
        files = {f"p/{place}/{n}.py": b"" for n in range(MOST_OWN)}
        handed_in[f"tools {place.split('/')[0]}"] = own_zip({"p/controller.py": b"x", **files})
    handed_in["data"] = own_zip({"controller.py": b"x", "log.csv": b"0" * (4 << 20)})
    for name, data in handed_in.items():
        (tmp_path / f"{name}.zip").write_bytes(data)
    found = of(tmp_path)
    good = [name for name in found if name in ("good", "history", "data") or name.startswith("tools ")]
    assert len(good) == 7 and {found[name].read() for name in good} == {b"x"}
    with pytest.raises(Refusal, match="unpacks to more than"):
        found["large"].read()
    said = {"bomb": "says that it unpacks to", "many": "more than 200", "nested": "another zip", "broken": "not a zip"}
    assert all(word in found[name].reason for name, word in said.items())
    assert {found[name].status for name in said} == {Status.REFUSED}
    assert found["empty"].status is Status.MISSING


def test_a_bomb_that_lies_about_its_size_is_cut_off(tmp_path: Path) -> None:
    data = bytearray(own_zip({"controller.py": b"0" * (4 << 20)}))
    size = (4 << 20).to_bytes(4, "little")
    lie = (1000).to_bytes(4, "little")
    (tmp_path / "ada.zip").write_bytes(bytes(data).replace(size, lie))
    row = of(tmp_path)["ada"]
    with pytest.raises(Refusal):
        row.read()


def test_files_of_two_students_that_differ_by_case_only(tmp_path: Path) -> None:
    found = of(zipped(tmp_path / "all.zip", {"Ada.py": "1", "ada.py": "2"}))
    assert {name: row.read() for name, row in found.items()} == {"Ada": b"1", "ada": b"2"}


def test_two_files_of_one_name_in_a_zip(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "all.zip", "w") as archive:
        archive.writestr("ada.py", "1")
        with pytest.warns(UserWarning, match="Duplicate"):
            archive.writestr("ada.py", "2")
    assert of(tmp_path / "all.zip")["ada"].status is Status.REFUSED


@pytest.mark.parametrize("name", ["nothing", "empty", "text.txt", "broken.zip"])
def test_places_without_submissions(tmp_path: Path, name: str) -> None:
    (tmp_path / "empty").mkdir()
    put(tmp_path, {"text.txt": "", "broken.zip": "no zip"})
    with pytest.raises(InputError):
        collect(tmp_path / name, ACCEPTED)


@given(st.dictionaries(st.text(min_size=1, max_size=30), st.binary(max_size=40), min_size=1, max_size=8))
def test_no_zip_whatever_its_names_is_more_than_rows(files: dict[str, bytes]) -> None:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "all.zip"
        with zipfile.ZipFile(path, "w") as archive:
            for name, data in files.items():
                archive.writestr(zipfile.ZipInfo(name.encode("utf-8", "replace").decode()), data)
        try:
            intake = collect(path, ACCEPTED)
        except InputError:
            return
        for row in intake.rows:
            assert row.student.isprintable()
            assert row.status is not None or isinstance(row.read(), bytes)


def test_a_single_file_is_a_submission_too(tmp_path: Path) -> None:
    put(tmp_path, {"ada.py": law()})
    assert of(tmp_path / "ada.py")["ada"].read().decode() == law()
