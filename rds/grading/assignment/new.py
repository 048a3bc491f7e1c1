"""A new assignment that passes its check: the smallest of its kind, to be changed into one's own."""

from __future__ import annotations

import re
import secrets
from pathlib import Path

from rds.core.errors import InputError
from rds.core.private_files import make_folder, write_private
from rds.core.toml_text import toml_text
from rds.grading.assignment.assignment_file import READERS

_STARTERS = Path(__file__).with_name("starters")


def new_assignment(folder: Path, kind: str, title: str = "") -> list[Path]:
    """Make the new `folder` with an assignment of this kind and a secret of its own; the files.

    `title` is by default the folder's name. InputError for a kind that is none, or a folder that holds something.
    """
    if kind not in READERS:
        raise InputError(f"kind = {kind!r} must be one of {', '.join(READERS)}")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError("is there already; name a new folder", str(folder))
    said = title or folder.resolve().name.replace("-", " ").replace("_", " ").capitalize()
    if "\n" in said or not said.isprintable():
        raise InputError(f"title = {said!r} must be one line of text")
    words = {'"TITLE"': toml_text({"title": said}).partition("=")[2].strip(), "TITLE": said}
    words["SECRET"] = secrets.token_hex(16)
    made = []
    try:
        make_folder(folder)
        for source in sorted((_STARTERS / kind).iterdir()):
            if not source.is_file():
                continue
            text = source.read_text(encoding="utf-8")
            text = re.sub('"TITLE"|TITLE|SECRET', lambda found: words[found[0]], text)
            write_private(folder / source.name, text.encode())
            made.append(folder / source.name)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}; name another place", str(folder)) from error
    return made
