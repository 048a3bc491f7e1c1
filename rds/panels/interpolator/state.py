"""Interpolator: a path, the methods that take it, and the samples that come out.

Samples and numbers are those of `rds.interpolators.path.interpolate` and of `rds interpolate`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rds.core.errors import InputError
from rds.core.types import ArcSegment, Segment
from rds.interpolators.segment_rows import FEED_UNITS, read_segments, segments_of
from rds.machines import load_machine
from rds.nc.bundled import PATH, find_bundled
from rds.panels.code.versions import keep_file
from rds.panels.equipment.build import Builds, Checked
from rds.panels.interpolator.fields import (
    ARC,
    BUNDLED,
    DEFAULT_PROGRAMS,
    LINE,
    NONE,
    PROGRAM,
    ROWS,
    SINGLE,
    USER,
    feed,
    fields,
    filter_words,
    option_fields,
    read_point,
)
from rds.panels.session.choices import Choices
from rds.panels.session.email import mail_server, send_files
from rds.panels.session.save_as import save_as
from rds.panels.session.session import Session
from rds.panels.session.task import Task

if TYPE_CHECKING:
    from rds.interpolators.acceleration import Acceleration
    from rds.interpolators.interpolator import Interpolator
    from rds.interpolators.result import Interpolation

PANEL = "interpolator"
_EVERY = 500  # rows between two looks at whether it should stop


class Interpolating:
    """The choices of the panel, and what they make."""

    def __init__(self, session: Session):
        self.session = session
        self.choices: Choices = session.choices(PANEL, fields())
        self.builds = Builds()
        self.notes: list[str] = []
        self._saved: tuple[Interpolation, Path] | None = None  # what was saved last, and where
        self._unit = self.choices["feed_unit"]
        if self._unit != "mm/min":
            self.choices.replace([feed(self._unit, self.choices["feed"])])
        self._fit_options()
        self.choices.watch(self._chosen)

    @property
    def roles(self) -> list[str]:
        """What is interpolated: lines, arcs, or both."""
        return {"linear": [LINE], "circular": [ARC], "both": [LINE, ARC]}[self.choices["kind"]]

    @property
    def shown(self) -> list[str]:
        """The names of the choices that matter for what is chosen, in order."""
        chosen, roles = self.choices, self.roles
        idle = set()
        if chosen["given"] != SINGLE:
            idle |= {"segment", "end", "centre", "direction", "plane"}
        elif self._single() == LINE:
            idle |= {"centre", "direction", "plane"}
        if len(roles) < 2:
            idle.add("segment")
        idle |= {"rows"} if chosen["given"] != "several" else set()
        idle |= {"start", "feed", "feed_unit"} if chosen["given"] in (BUNDLED, PROGRAM) else set()
        idle |= {name for name in (BUNDLED, PROGRAM) if name != chosen["given"]}
        for role in (LINE, ARC):
            if role not in roles:
                idle |= {name for name in chosen.fields if name.startswith((f"{role}_", f"{role}."))}
            elif chosen[f"{role}_method"] != USER:
                idle.add(f"{role}_file")
        if chosen["acceleration"] == NONE:
            idle |= {"acceleration_time", "exact_stop"}
        return [name for name in chosen.fields if name not in idle]

    def files(self) -> list[Path]:
        """The user's own interpolators that are chosen; InputError where one is not named."""
        found = []
        for role in self.roles:
            if self.choices[f"{role}_method"] == USER:
                name = str(self.choices[f"{role}_file"]).strip()
                if not name:
                    raise InputError(f"name the file of your interpolator for {role}s (in {self.session.folder})")
                found.append(self.session.folder / name)
        return list(dict.fromkeys(found))

    def segments(self) -> list[Segment]:
        """The path, where it is not a part program. InputError for one that will not do."""
        chosen = self.choices
        start = read_point(chosen["start"])
        rows = [self._row()] if chosen["given"] == SINGLE else chosen["rows"]
        made = segments_of(start, rows, chosen["feed"], chosen["feed_unit"])
        self._check_kinds(made)
        return made

    def check(self) -> Task[list[Checked]]:
        """Begin to check the user's files, in a process of their own."""
        files, T = self.files(), self.choices["period"]
        return self.session.work(
            "check", lambda task: [self.builds.check("interpolator", path, T, task.pulse) for path in files]
        )

    def run(self) -> Task[Interpolation]:
        """Begin to interpolate. InputError for what can be seen to be wrong at once."""
        files, T = self.files(), self.choices["period"]
        program = self._program_path() if self.choices["given"] in (BUNDLED, PROGRAM) else None
        segments = [] if program is not None else self.segments()
        acceleration, chosen = self._acceleration(), self.choices.values()
        machine = self.session.machine
        if chosen["given"] == BUNDLED:  # its axes, travels and speeds are those of the machine that it was made for
            machine = find_bundled(chosen["bundled"]).machine
        for file in files:
            keep_file(file, f"interpolated with a feed of {chosen['feed']:g} {chosen['feed_unit']}")

        def work(task: Task[Interpolation]) -> Interpolation:
            from rds.interpolators.path import interpolate

            self.notes = []
            rests: dict[int, float] = {}
            path = segments
            if files:
                task.note = "checking your file"
                found = self.builds.require([("interpolator", file) for file in files], T, task.pulse)
                self.notes += [f"{each.path.name}: {mark.text}" for each in found for mark in each.marks]  # warnings
            if program is not None and program.suffix == PATH:
                path = read_segments(program)
                self._check_kinds(path)
            elif program is not None:
                task.note = "reading the program"
                path, rests, notes = read_program(program, machine, T)
                self.notes += notes
                self._check_kinds(path)
            task.note = "interpolating"
            methods = {role: stoppable(self._interpolator(role, chosen), task) for role in self.roles}
            lines, arcs = methods.get(LINE), methods.get(ARC)
            exact = acceleration is not None and chosen["exact_stop"]
            return interpolate(
                path, T, acceleration=acceleration, exact_stop=exact, rests=rests, lines=lines, arcs=arcs
            )

        return self.session.work("interpolate", work, own_code=bool(files))

    def save(self, done: Interpolation) -> Path:
        """Save the samples under the name that is chosen; InputError where there is such a file already."""
        path = save_as(done.result(), self.session.folder, self.choices["file"])
        self._saved = done, path
        return path

    def send(self, done: Interpolation) -> Task[str]:
        """Begin to send the samples by e-mail: the file they were saved as, or are saved as now.

        InputError where that will not do, where nobody is named, and where no mail server is set up.
        """
        to = str(self.choices["send_to"])
        if not to.strip():
            raise InputError("say whom to send it to, as in name@example.edu")
        server = mail_server(self.session.folder)
        saved = self._saved is not None and self._saved[0] is done and self._saved[1].is_file()
        path = self._saved[1] if saved and self._saved is not None else self.save(done)
        text = f"{done!r}, sent from RDS.\n"

        def work(task: Task[str]) -> str:
            task.note = "sending"
            return send_files(server, to, f"RDS: {path.stem}", text, [path], lambda: task.stopping)

        return self.session.work("sending", work)

    def _single(self) -> str:
        return str(self.choices["segment"]) if len(self.roles) == 2 else self.roles[0]

    def _row(self) -> dict[str, Any]:
        chosen = self.choices
        row: dict[str, Any] = {"kind": self._single(), "end": read_point(chosen["end"])}
        if row["kind"] == LINE:
            return row
        return row | {
            "centre": read_point(chosen["centre"]),
            "clockwise": chosen["direction"] == "cw",
            "plane": chosen["plane"],
        }

    def _check_kinds(self, segments: list[Segment]) -> None:
        for number, segment in enumerate(segments, start=1):
            kind = ARC if isinstance(segment, ArcSegment) else LINE
            if kind not in self.roles:
                is_a = "an arc" if kind == ARC else "a line"
                raise InputError(
                    f"segment {number} is {is_a}, and interpolation is {self.choices['kind']}; choose both"
                )

    def _interpolator(self, role: str, chosen: Mapping[str, Any]) -> Interpolator:
        from rds.interpolators.interpolator import find_interpolator

        if chosen[f"{role}_method"] == USER:
            return find_interpolator(str(self.session.folder / str(chosen[f"{role}_file"]).strip()))
        options = {name.partition(".")[2]: value for name, value in chosen.items() if name.startswith(f"{role}.")}
        return find_interpolator(chosen[f"{role}_method"], options)

    def _acceleration(self) -> Acceleration | None:
        from rds.interpolators.acceleration import make_acceleration

        words = filter_words(self.choices.values())
        return None if words is None else make_acceleration(**words)

    def _program_path(self) -> Path:
        if self.choices["given"] == BUNDLED:
            return find_bundled(self.choices["bundled"]).path
        name = str(self.choices["program"]).strip()
        if not name:
            raise InputError(f"name the part program (in {self.session.folder}); the Program panel writes one")
        path = self.session.folder / name
        if not path.is_file():
            raise InputError(
                f"there is no part program {name!r} in {self.session.folder}; save it there, or name another"
            )
        return path

    def _chosen(self, name: str) -> None:
        if name == "feed_unit" and self._unit != self.choices["feed_unit"]:
            unit = self.choices["feed_unit"]
            before, self._unit = FEED_UNITS[self._unit], unit

            def same(value: float) -> float:
                """The same speed in the other unit."""
                return float(f"{value * before / FEED_UNITS[unit]:.10g}")

            rows = [row | {"feed": same(row["feed"])} if row.get("feed") else row for row in self.choices["rows"]]
            self.choices.replace([feed(unit, same(self.choices["feed"]))])
            self.choices.set("rows", rows)
        if name in ("line_method", "arc_method"):
            self._fit_options()
        if name == "kind" and self.choices["bundled"] in DEFAULT_PROGRAMS.values():
            self.choices.set("bundled", DEFAULT_PROGRAMS[self.choices["kind"]])
        if name == "kind" and self.choices["rows"] in ROWS.values():
            self.choices.set("rows", [dict(row) for row in ROWS[self.choices["kind"]]])

    def _fit_options(self) -> None:
        """The options of the chosen methods."""
        wanted = {
            each.name: each for role in (LINE, ARC) for each in option_fields(role, self.choices[f"{role}_method"])
        }
        own = (f"{LINE}.", f"{ARC}.")
        self.choices.remove([name for name in self.choices.fields if name.startswith(own) and name not in wanted])
        self.choices.replace(each for name, each in wanted.items() if self.choices.fields.get(name) != each)


def stoppable(interpolator: Interpolator, task: Task[Any]) -> Interpolator:
    """The same, which ends by Stopped when the task is asked to."""

    def watched(function: Any) -> Any:
        def rows(segment: Segment, T: float, params: Mapping[str, Any]) -> Iterator[Any]:
            for k, row in enumerate(function(segment, T, params)):
                if k % _EVERY == 0:
                    task.advance(0.0, 0.0)
                yield row

        return rows

    theory = None if interpolator.theory is None else watched(interpolator.theory)
    return replace(interpolator, function=watched(interpolator.function), theory=theory)


def read_program(path: Path, machine: str, T: float) -> tuple[list[Segment], dict[int, float], list[str]]:
    """A part program's segments, rests and notes. ProgramError at its first fault, with line and word."""
    from rds.nc.check import motion
    from rds.nc.interpolator_segments import MOST, program
    from rds.nc.setup import Setup

    loaded = load_machine(machine)
    found = program(motion(path, loaded, Setup()), loaded, T, MOST)
    return found.segments, found.rests, found.notes
