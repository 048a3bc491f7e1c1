"""Objects in a session: their numbers, the path that comes of them, its part program. Without widgets."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rds.core.errors import InputError
from rds.nc.paths.objects import OBJECTS
from rds.panels.objects.forms import FORMS, fields, form_fields, given
from rds.panels.program.made import MadePrograms
from rds.panels.session.latest import Latest
from rds.panels.session.session import Session
from rds.panels.session.task import Task

if TYPE_CHECKING:
    from rds.core.types import Segment

PANEL = "objects"
OF_ALL = ("feed", "safe", "spindle", "blend", "decimals")  # fields of every program
_LOOK = 20  # ticks
_OFFERED = re.compile(rf"({'|'.join(FORMS)})(-\d+)?\.ngc")
_CALLED = {"safe height": "safe", "spindle speed": "spindle", "feed rate": "feed"}  # fields as messages name them


@dataclass(frozen=True)
class MadeObject:
    """A path, what it is, its part program, and its numbers (lengths in mm, times in s)."""

    segments: Sequence[Segment]
    said: str
    text: str
    summary: dict[str, Any]
    deviation: float

    @property
    def sentence(self) -> str:
        """What came of it, in one line."""
        found = self.summary
        off = f"; at most {self.deviation:.4f} mm off" if self.deviation else ""
        size = ", ".join(f"{axis} {low:.4g} to {high:.4g}" for axis, (low, high) in found["extent_mm"].items())
        return (
            f"lines: {found['lines']}, arcs: {found['arcs']}, {found['length_mm']:.2f} mm, "
            f"{found['cutting_time_s']:.1f} s at the feed{off}; {size} mm"
        )


class Objects:
    """The form that is filled in. `latest` is its path, `refusal` why there is none, `wrong` the field that is meant.

    `tick()` goes on.
    """

    def __init__(self, session: Session):
        self.session = session
        self.choices = session.choices(PANEL, fields(session.folder))
        self.latest: MadeObject | None = None
        self.refusal = self.wrong = ""
        self._made = MadePrograms(session, "form")
        self._makes = Latest(self._begin, self._file)
        self._ticks = 0
        self._offer()
        self.choices.watch(self._changed)

    @property
    def form(self) -> str:
        """Which of FORMS is filled in."""
        return str(self.choices["object"])

    def names(self) -> list[str]:
        """The fields of the form that is filled in."""
        return [each.name for each in form_fields(self.form, self.session.folder)]

    @property
    def waits(self) -> bool:
        """Whether nothing is wrong yet: the file of points is still to be chosen."""
        return self.form == "points" and not self.choices["points_file"]

    def _changed(self, name: str) -> None:
        if name == "object":
            self.refresh()
            self._offer()
        if name != "program":
            self._makes.again()

    def _offer(self) -> None:
        """A free name, unless the user has given one."""
        if _OFFERED.fullmatch(str(self.choices["program"])):
            self.choices.set("program", self._made.offered(self.form))

    def refresh(self) -> None:
        """Look for files of points that have come or gone."""
        found = next(each for each in form_fields("points", self.session.folder) if each.name == "points_file")
        if found != self.choices.fields[found.name]:
            self.choices.replace([found])

    @property
    def going_on(self) -> bool:
        """Whether `latest` is not yet of what is filled in."""
        return self._makes.going_on

    def tick(self) -> bool:
        """Ten times a second: begin where something has changed; true when there is something new to show."""
        self._ticks += 1
        if self.form == "points" and self._ticks % _LOOK == 0:
            self.refresh()
        task = self._makes.tick()
        if task is None:
            return False
        self.latest, self.refusal, self.wrong = task.result, "", ""
        if (error := task.error) is not None:
            said = str(error).replace(f"{self.session.folder}/", "")
            self.refusal = said if isinstance(error, InputError) else f"making it failed: {said}"
            self.wrong = self._named_in(said)
        return True

    def _named_in(self, message: str) -> str:
        """The field that a message names; empty if it names none of this form."""
        called = {_words(name, self.form): name for name in self.names()} | _CALLED
        called |= {name: name for name in OF_ALL}
        for words in sorted(called, key=len, reverse=True):
            if re.search(rf"(^|: |of ){words}( = | '| and )", message):
                return called[words]
        return ""

    def _file(self) -> Path | None:
        name = str(self.choices["points_file"]) if self.form == "points" else ""
        return self.session.folder / name if name else None

    def _begin(self) -> Task[MadeObject]:
        values, folder = self.choices.values(), self.session.folder
        return self.session.work("make an object", lambda task: made(values, folder))

    def write(self) -> tuple[str, bool]:
        """Write the part program, and open it in the program panel; its name, and whether it replaces one made before.

        InputError where there is no path, or a file of that name that was not written from here.
        """
        if self.refusal or self.latest is None or self.going_on:
            raise InputError(self.refusal or "the path is not made yet; wait a moment")
        name = str(self.choices["program"])
        return name, self._made.write(name, self.latest.text)


def _words(name: str, form: str) -> str:
    return name.removeprefix(f"{form}_").replace("_", " ")


def made(values: dict[str, Any], folder: Path) -> MadeObject:
    """The path of what is filled in, and its part program; InputError as `rds nc make` has it."""
    from rds.nc.paths.measure import summary
    from rds.nc.paths.program import part_program

    name = str(values["object"])
    path = OBJECTS[FORMS[name].kind](**given(name, values, folder))
    text = part_program(
        path.segments,
        path.title,
        safe_height=values["safe"],
        spindle=values["spindle"],
        blend=values["blend"],
        decimals=int(values["decimals"]),
    )
    return MadeObject(path.segments, path.said, text, summary(path.segments), path.more.get("deviation_mm") or 0.0)
