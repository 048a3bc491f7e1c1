"""Gradebooks: the columns and fields that each platform knows, nobody forgotten, no cell that a spreadsheet runs."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.grading.batch.grades_table import csv_text, grades_csv
from rds.grading.exports import GRADEBOOKS, prairielearn
from rds.grading.exports.export import Written, export
from rds.grading.exports.exported import ExportOptions
from rds.grading.exports.one_json import LARGEST
from rds.grading.exports.roster import Key, find, identifiers, names_here, read_sheet
from rds.grading.feedback.plain_text import LONGEST as MOST
from rds.grading.feedback.plain_text import cell, uncell
from rds.grading.grade import LISTED, Grade, Status
from tests.grading.grades import HOSTILE, batch_in, grade, score

NOTHING = ExportOptions()
CANVAS = """Student,ID,SIS User ID,SIS Login ID,Section,Tracking (77),Essay (78),Current Score
,,,,,Manual Posting,,(read only)
    Points Possible,,,,,30.0,10.0,(read only)
"Lovelace, Ada",101,s-ada,ada@x.edu,M1,,9,90
"Hopper, Grace",102,s-grace,grace@x.edu,M1,12,8,80
"Twin, A",103,s-a,a@x.edu,M1,,,
"Twin, A",104,s-b,b@x.edu,M1,,,
"""
WORKSHEET_COLUMNS = (
    "Identifier,Full name,Email address,Status,Grade,Maximum Grade,Grade can be changed,"
    "Last modified (submission),Last modified (grade),Feedback comments"
)
WORKSHEET = f"""\ufeff{WORKSHEET_COLUMNS}
Participant 501,Ada Lovelace,Ada@x.edu,Submitted for grading,,30.00,Yes,-,-,
Participant 502,Grace Hopper,grace@x.edu,Submitted for grading,,30.00,Yes,-,-,
"""
GRADESCOPE = {
    "type": "object",
    "additionalProperties": False,
    "properties": {
        "score": {"type": "number"},
        "execution_time": {"type": "number"},
        "output": {"type": "string"},
        "output_format": {"enum": ["text", "html", "simple_format", "md", "ansi"]},
        "visibility": {"enum": ["hidden", "after_due_date", "after_published", "visible"]},
        "stdout_visibility": {"enum": ["hidden", "after_due_date", "after_published", "visible"]},
        "extra_data": {"type": "object"},
        "tests": {
            "type": "array",
            "items": {
                "type": "object",
                "additionalProperties": False,
                "required": ["score", "max_score", "name"],
                "properties": {
                    "score": {"type": "number"},
                    "max_score": {"type": "number"},
                    "status": {"enum": ["passed", "failed"]},
                    "name": {"type": "string"},
                    "number": {"type": "string"},
                    "output": {"type": "string"},
                    "output_format": {"enum": ["text", "html", "simple_format", "md", "ansi"]},
                    "tags": {"type": "array", "items": {"type": "string"}},
                    "visibility": {"enum": ["hidden", "after_due_date", "after_published", "visible"]},
                    "extra_data": {"type": "object"},
                },
            },
        },
        "leaderboard": {"type": "array"},
    },
}
IMAGES = {
    "type": "array",
    "items": {
        "type": "object",
        "additionalProperties": False,
        "required": ["url"],
        "properties": {"label": {"type": "string"}, "url": {"type": "string", "pattern": "^data:image/"}},
    },
}
PRAIRIELEARN = {
    "type": "object",
    "additionalProperties": False,
    "properties": {
        "score": {"type": "number", "minimum": 0.0, "maximum": 1.0},
        "gradable": {"type": "boolean"},
        "format_errors": {"type": "array", "items": {"type": "string"}},
        "message": {"type": "string"},
        "output": {"type": "string"},
        "images": IMAGES,
        "tests": {
            "type": "array",
            "items": {
                "type": "object",
                "additionalProperties": False,
                "required": ["name", "points", "max_points"],
                "properties": {
                    "name": {"type": "string"},
                    "description": {"type": "string"},
                    "points": {"type": "number"},
                    "max_points": {"type": "number"},
                    "message": {"type": "string"},
                    "output": {"type": "string"},
                    "images": IMAGES,
                },
            },
        },
    },
    "if": {"properties": {"gradable": {"const": True}}},
    "then": {"required": ["score"]},
}


def rows_of(path: Path) -> list[dict[str, str]]:
    """The lines of a CSV file by column."""
    return list(csv.DictReader(io.StringIO(path.read_text(encoding="utf-8-sig"), newline="")))


def from_platform(platform: str, student: str, /, **about: str) -> Grade:
    """A grade of a submission that came from a platform's export."""
    return replace(grade(student), details={"source": {"platform": platform, **about}})


