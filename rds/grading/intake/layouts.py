"""Which student a file belongs to, from where it lies: a function of paths alone.

submitted/ada/ps1/controller.py                          nbgrader
Ada Lovelace_12345_assignsubmission_file_/controller.py  Moodle, also without the folder
lovelaceada_LATE_12345_67890_controller-1.py             Canvas
Task 1_ada_attempt_2026-01-09-10-00-00_controller.py     Blackboard
111-67890 - Ada Lovelace - Jan 5, 2026 1012 AM/x.py      Brightspace, also without the folder
Lovelace Ada 101 ada/2026-01-05-10-12-33/controller.py   VPL of Moodle, a folder for each time of handing in
submission_12345/controller.py, submission_metadata.yml  Gradescope
Abgaben/Lovelace_Ada_ada_123/controller.py               ILIAS
ps1-submissions/ps1-ada/controller.py                    GitHub Classroom
ada/controller.py, ada.py                                a folder, or a file, of each student
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any

from rds.grading.intake.attempts import dashed_time, is_dated
from rds.grading.intake.gradescope import METADATA, Submitter, read_metadata
from rds.grading.intake.items import Item
from rds.grading.intake.names import shown
from rds.grading.intake.nbgrader import STAMP, assignment_in, is_nbgrader
from rds.grading.intake.outer_folders import DRAFTS, ILIAS_FOLDER, is_part, of_classroom, without_root

TIMES = "timestamps.csv"  # of the instructor, at the top
NOT_UNDERSTOOD = "the time at which it was handed in cannot be understood"  # begins a note

_MOODLE = re.compile(r"(?P<name>.+?)_(?P<id>\d+)_assignsubmission_(?:file|onlinetext)(?:_(?P<file>.*))?", re.DOTALL)
# students choose their names there, and files', and Moodle puts the number behind the name: of a folder the last counts
_MOODLE_FOLDER = re.compile(r"(?P<name>.+)_(?P<id>\d+)_assignsubmission_(?:file|onlinetext)_?", re.DOTALL)
_MOODLE_NUMBERS = re.compile(r"_(\d+)(?=_assignsubmission_(?:file|onlinetext)_)")
# the first attempt is Blackboard's: what follows is the file's name, which the student chose
_BLACKBOARD = re.compile(
    r"(?P<before>.+?_(?P<user>[^_]+))_attempt_(?P<time>\d{4}(?:-\d\d){5})(?:_(?P<file>.+)|\.txt)", re.DOTALL
)
# the first number is the user's, the second the assignment's; the hour and minute are written in one
# of a folder, the time ends the name, whatever the student's own name is
_BRIGHTSPACE_FOLDER = re.compile(
    r"(?P<user>\d+)-\d+ - (?P<name>.+?) - (?P<time>(?:(?! - ).)*\d{3,4}(?: ?[AaPp]\.?[Mm]\.?)?)", re.DOTALL
)
_BRIGHTSPACE = re.compile(_BRIGHTSPACE_FOLDER.pattern + r"(?: - (?P<file>.+))?", re.DOTALL)
_BRIGHTSPACE_TIMES = ("%b %d, %Y", "%B %d, %Y", "%d %b, %Y", "%d %B, %Y", "%d %b %Y", "%d %B %Y", "%Y-%m-%d")
_VPL_FOLDER = re.compile(r"(?P<name>.+) (?P<id>\d+) (?P<user>\S*)", re.DOTALL)  # a group has no user
_CANVAS = re.compile(r"(?P<name>[^_]+)_(?P<late>LATE_)?(?P<id>\d+)_(?P<number>\d+)_(?P<file>.+)", re.DOTALL)


@dataclass
class StudentFiles:
    """All files of one student. `source` is what the export says of the student, for the gradebook's sake."""

    student: str
    items: list[Item] = field(default_factory=list)
    source: dict[str, Any] = field(default_factory=dict)
    has_times: bool = False  # whether the items' times are when they were handed in
    stamp: Item | None = None
    notes: list[str] = field(default_factory=list)


@dataclass
class Layout:
    """The files of each student, in the order of the students' names, and what belongs to nobody."""

    name: str
    by_student: list[StudentFiles]
    times: Item | None = None
    ignored: tuple[str, ...] = ()


