"""What learning platforms read of our files: by the rules of their own importers, as far as these are published.

Moodle's readers and Canvas's rules for headings are those of their source (docs/grading.md says which), told here as
facts; Brightspace's and Blackboard's those of their manuals and sample files.
"""

from __future__ import annotations

import csv
import io
import re
import zipfile
from pathlib import Path

import pytest

from rds.core.errors import InputError
from rds.grading.exports.exported import ExportOptions
from rds.grading.grade import Status
from tests.grading.grades import grade
from tests.grading.test_exports import CANVAS, exported, rows_of


def _canvas_columns(head: list[str]) -> int:
    """How many columns Canvas takes to be about the student; ValueError where it says "Invalid header row".

    It goes by place: Student, ID, then SIS Login ID alone or SIS User ID and SIS Login ID, behind these Integration ID
    and Root Account if they are there, and Section last. All behind them are assignments.
    """
    if len(head) <= 3 or "Student" not in head[0] or "ID" not in head[1]:
        raise ValueError(head)
    count = 3
    if "SIS Login ID" in head[2]:
        count = 4
    elif "SIS User ID" in head[2] and "SIS Login ID" in head[3]:
        count = 5
        for name in ("Integration ID", "Root Account"):
            count += name in head[count - 1]
    if "Section" not in head[count - 1]:
        raise ValueError(head)
    return count


@pytest.mark.parametrize(
    "people",
    [
        "Student,ID,Section",
        "Student,ID,SIS Login ID,Section",
        "Student,ID,SIS User ID,SIS Login ID,Section",
        "Student,ID,SIS User ID,SIS Login ID,Integration ID,Section",
        "Student,ID,SIS User ID,SIS Login ID,Integration ID,Root Account,Section",
        "Student,ID,SIS User ID,SIS Login ID,Root Account,Section",
    ],
)
def test_canvas_knows_its_headings_again(people: str, tmp_path: Path) -> None:
    count = people.count(",")
    lines = [f"{people},Tracking (77),Current Score", f"    Points Possible{',' * count},30.0,(read only)"]
    lines += [f'"Lovelace, Ada",101{"," * (count - 1)},,9', f'"Hopper, Grace",102{"," * (count - 1)},,8']
    (tmp_path / "book.csv").write_text("\n".join(lines))
    grades = [grade("Lovelace, Ada"), grade("Hopper, Grace", Status.EXCUSED)]
    done = exported(tmp_path, "canvas", grades, ExportOptions(gradebook=tmp_path / "book.csv"))
    head, points, ada, grace = csv.reader(io.StringIO(Path(done.files[0]).read_text(), newline=""))
    assert head[_canvas_columns(head) :] == ["Tracking (77)"]  # and nothing that it takes for another assignment
    assert re.fullmatch(r".+ \((\d+)\)", head[-1])  # it knows the assignment by this number
    assert "Points Possible" in points[0] and points[-1] == "30.0"
    assert (ada[1], ada[-1]) == ("101", "26") and (grace[1], grace[-1]) == ("102", "EX")


def test_canvas_would_leave_out_what_is_called_as_its_own_columns(tmp_path: Path) -> None:
    (tmp_path / "book.csv").write_text(CANVAS.replace("Tracking (77)", "Final Score Project (77)"))
    with pytest.raises(InputError, match="leaves out every column with 'Final Score'"):
        wanted = ExportOptions(gradebook=tmp_path / "book.csv", column="Final Score Project")
        exported(tmp_path, "canvas", [grade("s-ada")], wanted)


def test_canvas_is_not_taken_to_have_semicolons(tmp_path: Path) -> None:
    """It looks at the first three lines: more cells by semicolons than by commas, in each as many, and it is wrong."""
    (tmp_path / "book.csv").write_text(CANVAS.replace("Tracking (77)", "Track; a; b; c; d; e; f (77)"))
    wanted = ExportOptions(gradebook=tmp_path / "book.csv", column="Track; a; b; c; d; e; f (77)")
    done = exported(tmp_path, "canvas", [grade("s-ada")], wanted)
    counts = {len(line.split(";")) for line in Path(done.files[0]).read_text().splitlines()[:3]}
    assert len(counts) > 1


def test_blackboard_between_commas_has_every_cell_in_quotation_marks(tmp_path: Path) -> None:
    heads = '"Last Name","First Name","Username","Tracking [Total Pts: 30 Score] |77"'
    (tmp_path / "down.csv").write_text(f'{heads}\n"Lovelace","Ada","ada",""\n', encoding="utf-8-sig")
    done = exported(tmp_path, "blackboard", [grade("ada")], wanted=ExportOptions(tmp_path / "down.csv"))
    made = Path(done.files[0]).read_text(encoding="utf-8-sig")
    assert made.splitlines() == [heads, '"Lovelace","Ada","ada","26"']


