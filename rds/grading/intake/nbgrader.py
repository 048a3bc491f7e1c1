"""nbgrader's folders, <student>/<assignment>/…: whether there are such, and which assignment is meant."""

from __future__ import annotations

from collections.abc import Sequence

from rds.core.errors import InputError
from rds.grading.intake.items import Item
from rds.grading.intake.names import shown

STAMP = "timestamp.txt"  # beside a submission


def is_nbgrader(items: Sequence[Item], assignments: Sequence[str]) -> bool:
    """Whether more than half of the students' folders look so: what one of them holds is for its author alone.

    One with code beside its folders does not, but for nbgrader's stamp in them: there each assignment has its folder.
    """
    deep = [item for item in items if len(item.parts) >= 3]
    stamped = {item.parts[0] for item in deep if item.parts[2] == STAMP}
    marked = stamped | {item.parts[0] for item in deep if item.parts[1] in assignments}
    names = _of_several(items)
    fits = marked | {item.parts[0] for item in deep if item.parts[1] in names}
    fits -= {item.parts[0] for item in items if len(item.parts) == 2 and item.is_code} - stamped
    return bool(marked & fits) and 2 * len(fits) > len({item.parts[0] for item in items if len(item.parts) > 1})


def assignment_in(items: Sequence[Item], assignments: Sequence[str]) -> str:
    """The name of the assignment's folders: one of `assignments`, else the only one. InputError for several."""
    all_names = {item.parts[1] for item in items if len(item.parts) >= 3}
    for name in assignments:
        if name in all_names:
            return name
    names = sorted(_of_several(items) or all_names)
    if len(names) == 1:
        return names[0]
    raise InputError(
        f"the submissions are of several assignments ({', '.join(map(shown, names[:8]))}); give the folder of the "
        "assignment the name of one of them"
    )


def _of_several(items: Sequence[Item]) -> set[str]:
    """The names of folders inside students' folders that more than one student has: the course's assignments."""
    holders: dict[str, set[str]] = {}
    for item in items:
        if len(item.parts) >= 3:
            holders.setdefault(item.parts[1], set()).add(item.parts[0])
    return {name for name, students in holders.items() if len(students) > 1}