def sorted_out(
    items: Sequence[Item],
    folders: Sequence[str],
    assignments: Sequence[str],
    zipped: bool,
    accepted: Sequence[str] = (),
    place: str = "",
) -> Layout:
    """The files by student. `assignments` are names by which nbgrader may know the assignment.

    `zipped`: whether they are in an export, whose times are the learning platform's. `accepted`: the names that a
    submission should have. `place` is what the folder, or the zip, is called in which all of them lie. InputError if
    there are several assignments and none has such a name.
    """
    outermost, count = list(folders), len(items)
    items, folders, around = without_root(items, folders, zipped, accepted, _is_one_s_name)
    times = next((item for item in items if item.parts == (TIMES,)), None)
    sorting = _Sorting(zipped, ignored=[DRAFTS] if len(items) < count else [])
    items = [item for item in items if item is not times]
    metadata = next((item for item in items if item.parts == (METADATA,)), None)
    if metadata is not None:
        submitters = read_metadata(metadata)
        for item in items:
            if item is not metadata:
                sorting.gradescope(item, submitters)
        for name in folders:
            sorting.files_of_gradescope(name, submitters)
        return sorting.layout("gradescope", times)
    platform = _platform(items)
    if platform == "moodle":
        for item in items:
            sorting.moodle(item)
        for name in folders:
            sorting.files_of_moodle(name)
        return sorting.layout("moodle", times)
    if platform == "brightspace":
        sorting.brightspace(items, folders)
        return sorting.layout("brightspace", times)
    if _is_vpl(items):
        for item in items:
            sorting.vpl(item)
        for name in folders:
            sorting.files_of_vpl(name)
        return sorting.layout("vpl", times)
    if platform == "canvas":
        for item in items:
            sorting.canvas(item)
        return sorting.layout("canvas", times)
    if platform == "blackboard":
        sorting.blackboard(items)
        for student in folders:
            sorting.files_of(student)
        return sorting.layout("blackboard", times)
    if is_nbgrader(items, assignments):
        name = assignment_in(items, assignments)
        for item in items:
            sorting.nbgrader(item, name)
        for student in folders:
            sorting.files_of(student)
        return sorting.layout("nbgrader", times)
    prefix = of_classroom(folders, around or place)
    for item in items:
        own = replace(item, parts=(item.parts[0].removeprefix(prefix), *item.parts[1:])) if prefix else item
        sorting.plain(own)
    for folder in folders:
        sorting.files_of(folder.removeprefix(prefix))
    sorting.ilias(folders)
    sorting.doubt(folders, is_cut=zipped and len(folders) == 2 and folders != outermost)
    return sorting.layout("folders and files", times)


