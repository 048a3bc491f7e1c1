"""Frames of a traceback: whose code they are, and how a message names them."""

from __future__ import annotations

import sysconfig
from pathlib import Path
from traceback import FrameSummary


def place_of(frame: FrameSummary) -> str:
    """A frame in words, such as "file.py, line 12, in control"."""
    name = "a notebook cell" if "ipykernel" in frame.filename else Path(frame.filename).name
    return f"{name}, line {frame.lineno}, in {frame.name}"


def is_installed(filename: str) -> bool:
    """True for a file of this package, of the standard library or of an installed package."""
    parts = sysconfig.get_paths()
    roots = {parts["stdlib"], parts["purelib"], parts["platlib"], str(Path(__file__).resolve().parents[1])}
    return any(Path(filename).is_relative_to(root) for root in roots)
