"""A plug-in for `nbgrader export`: a column per criterion, which its own table does not have.

nbgrader export --exporter=rds.grading.exports.nbgrader_plugin.CriteriaExportPlugin --to criteria.csv
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from nbgrader.plugins import ExportPlugin  # type: ignore[import-not-found]

from rds.core.atomic import write_whole
from rds.grading.batch.grades_table import csv_text
from rds.grading.exports.nbgrader_gradebook import NOTEBOOK


class CriteriaExportPlugin(ExportPlugin):  # type: ignore[misc]
    """A line for each student and assignment that rds has graded: the points of every criterion, penalty, score."""

    def export(self, gradebook: Any) -> None:
        """Write the table to `--to`, by default `criteria.csv`."""
        rows: list[list[str | float | None]] = []
        cells: dict[str, None] = {}
        found: list[tuple[str, str, dict[str, float], float, float]] = []
        for assignment in gradebook.assignments:
            if self.assignment and assignment.name not in map(str, self.assignment):
                continue
            for submission in assignment.submissions:
                if self.student and submission.student.id not in map(str, self.student):
                    continue
                for notebook in submission.notebooks:
                    if notebook.name == NOTEBOOK:
                        points = {grade.name: float(grade.score) for grade in notebook.grades}
                        cells |= dict.fromkeys(points)
                        lost = float(notebook.late_submission_penalty or 0.0)
                        found.append((assignment.name, submission.student.id, points, lost, float(notebook.score)))
        for name, student, points, lost, score in found:
            rows.append([name, student, *(points.get(cell) for cell in cells), lost, max(0.0, score - lost)])
        columns = ["assignment", "student_id", *cells, "late_submission_penalty", "score"]
        write_whole(Path(self.to or "criteria.csv"), csv_text([columns, *rows]).encode())