class _Sorting:
    """The files by student while they are being sorted."""

    def __init__(self, zipped: bool, ignored: list[str]):
        self._zipped = zipped
        self._by_student: dict[str, StudentFiles] = {}
        self._ignored = ignored
        self._files: dict[str, str] = {}  # by student the name of a file that is called like the student
        self._in_folders: set[str] = set()  # students with a folder that holds code

    def layout(self, name: str, times: Item | None) -> Layout:
        for student in self._in_folders & self._files.keys():
            said = f"{self._files[student]} lies beside a folder of the same name, and both are taken for one student's"
            self._by_student[student].notes.append(said)
        by_student = sorted(self._by_student.values(), key=lambda handed: handed.student)
        return Layout(name, by_student, times, tuple(self._ignored))

    def files_of(self, student: str, **source: Any) -> StudentFiles:
        student = shown(student)
        return self._by_student.setdefault(student, StudentFiles(student, source=source))

    def plain(self, item: Item) -> None:
        """A file in a student's folder, or one that is called like its student."""
        if len(item.parts) > 1:
            handed = self.files_of(item.parts[0])
            handed.items.append(replace(item, parts=item.parts[1:]))
            if item.is_code or item.is_archive:
                self._in_folders.add(handed.student)
        elif item.is_code or item.is_archive or item.fault:
            stem = item.name[: item.name.rindex(".")] if item.is_code or item.is_archive else item.name
            handed = self.files_of(stem or item.name)
            handed.items.append(item)
            self._files[handed.student] = shown(item.name)
        else:
            self._ignored.append(shown(item.name))

    def ilias(self, folders: Sequence[str]) -> None:
        """What ILIAS says in the names of its folders: who it is, for the class list and the gradebook."""
        found = {folder: match for folder in folders if (match := ILIAS_FOLDER.fullmatch(folder))}
        if 2 * len(found) > len(folders):
            for folder, match in found.items():
                last, _, first = match["names"].partition("_")
                name = "" if "_" in first else f"{first} {last}"  # else it is not known where the last name ends
                self.files_of(folder).source.update(platform="ilias", name=shown(name), sid=shown(match["login"]))

    def doubt(self, folders: Sequence[str], is_cut: bool) -> None:
        """Tell with whom a folder may be no student, but a part of one's submission."""
        for folder in folders:
            if is_cut or is_part(folder):
                said = "is taken for a student; if the folder is a part of a student's submission, put all of that into"
                self.files_of(folder).notes.append(f"{shown(folder)} {said} one folder with the student's name")

    def _noted(self, item: Item, said: str) -> None:
        """Tell it with the student that a file is called like, if there is one."""
        if item.is_code or item.is_archive:
            self.files_of(item.name[: item.name.rindex(".")]).notes.append(said)

    def nbgrader(self, item: Item, assignment: str) -> None:
        """submitted/<student>/<assignment>/…"""
        if len(item.parts) < 3 or item.parts[1] != assignment:
            if len(item.parts) == 1:
                self._ignored.append(shown(item.name))
            return
        handed = self.files_of(item.parts[0], platform="nbgrader", assignment=shown(assignment))
        handed.source.update(platform="nbgrader", assignment=shown(assignment))
        inner = replace(item, parts=item.parts[2:])
        if inner.parts == (STAMP,):
            handed.stamp = inner
        else:
            handed.items.append(inner)

    def files_of_moodle(self, name: str) -> StudentFiles:
        found = _MOODLE_FOLDER.fullmatch(name) or _MOODLE.fullmatch(name)
        return self.files_of(name) if found is None else self._of_moodle(found)

    def _of_moodle(self, found: re.Match[str]) -> StudentFiles:
        handed = self.files_of(
            f"{found['name']}_{found['id']}", platform="moodle", name=shown(found["name"]), id=found["id"]
        )
        handed.has_times = self._zipped
        return handed

    def moodle(self, item: Item) -> None:
        if len(item.parts) > 1:
            self.files_of_moodle(item.parts[0]).items.append(replace(item, parts=item.parts[1:]))
            return
        found = _MOODLE.fullmatch(item.name)
        if found is None or not found["file"]:
            self.plain(item)
        elif len(numbers := dict.fromkeys(_MOODLE_NUMBERS.findall(item.name))) > 1:
            self.plain(item)
            said = f"its name says several numbers of participants ({', '.join(numbers)}), so it is nobody's in Moodle"
            self._noted(item, said)
        else:
            self._of_moodle(found).items.append(replace(item, parts=(found["file"],)))

    def canvas(self, item: Item) -> None:
        found = _CANVAS.fullmatch(item.name) if len(item.parts) == 1 else None
        if found is None:
            self.plain(item)
            return
        handed = self.files_of(
            f"{found['name']}_{found['id']}", platform="canvas", name=shown(found["name"]), id=found["id"]
        )
        if found["late"] and not handed.notes:
            handed.notes.append(f"Canvas marks it as late, and not by how much; {TIMES} beside the files can say when")
        handed.items.append(replace(item, parts=(found["file"],)))

    def blackboard(self, items: Sequence[Item]) -> None:
        """The files of all attempts; what is written in text (`.txt` right behind the time) is nobody's file."""
        found = [_BLACKBOARD.fullmatch(item.name) if len(item.parts) == 1 else None for item in items]
        users: dict[str, set[str]] = {}
        for match in found:
            if match is not None:
                users.setdefault(match["user"], set()).add(match["before"])
        befores = sorted(set().union(*users.values()))
        # what all names begin with is the assignment's title; a user's name may hold a `_` as well
        begins = [befores[0][:at] for at in range(len(befores[0]), 0, -1)] if len(befores) > 1 else []
        fits = (each for each in begins if each.endswith("_") and all(name.startswith(each) for name in befores))
        title = next(fits, "")
        for item, match in zip(items, found, strict=True):
            if match is None:
                self.plain(item)
                continue
            user = match["before"].removeprefix(title) if title else match["user"]
            if not title and len(users[user]) > 1:  # names with _ in them end alike
                user = match["before"]
            handed = self.files_of(user, platform="blackboard")
            handed.has_times = True
            if match["file"]:
                when = dashed_time(match["time"])
                handed.items.append(replace(item, parts=(match["file"],), time=when, attempt=match["time"]))

    def brightspace(self, items: Sequence[Item], folders: Sequence[str]) -> None:
        """A folder, or a file, for each attempt; who has one name and two numbers is told so."""
        numbers: dict[str, set[str]] = {}
        in_folders = frozenset(folders)
        for name in [*folders, *(item.name for item in items if len(item.parts) == 1)]:
            if found := (_BRIGHTSPACE_FOLDER if name in in_folders else _BRIGHTSPACE).fullmatch(name):
                numbers.setdefault(found["name"], set()).add(found["user"])

        def of(found: re.Match[str]) -> StudentFiles:
            name, number = found["name"], found["user"]
            handed = self.files_of(f"{name}_{number}", platform="brightspace", name=shown(name), user=number)
            handed.has_times = True
            others = ", ".join(sorted(numbers.get(name, set()) - {number}))
            said = f"somebody with another number ({others}) has the same name"
            if others and said not in handed.notes:
                handed.notes.append(said)
            return handed

        for item in items:
            is_alone = len(item.parts) == 1
            found = (_BRIGHTSPACE if is_alone else _BRIGHTSPACE_FOLDER).fullmatch(item.parts[0])
            if found is None or (is_alone and not found["file"]):
                self.plain(item)
                continue
            parts = (found["file"],) if is_alone else item.parts[1:]
            when, handed = _brightspace_time(found["time"]), of(found)
            said = f"{NOT_UNDERSTOOD} ({shown(found['time'])!r}), and so is taken for nothing"
            if when is None and said not in handed.notes:
                handed.notes.append(said)
            handed.items.append(replace(item, parts=parts, time=when, attempt=found["time"]))
        for folder in folders:
            found = _BRIGHTSPACE_FOLDER.fullmatch(folder)
            if found:
                of(found)
            else:
                self.files_of(folder)

    def files_of_vpl(self, folder: str) -> StudentFiles:
        found = _VPL_FOLDER.fullmatch(folder)
        if found is None:
            return self.files_of(folder)
        name, number = found["name"], found["id"]
        return self.files_of(found["user"] or f"{name}_{number}", platform="vpl", name=shown(name), user=number)

    def vpl(self, item: Item) -> None:
        """<student>/<time>/…; beside each of these, <time>.ceg holds what VPL said of it."""
        if len(item.parts) == 1:
            self.plain(item)
            return
        folder, inner = self.files_of_vpl(item.parts[0]), item.parts[1]
        if len(item.parts) > 2 and is_dated(inner.removesuffix(".ceg")):
            if inner.endswith(".ceg"):
                return
            folder.has_times = True
            folder.items.append(replace(item, parts=item.parts[2:], time=dashed_time(inner), attempt=inner))
        else:
            folder.items.append(replace(item, parts=item.parts[1:], time=None))

    def files_of_gradescope(self, folder: str, submitters: dict[str, Submitter]) -> StudentFiles:
        who = submitters.get(folder)
        if who is None:
            return self.files_of(folder)
        handed = self.files_of(who.student, platform="gradescope", **who.source)
        if who.note and who.note not in handed.notes:
            handed.notes.append(who.note)
        return handed

    def gradescope(self, item: Item, submitters: dict[str, Submitter]) -> None:
        if len(item.parts) == 1:
            self.plain(item)
            return
        who = submitters.get(item.parts[0])
        handed = self.files_of_gradescope(item.parts[0], submitters)
        handed.has_times |= who is not None
        when = None if who is None else who.time
        handed.items.append(replace(item, parts=item.parts[1:], time=when, attempt=item.parts[0]))


