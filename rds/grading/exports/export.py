"""Grades of a batch, written as a gradebook."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rds.core.atomic import write_files
from rds.core.errors import InputError
from rds.grading.batch.finished import read_finished
from rds.grading.exports import GRADEBOOKS
from rds.grading.exports.exported import ExportOptions
from rds.grading.exports.one_json import NAME
from rds.grading.feedback.plain_text import one_line


@dataclass(frozen=True)
class Written:
    """What was written where. `left_out` are students who are not in it, with the reason: never nobody in silence."""

    place: str
    files: tuple[str, ...]
    students: int
    left_out: Mapping[str, str]
    notes: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """In JSON's own types."""
        return asdict(self)


def export(out: Path, to: str, file: Path | None, wanted: ExportOptions) -> Written:
    """Write the grades in the folder `out` for the gradebook `to`, into `file` (default: a place of its own in `out`).

    Files appear whole or not at all. InputError for a folder that is no batch's, a name that is no gradebook, an
    option that would be ignored, or a place that is the instructor's own gradebook.
    """
    module = GRADEBOOKS.module(to)
    finished = read_finished(out)
    if file is not None and wanted.gradebook is not None and file.resolve() == wanted.gradebook.resolve():
        raise InputError("is your own gradebook; name another file by -o", str(file))
    made = module.export(finished, wanted)
    if not made.files and file is not None:
        raise InputError("-o has no meaning where a database is changed; leave it out", str(file))
    place = Path(str(wanted.gradebook)) if not made.files else file or out / module.FILE
    paths = _paths(place, made.files)
    replaced = [path for path, data in paths.items() if path.is_file() and path.read_bytes() != data]
    write_files(paths)
    waiting = dict.fromkeys(finished.not_graded, "it has not been graded; run `rds grade run` again with --resume")
    left_out = {one_line(name): reason for name, reason in {**waiting, **made.unmatched}.items()}
    notes = (*made.notes, *_of_replaced(replaced))
    return Written(str(place), tuple(str(path) for path in paths), made.students, left_out, notes)


def _of_replaced(paths: Sequence[Path]) -> list[str]:
    """A note where files of an earlier export, perhaps for another gradebook, are no more."""
    if not paths:
        return []
    what = str(paths[0]) if len(paths) == 1 else f"{len(paths)} files in {paths[0].parent}"
    return [f"{what}: an earlier export with other content was there and is replaced; name another place by -o"]


def _paths(place: Path, files: Mapping[str, bytes]) -> dict[Path, bytes]:
    """One table, or one student's JSON, is a file; else `place` is a folder."""
    if len(files) == 1:
        name, data = next(iter(files.items()))
        if not name.endswith(f"/{NAME}") or place.suffix == ".json":
            if place.is_dir():
                raise InputError("is a folder; name a file", str(place))
            return {place: data}
    if files and place.suffix and not place.is_dir():
        raise InputError("would have to be a folder: there is a file for each student", str(place))
    return {place / name: data for name, data in files.items()}
