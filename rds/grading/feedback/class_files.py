"""What a batch leaves for the instructor: `grades.csv` and `index.html`."""

from __future__ import annotations

import codecs
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

from rds.core.atomic import write_files
from rds.grading.batch.finished import FEEDBACK, STUDENTS
from rds.grading.batch.grades_table import grades_csv
from rds.grading.feedback.class_report import class_page
from rds.grading.grade import Grade
from rds.grading.intake.names import safe_id
from rds.grading.review.entries import Review

TABLE, PAGE = "grades.csv", "index.html"


def write_class_files(
    out: Path,
    title: str,
    grades: Sequence[Grade],
    *,
    seconds: Mapping[str, float] | None = None,
    similar: str = "",
    about: str = "",
    review: Review | None = None,
) -> list[Path]:
    """Write both into `out`, whole or not at all; see `class_page`. InputError where the system refuses."""
    links = {grade.student: f"{STUDENTS}/{safe_id(grade.student)}/{FEEDBACK}" for grade in grades}

    def table(stream: BinaryIO) -> None:
        stream.write(codecs.BOM_UTF8)  # by which spreadsheets know UTF-8
        for line in grades_csv(grades):
            stream.write(line.encode("utf-8", "replace"))

    def page(stream: BinaryIO) -> None:
        for part in class_page(title, grades, links, seconds=seconds, similar=similar, about=about, review=review):
            stream.write(part.encode("utf-8", "replace"))

    made = {TABLE: table, PAGE: page}
    write_files({out / name: write for name, write in made.items()})
    return [out / name for name in made]