def _brightspace_time(said: str) -> datetime | None:
    """As in "Jan 5, 2026 1012 AM" or "5 January, 2026 942 PM"; None for what is written otherwise."""
    day, _, rest = re.sub(r" ?([AaPp])\.?[Mm]\.?$", r"_\1M", said).rpartition(" ")
    clock, _, half = rest.partition("_")
    for form in _BRIGHTSPACE_TIMES:
        try:
            return datetime.strptime(f"{day} {clock:0>4}{half}", f"{form} {'%I%M%p' if half else '%H%M'}")
        except ValueError:
            pass
    return None


def _is_one_s_name(folder: str) -> bool:
    """Whether Moodle or Brightspace calls the folder of a student so."""
    return any(each.fullmatch(folder) for each in (_MOODLE_FOLDER, _BRIGHTSPACE))


def _platform(items: Sequence[Item]) -> str:
    """The platform whose kind of name most files have that may be submissions; empty unless more than half have it.

    A student chooses how a file's name ends, and may make it fit another platform; so what fits the most files counts.
    Of two that fit as many, as in a class of one, the one that leaves the student more of the names.
    """
    counted = [item for item in items if item.is_code or item.is_archive]
    flat = [item.name for item in counted if len(item.parts) == 1]
    firsts = [item.parts[0] for item in counted]
    forms = {
        "moodle": (_MOODLE, firsts),
        "brightspace": (_BRIGHTSPACE, firsts),
        "canvas": (_CANVAS, flat),
        "blackboard": (_BLACKBOARD, flat),
    }
    fits = {of: [found for name in names if (found := form.fullmatch(name))] for of, (form, names) in forms.items()}
    best = max(fits, key=lambda of: (len(fits[of]), sum(len(found["file"] or "") for found in fits[of])))
    return best if 2 * len(fits[best]) > len(counted) else ""


def _is_vpl(items: Sequence[Item]) -> bool:
    """Whether all that more than half of the students handed in lies in folders called by times."""
    students = {item.parts[0] for item in items if item.is_handed_in}
    others = {item.parts[0] for item in items if item.is_handed_in and not (item.parts[2:] and is_dated(item.parts[1]))}
    return 2 * len(others) < len(students)