def test_blackboard_gets_its_own_file_back_with_one_column(tmp_path: Path) -> None:
    heads = (
        "Last Name\tFirst Name\tUsername\tStudent ID\tTracking [Total Pts: 30 Score] |77\tOther [Total Pts: 5 "
        "Score] |78"
    )
    text = f'{heads}\nLovelace\tAda\tada\t501\t""\t5\nBuilder\tBob\tbob\t502\t""\t4\n'
    (tmp_path / "down.xls").write_bytes("\ufeff".encode("utf-16-le") + text.encode("utf-16-le"))
    done = exported(tmp_path, "blackboard", [grade("ada"), grade("eve")], wanted=ExportOptions(tmp_path / "down.xls"))
    made = Path(done.files[0]).read_bytes().decode("utf-16")
    assert made.splitlines() == [
        "Last Name\tFirst Name\tUsername\tStudent ID\tTracking [Total Pts: 30 Score] |77",
        "Lovelace\tAda\tada\t501\t26",
        "Builder\tBob\tbob\t502\t",  # handed in nothing: his cell is as it was
    ]
    assert "1 of the gradebook have no grade here, and their cells stay as they are: bob" in done.notes[0]
    excused = [grade("ada"), grade("bob", Status.EXCUSED)]  # whose cell stays as it is as well, on purpose
    assert not exported(tmp_path / "x", "blackboard", excused, wanted=ExportOptions(tmp_path / "down.xls")).notes
    assert set(done.left_out) == {"eve"}
    with pytest.raises(InputError, match="give --points 5"):
        exported(
            tmp_path / "2", "blackboard", [grade("ada")], wanted=ExportOptions(tmp_path / "down.xls", column="Other")
        )
    with pytest.raises(InputError, match="Work Offline"):
        exported(tmp_path / "3", "blackboard", [grade("ada")])


def test_brightspace_gets_the_columns_of_its_sample(tmp_path: Path) -> None:
    done = exported(tmp_path / "1", "brightspace", [grade("ada")])
    assert Path(done.files[0]).read_text().splitlines() == [
        "Username,Tracking Points Grade,End-of-Line Indicator",
        "#ada,26,#",
    ]
    item = "Tracking Points Grade <Numeric MaxPoints:30 Weight:10>"
    text = f"OrgDefinedId,Username,Email,{item},End-of-Line Indicator\n#501,#ada,ada@example.edu,,#\n"
    text += "#502,#bob,bob@example.edu,7,#\n"
    (tmp_path / "down.csv").write_text(text)
    done = exported(tmp_path / "2", "brightspace", [grade("ada")], wanted=ExportOptions(tmp_path / "down.csv"))
    assert rows_of(Path(done.files[0])) == [
        {"OrgDefinedId": "#501", "Username": "#ada", item: "26", "End-of-Line Indicator": "#"},
        {"OrgDefinedId": "#502", "Username": "#bob", item: "7", "End-of-Line Indicator": "#"},
    ]
    assert "#bob" in done.notes[0]
    (tmp_path / "down.csv").write_text(text.replace("MaxPoints:30", "MaxPoints:20"))
    with pytest.raises(InputError, match="give --points 20"):
        exported(tmp_path / "3", "brightspace", [grade("ada")], wanted=ExportOptions(tmp_path / "down.csv"))
    twice = f"{item},{item.replace('Weight', 'Category:B Weight')}"  # of two categories
    (tmp_path / "down.csv").write_text(f"Username,{twice},End-of-Line Indicator\n#ada,,,#\n")
    with pytest.raises(InputError, match="several items 'Tracking'"):
        exported(tmp_path / "4", "brightspace", [grade("ada")], wanted=ExportOptions(tmp_path / "down.csv"))


def test_feedback_goes_back_to_moodle_by_the_participants_number(tmp_path: Path) -> None:
    source = {"platform": "moodle", "name": "Ada_von L/x", "id": "501"}
    ada, bob = grade("ada", details={"source": source}), grade("bob")
    pages = {"ada": "<p>yours", "bob": "<p>his"}
    done = exported(tmp_path / "1", "moodle-feedback", [ada, bob], pages=pages)
    with zipfile.ZipFile(done.files[0]) as archive:
        (name,) = archive.namelist()
        assert archive.read(name) == b"<p>yours"
    # as Moodle's importer takes it apart: name, participant, kind and name of the plug-in, file
    assert name.split("_", 4) == ["Ada von L x", "501", "assignfeedback", "file", "feedback.html"]
    assert "grading worksheet" in done.left_out["bob"]
    heads = "Identifier,Full name,Email address,Grade,Last modified (grade)"
    (tmp_path / "sheet.csv").write_text(f"{heads}\nParticipant 502,Bob,bob,,-\nParticipant 501,Ada,ada,,-\n")
    wanted = ExportOptions(tmp_path / "sheet.csv")
    done = exported(tmp_path / "2", "moodle-feedback", [ada, bob], pages=pages, wanted=wanted)
    with zipfile.ZipFile(done.files[0]) as archive:
        assert [each.split("_")[1] for each in sorted(archive.namelist())] == ["501", "502"]