def hold_against(schema: dict[str, Any], data: Any) -> None:
    from jsonschema import validate  # here, because it takes seconds that each worker would spend as it collects

    validate(data, schema)


def exported(tmp_path: Path, to: str, grades: list[Grade], wanted: ExportOptions = NOTHING, **record: Any) -> Written:
    return export(batch_in(tmp_path / "out", grades, **record), to, None, wanted)


def test_nbgrader_has_the_columns_of_its_own_export(tmp_path: Path) -> None:
    late = replace(grade("bob", score=23.4), late_days=0.5)
    record = {"due": "2026-11-20T23:59:00+01:00", "times": {"bob": "2026-11-21T13:00:00+01:00"}}
    done = exported(tmp_path, "nbgrader", [grade("ada"), late], **record)
    text = Path(done.files[0]).read_text()
    assert text.splitlines()[0] == (
        "assignment,duedate,timestamp,student_id,last_name,first_name,email,raw_score,late_submission_penalty,score,max_score"
    )
    ada, bob = rows_of(Path(done.files[0]))
    assert (ada["score"], ada["late_submission_penalty"], ada["timestamp"]) == ("26", "0", "")
    assert (bob["raw_score"], bob["late_submission_penalty"], bob["score"]) == ("26", "2.6", "23.4")
    assert (bob["duedate"], bob["timestamp"]) == ("2026-11-20 22:59:00", "2026-11-21 12:00:00")


@pytest.mark.parametrize(
    ("to", "column", "said"),
    [("nbgrader", "student_id", "s501"), ("moodle", "useridnumber", "s501"), ("brightspace", "Username", "#s501")],
)
def test_without_a_gradebook_students_are_called_as_in_the_class_list(
    to: str, column: str, said: str, tmp_path: Path
) -> None:
    """A platform that knows s501 finds no "Ada Lovelace_501"."""
    out = batch_in(
        tmp_path / "out", [from_platform("moodle", "Ada Lovelace_501", name="Ada Lovelace"), grade("Bob Builder_502")]
    )
    (out / "class.csv").write_text("student,name\ns501,Ada Lovelace\n")
    ada, bob = rows_of(Path(export(out, to, None, NOTHING).files[0]))
    assert ada[column] == said and bob[column].removeprefix("#") == "Bob Builder_502"


def test_nbgrader_takes_the_name_from_its_folders(tmp_path: Path) -> None:
    done = exported(tmp_path, "nbgrader", [from_platform("nbgrader", "ada", assignment="ps1")])
    assert rows_of(Path(done.files[0]))[0]["assignment"] == "ps1"


@pytest.mark.skipif(find_spec("nbgrader") is not None, reason="nbgrader is installed")
def test_nbgrader_database_without_nbgrader_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"install it with: .*pip install .*nbgrader"):
        exported(tmp_path, "nbgrader", [grade()], ExportOptions(gradebook=tmp_path / "gradebook.db"))


def test_canvas_gets_every_student_back_and_no_other_grade(tmp_path: Path) -> None:
    book = tmp_path / "canvas-export.csv"
    book.write_text(CANVAS)
    grades = [
        from_platform("canvas", "lovelaceada_101", id="101", name="lovelaceada"),
        grade("grace@x.edu"),
        from_platform("canvas", "nobody_999", id="999", name="nobody"),
        from_platform("other", "A Twin", name="Twin A"),
    ]
    done = exported(tmp_path, "canvas", grades, ExportOptions(gradebook=book))
    lines = list(csv.reader(io.StringIO(Path(done.files[0]).read_text())))
    assert lines == [
        ["Student", "ID", "SIS User ID", "SIS Login ID", "Section", "Tracking (77)"],
        ["", "", "", "", "", "Manual Posting"],
        ["    Points Possible", "", "", "", "", "30.0"],
        ["Lovelace, Ada", "101", "s-ada", "ada@x.edu", "M1", "26"],
        ["Hopper, Grace", "102", "s-grace", "grace@x.edu", "M1", "26"],
        ["Twin, A", "103", "s-a", "a@x.edu", "M1", ""],
        ["Twin, A", "104", "s-b", "b@x.edu", "M1", ""],
    ]
    assert set(done.left_out) == {"nobody_999", "A Twin"}
    assert "2 lines" in done.left_out["A Twin"] and "2 of the gradebook have no grade here" in done.notes[0]
    assert book.read_text() == CANVAS


