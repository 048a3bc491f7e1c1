"""A small assignment, and submissions of every kind, for tests of batches."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

ASSIGNMENT = """
title = "Small"
kind = "controller"
files = ["controller.py", "controller.ipynb"]
secret = "drawn from this in tests"
solution = "solution.py"
due = 2026-01-10T12:00:00+01:00

[late]
percent_per_day = 10.0

[[case]]
name = "sine"
axis = "X"
duration = 0.2
[case.reference]
kind = "sinusoid"
amplitude = 1.0
frequency = 5.0
[case.vary]
tau = "±10 %"

[[criterion]]
name = "rms"
kind = "rms-error"
case = "sine"
points = 10.0
full = 0.01
none = 1.0
unit = "mm"

[[criterion]]
name = "effort"
kind = "effort"
case = "sine"
points = 5.0
full = 1.0
none = 50.0
unit = "V"
"""


def law(gain: float = 30.0) -> str:
    """A proportional controller with feedforward."""
    return (
        f'params = {{"Kp": {gain}, "Kv": 0.567}}\n\n\n'
        "def control(t, r, y, state, params):\n"
        '    return params["Kp"] * (r.position - y) + params["Kv"] * r.velocity, state\n'
    )


def notebook(*cells: str) -> str:
    """A notebook with these code cells, and text between them."""
    made = [{"cell_type": "code", "source": cell, "metadata": {}, "outputs": []} for cell in cells]
    return json.dumps({"nbformat": 4, "nbformat_minor": 5, "metadata": {}, "cells": [{"cell_type": "markdown"}, *made]})


def zipped(path: Path, files: dict[str, str | bytes]) -> Path:
    """A zip of files by name."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name, (2026, 1, 12, 11, 0, 0)), data, zipfile.ZIP_DEFLATED)
    return path


def put(folder: Path, files: dict[str, str]) -> Path:
    """Files of these names with these texts, in folders as needed."""
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder
