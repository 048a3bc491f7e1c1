"""A JSON file for each student, as large as the platform takes."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Any

from rds.grading.batch.finished import FEEDBACK, Finished
from rds.grading.exports.exported import Exported
from rds.grading.exports.pictures import Picture, pictures_of
from rds.grading.grade import Grade

LARGEST = 1_000_000  # bytes
NAME = "results.json"


def each_student(finished: Finished, results: Callable[[Grade, Sequence[Picture]], dict[str, Any]]) -> Exported:
    """`results` of everybody, in a folder each. Pictures that make a file too large are left out from the last."""
    files, notes = {}, []
    for grade in finished.grades:
        folder = finished.folders[grade.student]
        pictures = pictures_of(folder / FEEDBACK)
        kept = len(pictures)
        data = _json(results(grade, pictures))
        while len(data) > LARGEST and kept:
            kept -= 1
            data = _json(results(grade, pictures[:kept]))
        if kept < len(pictures):
            notes.append(f"{folder.name}: {len(pictures) - kept} of {len(pictures)} pictures do not fit into 1 MB")
        files[f"{folder.name}/{NAME}"] = data
    return Exported(files, notes=tuple(notes), students=len(finished.to_hand_on))


def _json(value: dict[str, Any]) -> bytes:
    return json.dumps(value, allow_nan=False, indent=1).encode() + b"\n"