def test_canvas_asks_for_the_gradebook_and_for_the_same_points(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--gradebook"):
        exported(tmp_path / "a", "canvas", [grade()])
    book = tmp_path / "book.csv"
    book.write_text(CANVAS.replace("30.0", "100"))
    with pytest.raises(InputError, match="--points 100"):
        exported(tmp_path / "b", "canvas", [grade("s-ada")], ExportOptions(gradebook=book))
    done = exported(tmp_path / "c", "canvas", [grade("s-ada")], ExportOptions(gradebook=book, points=100.0))
    points = [row["Tracking (77)"] for row in rows_of(Path(done.files[0]))]
    assert points == ["Manual Posting", "100", "86.6666667", "12", "", ""]  # hers is as it was entered by hand


def test_canvas_new_column_gets_its_points(tmp_path: Path) -> None:
    book = tmp_path / "book.csv"
    book.write_text(CANVAS)
    done = exported(tmp_path, "canvas", [grade("s-ada")], ExportOptions(gradebook=book), title="Observer")
    rows = rows_of(Path(done.files[0]))
    assert [row["Observer"] for row in rows] == ["", "30", "26", "", "", ""]
    assert "no column 'Observer'" in done.notes[0]
    with pytest.raises(InputError, match="no column 'Obsrver'"):
        exported(tmp_path / "x", "canvas", [grade("s-ada")], ExportOptions(gradebook=book, column="Obsrver"))


def test_two_students_never_share_a_line(tmp_path: Path) -> None:
    book = tmp_path / "book.csv"
    book.write_text(CANVAS)
    done = exported(tmp_path, "canvas", [grade("s-ada"), grade("ada@x.edu")], ExportOptions(gradebook=book))
    assert set(done.left_out) == {"s-ada", "ada@x.edu"}
    assert done.students == 0


def test_comments_count_in_the_gradebook_s_own_points(tmp_path: Path) -> None:
    sheet = tmp_path / "worksheet.csv"
    sheet.write_text(WORKSHEET.replace("30.00", "6.00"), encoding="utf-8")
    late = replace(from_platform("moodle", "Ada Lovelace_501", id="501"), late_days=1.0, before_penalty=28.0)
    done = exported(tmp_path, "moodle", [late], ExportOptions(gradebook=sheet, points=6.0))
    ada, _ = rows_of(Path(done.files[0]))
    said = ada["Feedback comments"]
    assert ada["Grade"] == "5.2" and "5.2 of 6 points (26 of the 30 points on the feedback page)." in said
    assert "Error rms: 1.2 of 2 points." in said and "Error hidden: 4 of 4 points." in said
    assert "1 days late: 0.4 points are lost." in said


def test_moodle_worksheet_is_filled_in_and_otherwise_the_same(tmp_path: Path) -> None:
    sheet = tmp_path / "worksheet.csv"
    sheet.write_text(WORKSHEET, encoding="utf-8")
    hostile = grade("x", Status.OK, score("rms", 10.0, 30.0, sentence="<script>alert(1)</script> \\"))
    grades = [
        from_platform("moodle", "Ada Lovelace_501", id="501", name="Ada Lovelace"),
        replace(hostile, details={"source": {"platform": "moodle", "id": "502"}}),
        from_platform("moodle", "Else_777", id="777", name="Else"),
    ]
    done = exported(tmp_path, "moodle", grades, ExportOptions(gradebook=sheet))
    text = Path(done.files[0]).read_text(encoding="utf-8")
    assert text.splitlines()[0] == WORKSHEET.splitlines()[0]
    ada, grace = rows_of(Path(done.files[0]))
    assert (ada["Grade"], grace["Grade"]) == ("26", "10")
    assert "Error rms: 6 of 10 points. The rms error is 0.23 mm." in ada["Feedback comments"]
    assert "Error hidden: 20 of 20 points. Hidden" in ada["Feedback comments"]
    assert "secret" not in text and "<script>" not in text
    assert "\\" not in text  # behind which Moodle's reader takes a quotation mark for a part of the cell
    assert ada["Email address"] == "Ada@x.edu"  # Moodle minds the capitals
    assert set(done.left_out) == {"Else_777"}


def test_names_are_the_same_however_their_accents_are_written(tmp_path: Path) -> None:
    book = tmp_path / "grades.csv"
    book.write_text(
        "Full name,ID number,Assignment: Tracking (Real)\nJos\u00e9 Pe\u00f1a,,-\nJose Pena,,-\n", encoding="utf-8"
    )
    done = exported(tmp_path, "moodle", [grade("Jose\u0301 Pen\u0303a")], ExportOptions(gradebook=book))
    assert [row["Assignment: Tracking (Real)"] for row in rows_of(Path(done.files[0]))] == ["26", "-"]


def test_a_gradebook_whose_cells_end_at_semicolons_is_filled_in_as_it_came(tmp_path: Path) -> None:
    book = tmp_path / "grades.csv"
    book.write_text("Full name;ID number;Assignment: Tracking (Real)\nAda;ada;-\n", encoding="utf-8")
    done = exported(tmp_path, "moodle", [grade("ada")], ExportOptions(gradebook=book))
    assert Path(done.files[0]).read_text(encoding="utf-8").splitlines()[1] == "Ada;ada;26"


def test_moodle_maximum_grade_is_kept_to(tmp_path: Path) -> None:
    sheet = tmp_path / "worksheet.csv"
    sheet.write_text(WORKSHEET.replace("30.00", "100.00"), encoding="utf-8")
    with pytest.raises(InputError, match="--points 100"):
        exported(tmp_path, "moodle", [grade("ada@x.edu")], ExportOptions(gradebook=sheet))


def test_moodle_gradebook_is_filled_in_by_title(tmp_path: Path) -> None:
    book = tmp_path / "grades.csv"
    book.write_text(
        "First name,Last name,ID number,Email address,Assignment: Tracking (Real),Course total (Real)\n"
        "Ada,Lovelace,s1,ada@x.edu,-,-\nGrace,Hopper,s2,grace@x.edu,-,-\n"
    )
    done = exported(tmp_path, "moodle", [grade("s2")], ExportOptions(gradebook=book))
    assert [row["Assignment: Tracking (Real)"] for row in rows_of(Path(done.files[0]))] == ["-", "26"]


def test_the_number_of_a_participant_in_moodle_is_nobody_s_id_number(tmp_path: Path) -> None:
    book = tmp_path / "grades.csv"
    book.write_text("Full name,ID number,Assignment: Tracking (Real)\nAda Lovelace,900,-\nGrace Hopper,501,-\n")
    ada = from_platform("moodle", "Ada Lovelace_501", id="501", name="Ada Lovelace")
    done = exported(tmp_path, "moodle", [ada], ExportOptions(gradebook=book))
    assert [row["Assignment: Tracking (Real)"] for row in rows_of(Path(done.files[0]))] == ["26", "-"]


def test_moodle_without_a_download_has_three_columns(tmp_path: Path) -> None:
    done = exported(tmp_path, "moodle", [grade("ada@x.edu"), grade("4711")])
    assert Path(done.files[0]).read_text().splitlines() == [
        "useridnumber,useremail,Tracking",
        "4711,,26",
        ",ada@x.edu,26",
    ]
    assert done.notes == export(tmp_path / "out", "moodle", None, NOTHING).notes  # the same again
    *before, last = export(tmp_path / "out", "moodle", None, ExportOptions(points=10.0)).notes
    assert tuple(before) == done.notes and "moodle.csv: an earlier export with other content was there" in last


def page_with(*sizes: int) -> str:
    """A feedback page with pictures of so many characters."""
    return "".join(f'<img alt="case {k}" src="data:image/svg+xml;base64,{"A" * n}">' for k, n in enumerate(sizes))


def test_gradescope_is_valid_and_hides_what_is_hidden(tmp_path: Path) -> None:
    everything = [grade(f"s{k}", status) for k, status in enumerate(Status)]
    everything += [grade(name) for name in HOSTILE]
    everything[0] = replace(everything[0], notes=("It printed:\n</pre><script>alert(1)</script>",))
    done = exported(tmp_path, "gradescope", everything, pages={"s0": page_with(100)})
    assert len(done.files) == len(everything)
    for name in done.files:
        data = json.loads(Path(name).read_text())
        hold_against(GRADESCOPE, data)
        assert "<script>" not in data["output"] and "secret" not in json.dumps(data.get("tests"))
    first = json.loads((tmp_path / "out/gradescope/s0/results.json").read_text())
    assert first["score"] == 26.0
    assert [(t["score"], t["max_score"], t["status"], t["visibility"]) for t in first["tests"]] == [
        (6.0, 10.0, "failed", "visible"),
        (20.0, 20.0, "passed", "after_published"),
    ]
    assert 'alt="case 0"' in first["output"]
    assert first["tests"][0]["extra_data"]["value"] == 0.23


def test_prairielearn_is_valid_and_no_larger_than_it_may_be(tmp_path: Path) -> None:
    everything = [grade(f"s{k}", status) for k, status in enumerate(Status)]
    done = exported(tmp_path, "prairielearn", everything, pages={"s0": page_with(400_000, 400_000, 400_000)})
    for name in done.files:
        data = Path(name).read_bytes()
        assert len(data) <= LARGEST
        hold_against(PRAIRIELEARN, json.loads(data))
    first = json.loads((tmp_path / "out/prairielearn/s0/results.json").read_text())
    assert first["score"] == pytest.approx(26 / 30)
    assert [image["label"] for image in first["images"]] == ["case 0", "case 1"]
    assert "1 of 3 pictures" in done.notes[0]


def test_points_by_hand_for_a_file_that_could_not_be_loaded_reach_prairielearn() -> None:
    failed = grade("ada", Status.FAILED_TO_LOAD)
    assert "score" not in prairielearn.results(failed, [])
    marked = prairielearn.results(replace(failed, score=12.0, before_penalty=15.0), [])
    hold_against(PRAIRIELEARN, marked)
    assert marked["score"] == pytest.approx(12 / 30) and "failed to load" in marked["message"]


def test_what_the_grader_could_not_grade_is_a_zero_nowhere(tmp_path: Path) -> None:
    grades = [grade("ada"), grade("bob", Status.GRADER_ERROR)]
    for to in ("nbgrader", "moodle"):
        done = exported(tmp_path / to, to, grades)
        assert "bob" not in Path(done.files[0]).read_text()
        assert "not been graded" in done.left_out["bob"]
    for to in ("gradescope", "prairielearn"):
        exported(tmp_path / to, to, grades)
        data = json.loads((tmp_path / to / "out" / to / "bob/results.json").read_text())
        assert "score" not in data
    assert ",grader error,," in "".join(grades_csv(grades))


def test_a_batch_that_is_not_finished_says_who_is_missing(tmp_path: Path) -> None:
    done = exported(tmp_path, "nbgrader", [grade("ada")], handed_in={"ada": "1", "bob": "2"})
    assert set(done.left_out) == {"bob"}


def test_one_student_may_be_one_file(tmp_path: Path) -> None:
    out = batch_in(tmp_path / "out", [grade("ada")])
    done = export(out, "gradescope", tmp_path / "results.json", NOTHING)
    assert done.files == (str(tmp_path / "results.json"),)
    assert json.loads((tmp_path / "results.json").read_text())["score"] == 26.0


def test_the_folder_for_the_files_of_the_students_may_have_a_dot_in_its_name(tmp_path: Path) -> None:
    out, place = batch_in(tmp_path / "out", [grade("ada"), grade("bob")]), tmp_path / "grades.2026"
    with pytest.raises(InputError, match="have to be a folder"):
        export(out, "gradescope", place, NOTHING)
    place.mkdir()
    assert len(export(out, "gradescope", place, NOTHING).files) == 2
    assert (place / "bob/results.json").is_file()


@pytest.mark.parametrize("to", GRADEBOOKS.names())
def test_options_are_used_or_refused(to: str, tmp_path: Path) -> None:
    out = batch_in(tmp_path / "out", [grade("ada")])
    uses = getattr(GRADEBOOKS.module(to), "USES", ())
    for option, value in (("gradebook", tmp_path / "no.csv"), ("column", "Else"), ("points", 50.0)):
        if option not in uses:
            with pytest.raises(InputError, match=f"--{option} has no meaning for {to}"):
                export(out, to, None, ExportOptions(**{option: value}))


def test_refusals(tmp_path: Path) -> None:
    out = batch_in(tmp_path / "out", [grade("ada")])
    book = tmp_path / "book.csv"
    book.write_text(CANVAS)
    with pytest.raises(InputError, match="known gradebooks: nbgrader, moodle, moodle-feedback, canvas"):
        export(out, "webct", None, NOTHING)
    with pytest.raises(InputError, match="your own gradebook"):
        export(out, "canvas", book, ExportOptions(gradebook=book))
    for text in ("", "a,b\n1,2\n", "Student,ID,Section\n1,2,3,4,5\n", '"unfinished'):
        book.write_text(text)
        for to in ("canvas", "moodle"):
            with pytest.raises(InputError, match=r"book\.csv"):
                export(out, to, None, ExportOptions(gradebook=book))
    book.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="UTF-8"):
        export(out, "canvas", None, ExportOptions(gradebook=book))
    with pytest.raises(InputError, match=r"rds grade run"):
        export(tmp_path, "nbgrader", None, NOTHING)
    for points in (0.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match="must be a finite number above 0"):
            export(out, "nbgrader", None, ExportOptions(points=points))
    (out / "students/ada/grade.json").write_text("{}")
    with pytest.raises(InputError, match="is not a grade"):
        export(out, "nbgrader", None, NOTHING)
    assert not list(out.glob("*.csv"))


