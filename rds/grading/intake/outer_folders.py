"""The folders around those of students, that exports have, or who packs a folder into a zip; and a class's prefix."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

from rds.grading.intake.attempts import is_dated, is_version
from rds.grading.intake.gradescope import METADATA
from rds.grading.intake.items import Item
from rds.grading.intake.names import without_number
from rds.grading.intake.nbgrader import STAMP

DRAFTS = "Working files"  # in Teams, beside what was handed in
_HANDED_IN = "Submitted files"
# folders in which one student keeps parts of a submission
_PARTS = frozenset(
    {"code", "data", "doc", "docs", "lib", "notebooks", "old", "python", "source", "src", "test", "tests"}
)
_OF_CLASSROOM = re.compile(r"(?P<assignment>.+)-submissions")  # of GitHub Classroom, by `gh classroom clone`
_KNOWN = re.compile(rf"assignment_\d+_export|submitted|submissions|Student Work|{_HANDED_IN}|.+-submissions")
_OF_ILIAS = ("Abgaben", "Submissions")  # in the folder of the exercise
# whatever is in the student's names, the platform puts the login and its own number behind them
ILIAS_FOLDER = re.compile(r"(?P<names>.+_.+)_(?P<login>[^_]+)_\d+", re.DOTALL)
_ILIAS_TEAM = re.compile(r"Team \d+")


def without_root(
    items: Sequence[Item],
    folders: Sequence[str],
    zipped: bool,
    accepted: Sequence[str],
    is_one_s_name: Callable[[str], bool],
) -> tuple[list[Item], list[str], str]:
    """Without the one folder around everything that exports and courses have, or who packs a folder into a zip.

    `is_one_s_name` says of a folder's name whether a platform gives such a one to a student. The third is the name of
    the innermost of these folders; empty if there is none.
    """
    around = ""
    if {*folders} == {DRAFTS, _HANDED_IN}:
        items, folders = [item for item in items if item.parts[0] != DRAFTS], [_HANDED_IN]
    while len(folders) == 1 and all(len(item.parts) > 1 for item in items if item.is_handed_in):
        is_of_ilias = _is_of_ilias(items)
        is_one_s = is_one_s_name(folders[0]) or any(item.parts == (METADATA,) for item in items)
        is_known = is_of_ilias or _KNOWN.fullmatch(folders[0])
        if not is_known and (is_one_s or not zipped or not _is_of_a_class(items, accepted)):
            break
        around = folders[0]
        items = [replace(item, parts=item.parts[1:]) if len(item.parts) > 1 else item for item in items]
        folders = sorted({item.parts[0] for item in items if len(item.parts) > 1})
        if {*folders} == {DRAFTS, _HANDED_IN}:
            return without_root(items, folders, zipped, accepted, is_one_s_name)
        if is_of_ilias and around in _OF_ILIAS:
            break
    return list(items), list(folders), around


def _is_of_a_class(items: Sequence[Item], accepted: Sequence[str]) -> bool:
    """Whether what lies in one folder is several students': in a folder, or a file, of each of them."""
    handed_in = [item for item in items if item.is_handed_in]
    if len(handed_in) < 2:
        return False
    at = 1  # of the first folder, or file, that they do not share
    while len({item.parts[:at] for item in handed_in}) == 1 and all(len(item.parts) > at for item in handed_in):
        at += 1
    alone = [item.name for item in handed_in if len(item.parts) == at]
    in_folders = {item.parts[at - 1] for item in handed_in if len(item.parts) > at}
    is_one_s = any(without_number(name, accepted)[0] in accepted for name in alone)
    is_one_s |= bool(in_folders) and not alone and all(map(is_part, in_folders))
    around = handed_in[0].parts[: at - 1]  # what the only one to hand in has in it says nothing of others
    is_one_s |= any(is_version(folder) or is_dated(folder) for folder in around)
    is_one_s |= any(item.name == STAMP and item.parts[:-1] == around[: len(item.parts) - 1] for item in items)
    return not is_one_s and (len(in_folders) > 1 or len(alone) > 1)


def is_part(folder: str) -> bool:
    """Whether a folder is called as one inside a submission is."""
    return is_version(folder) or is_dated(folder) or folder.lower() in _PARTS


def _is_of_ilias(items: Sequence[Item]) -> bool:
    """Whether all lies in folders of students or teams, in ILIAS's folder for these or the exercise's around it."""
    handed_in = [item.parts for item in items if item.is_handed_in]
    at = 0 if handed_in and handed_in[0][0] in _OF_ILIAS else 1
    return bool(handed_in) and all(
        len(parts) > at + 2
        and parts[at] in _OF_ILIAS
        and (ILIAS_FOLDER.fullmatch(parts[at + 1]) or _ILIAS_TEAM.fullmatch(parts[at + 1]))
        for parts in handed_in
    )


def of_classroom(folders: Sequence[str], around: str) -> str:
    """What all names of GitHub Classroom's repositories begin with, in a folder called `around`; nothing elsewhere."""
    found = _OF_CLASSROOM.fullmatch(around)
    prefix = f"{found['assignment']}-" if found else ""
    return prefix if folders and all(each.startswith(prefix) and each != prefix for each in folders) else ""
