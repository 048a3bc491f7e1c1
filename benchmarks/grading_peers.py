"""Other graders on the same work: a notebook that simulates the same 10 s and judges its error."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
STUDENTS = 3  # the second and later ones are nbgrader's steady state
_LONGEST = 300.0  # s


def notebook(place: Path) -> dict[str, Any]:
    """Of nbformat 4.5, with nbgrader's marks on the cell that is graded."""
    work = (
        f"import sys\nsys.path.insert(0, {str(ROOT)!r})\nimport rds\n"
        "experiment = rds.Experiment(axis='X', duration=10.0, reference=rds.sinusoid(5.0, 0.2), "
        f"controller={str(place / 'numpy.py')!r})\nresult = experiment.run()"
    )
    test = "assert result.metrics['X']['rms_error'] < 1.0"
    marks = {"grade": True, "grade_id": "rms", "locked": True, "points": 10, "schema_version": 3, "solution": False}
    cells = [_cell("work", work, {}), _cell("test", test, {"nbgrader": {**marks, "task": False, "cell_type": "code"}})]
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
    return {"nbformat": 4, "nbformat_minor": 5, "metadata": kernel, "cells": cells}


def nbclient_seconds(place: Path, peer_python: str) -> float | str:
    """One notebook in a fresh kernel; why it is skipped where it is not installed."""
    try:
        import nbformat
        from nbclient import NotebookClient
    except ImportError as error:
        return f"skipped: {error}"
    begun = perf_counter()
    NotebookClient(nbformat.from_dict(notebook(place)), timeout=int(_LONGEST)).execute()
    return perf_counter() - begun


def autograde_seconds(place: Path, peer_python: str, students: int = STUDENTS) -> float | str:
    """`nbgrader autograde` of some students, for each; nbgrader is looked for in the environment of `peer_python`."""
    command = Path(peer_python).with_name("nbgrader")
    if not command.is_file():
        return "skipped: no nbgrader beside --peer-python"
    course = Path(tempfile.mkdtemp(prefix="course-", dir=place))
    text = json.dumps(notebook(place))
    for folder in ("source/ps1", *(f"submitted/s{number}/ps1" for number in range(students))):
        (course / folder).mkdir(parents=True)
        (course / folder / "nb.ipynb").write_text(text)
    (course / "nbgrader_config.py").write_text(f"c = get_config()\nc.CourseDirectory.root = {str(course)!r}\n")
    try:
        _called([str(command), "generate_assignment", "ps1"], course)
        begun = perf_counter()
        _called([str(command), "autograde", "ps1"], course)
        return (perf_counter() - begun) / students
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
        said = error.stderr or b""
        return f"skipped: {said.decode(errors='replace').strip().splitlines()[-1][:120] if said else error}"


def _cell(name: str, source: str, metadata: dict[str, Any]) -> dict[str, Any]:
    about = {"cell_type": "code", "id": name, "metadata": metadata, "outputs": [], "execution_count": None}
    return {**about, "source": source}


def _called(words: list[str], folder: Path) -> None:
    path = f"{Path(words[0]).parent}{os.pathsep}{os.environ.get('PATH', '')}"  # it calls alembic by name
    environment = os.environ | {"PATH": path}
    subprocess.run(words, cwd=folder, env=environment, check=True, capture_output=True, timeout=_LONGEST)