@given(st.text())
def test_no_cell_of_a_table_is_a_formula(text: str) -> None:
    (row,) = csv.reader(io.StringIO(csv_text([[text, "x"]]), newline=""))
    assert not row[0].startswith(("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠"))
    assert row[1] == "x"
    assert not text.isprintable() or len(text) > MOST or uncell(cell(text)) == text


@pytest.mark.parametrize("separator", [";", "\t", "|"])
def test_a_spreadsheet_of_another_country_finds_no_formula_behind_a_separator(separator: str) -> None:
    """Which takes `;` for the end of a cell, unless it stands between quotation marks."""
    text = csv_text([[f"ada{separator}=HYPERLINK(1)", "x"]])
    (row,) = csv.reader(io.StringIO(text), delimiter=separator)
    assert row[0].startswith(f"ada{separator}=")


@given(st.floats(allow_nan=False, allow_infinity=False, width=32))
def test_numbers_of_a_table_stay_numbers(value: float) -> None:
    (row,) = csv.reader(io.StringIO(csv_text([[value]])))
    assert float(row[0]) == pytest.approx(value, rel=1e-11)


def test_the_class_table_has_a_column_with_its_unit_for_each_criterion() -> None:
    lines = list(csv.DictReader(io.StringIO("".join(grades_csv([grade(name) for name in HOSTILE])), newline="")))
    assert len(lines) == len(HOSTILE)
    assert lines[0]["rms [points of 10]"] == "6" and lines[0]["rms value [mm]"] == "0.23"
    assert lines[0]["student"] == '\'=HYPERLINK("http://x")'
    assert lines[2]["student"] == "\\u202eevil\nline"


def test_the_command_lists_who_is_left_out(tmp_path: Path) -> None:
    book = tmp_path / "book.csv"
    book.write_text(CANVAS)
    out = batch_in(tmp_path / "out", [grade("s-ada"), grade("nobody")])
    arguments = ["grade", "export", str(out), "--to", "canvas", "--gradebook", str(book)]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 1
    assert "left out: nobody" in done.stderr
    told = json.loads(CliRunner().invoke(app, [*arguments, "--json"]).stdout)
    assert told["students"] == 1 and list(told["left_out"]) == ["nobody"]
    assert CliRunner().invoke(app, ["grade", "export", str(out), "--to", "word"]).exit_code == 2


def test_points_go_to_nobody_whose_identifier_is_what_another_handed_in_as(tmp_path: Path) -> None:
    """`miller` of the class list's s1 is not the user `miller`; and each name of a file without a gradebook is once."""
    book = tmp_path / "book.csv"
    book.write_text(
        "Last Name,First Name,Username,Student ID,Tracking [Total Pts: 30] |7\nM,A,miller,s2,\nM,B,am,s1,\n"
    )
    mine = grade("miller", details={LISTED: "s1"})
    sheet = read_sheet(book)
    keys = [Key("Username", identifiers), Key("Student ID", identifiers)]
    assert find([mine], sheet, keys) == ({1: mine}, {})
    others = [grade("s9", details={LISTED: "x"}), grade("b", details={LISTED: "x"}), grade("c", details={LISTED: "b"})]
    assert names_here([mine, *others]) == {"miller": "s1", "s9": "s9", "b": "b", "c": "c"}
