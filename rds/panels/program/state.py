"""Part programs in a session: what is edited, looked at as one types, and run. Without widgets."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rds.core.errors import InputError, RdsError
from rds.core.shared_quantities import FEED_OVERRIDE
from rds.machines import load_machine
from rds.nc.bundled import bundled
from rds.nc.language.tool_library import is_library
from rds.nc.run.run import usual_controller
from rds.panels.equipment.build import Builds
from rds.panels.interpolator.fields import USER
from rds.panels.interpolator.motion import OWN, PLANNED, filter_of, idle_motion, motion_fields
from rds.panels.program.starter import starter
from rds.panels.program.text import ProgramText, check_name, programs
from rds.panels.session.choices import Choices
from rds.panels.session.fields import Choice, Field, Flag, Number, Text, mode_choice
from rds.panels.session.latest import Latest
from rds.panels.session.session import Session
from rds.panels.session.task import Task

if TYPE_CHECKING:
    from rds.nc.setup import Setup
    from rds.panels.program.check import CheckState
    from rds.panels.program.run import ProgramWork

PANEL = "program"  # its name among the session's choices
FIRST = "part.ngc"  # what is open in a folder without programs
NO_TABLE = ""
OPTIONS = {  # of the dialect: label and tooltip
    "block_delete": ("Leave out / blocks", "whether blocks that begin with / are left out"),
    "program_numbers": ("Program numbers", "the first block may be P001 or O001, and ; ends a block"),
    "default_feed": ("Default feed", "moves before the first word F have the machine's default feed"),
    "open_end": ("Open end", "the program may end with its last line, without M2 or M30"),
}


def program_choices(session: Session) -> Choices:
    """The choices about part programs: which is open, and how it is read and run."""
    return session.choices(PANEL, _fields(session.folder, usual_controller(load_machine(session.machine))))


def _fields(folder: Path, controller: str) -> Iterable[Field]:
    found = programs(folder)
    yield Text("file", "Program", "the part program that is open", found[0] if found else FIRST, FIRST, 120, check_name)
    yield mode_choice("controller")
    yield _table_field(folder)
    yield _offsets_field(folder)
    tip = (
        "X Y Z of its lower and of its upper corner, machine coordinates of the tool's tip; empty: as the cut needs it"
    )
    yield Text("stock", "Stock [mm]", tip, "", "e.g. -5 -5 -6 45 35 0", 120, check_stock)
    yield _part_field(folder)
    yield Text(
        "controller",
        "Controller of the axes",
        "a name (tracking, feedforward, cascade, p, pid, modified-pid), or a Python file of yours; the spindle has PID",
        controller,
        "tracking or my_controller.py",
        120,
    )
    tip = "the file's control() gets and returns arrays, one value for each axis: contour control"
    yield Flag("coupled", "One controller for all axes", tip, False)
    tip = "of the programmed feed, for a run's start and while it runs; rapids only get slower"
    yield Number.of(FEED_OVERRIDE, "override", "Feed override", tooltip=tip)
    yield from motion_fields()
    tip = "come to rest after each line, and wait for Resume; a run with it takes longer"
    yield Flag("single_step", "Single step", tip, False)
    yield Flag("optional_stop", "Stop at M1", "whether M1 waits for Resume", True)
    for name, (label, tip) in OPTIONS.items():
        yield Flag(name, label, tip, False)


def check_stock(text: str) -> None:
    """InputError unless it is empty, or a block's corners."""
    if text.strip():
        from rds.panels.program.stock import block_of

        block_of(text)


def _table_field(folder: Path) -> Choice:
    tip = (
        "a .tbl file of your folder, as LinuxCNC keeps it, lengths in mm; or a tool library (.toml), with the shapes "
        "of the tools"
    )
    libraries = {name: name for name in _files(folder, ".toml") if name and is_library(folder / name)}
    return Choice("tools", "Tool table", tip, NO_TABLE, _files(folder, ".tbl") | libraries)


def _offsets_field(folder: Path) -> Choice:
    tip = "a .var file of your folder, as LinuxCNC keeps it: where the origins of G54 to G59.3 are"
    return Choice("parameters", "Parameter file", tip, NO_TABLE, _files(folder, ".var"))


def _part_field(folder: Path) -> Choice:
    tip = "what the finished part is compared with: an STL model, or the heights of another cut (.npz), of your folder"
    return Choice("part", "Intended part", tip, NO_TABLE, _files(folder, ".stl", ".npz") | {NO_TABLE: "as programmed"})


def _files(folder: Path, *suffixes: str) -> dict[str, str]:
    try:
        found = sorted(each.name for each in folder.iterdir() if each.suffix.lower() in suffixes and each.is_file())
    except OSError:
        found = []
    return {NO_TABLE: "none"} | {name: name for name in found}


class Program:
    """The program that is open. `latest` is what the last look found; `tick()` goes on with looking."""

    def __init__(self, session: Session):
        self.session = session
        self.machine = load_machine(session.machine)
        self.choices = program_choices(session)
        self.builds = Builds()
        self.latest: CheckState | None = None
        self._looks = Latest(self._begin)
        self._early: CheckState | None = None  # what is known while the motion is being planned
        self.trouble = ""  # why the file that was chosen is not open
        self.text = self._opened()
        self.choices.watch(self._chosen)

    def _opened(self) -> ProgramText:
        """The file that was open, else the first one: what cannot be edited does not keep the panel away."""
        name = str(self.choices["file"])
        try:
            return self._file(name)
        except InputError as error:
            self.trouble = str(error)
        number = 1
        while (self.session.folder / f"new-{number}.ngc").exists():
            number += 1
        return self._file(f"new-{number}.ngc")

    def _file(self, name: str) -> ProgramText:
        return ProgramText(self.session.folder, name, starter(self.machine))

    def _chosen(self, name: str) -> None:
        if name == "file" and self.choices["file"] != self.text.name:
            try:
                self.text = self._file(str(self.choices["file"]))
                self.trouble = ""
            except InputError as error:
                self.trouble = str(error)
                self.choices.set("file", self.text.name)
        if name in ("file", "tools", "parameters", "stock", "part", *OPTIONS):
            self.look_again()

    # the text

    def programs(self) -> list[str]:
        """The part programs of the folder, and the one that is open."""
        return sorted({*programs(self.session.folder), self.text.name})

    def bundled(self) -> list[str]:
        """The bundled programs for this machine that the folder has no file of the name of."""
        here = set(self.programs())
        return [
            name
            for name, each in bundled().items()
            if name not in here and each.machine in ("mini-cnc", self.machine.name)
        ]

    def open(self, name: str) -> None:
        """Open another one; InputError where that will not do. What is not saved of this one stays as a draft."""
        check_name(name)
        self.trouble = ""
        if name == self.text.name:
            self.text = self._file(name)
            self.look_again()
            return
        self.choices.set("file", name)
        if self.trouble:
            raise InputError(self.trouble)

    def edit(self, text: str) -> None:
        """What was typed; looked at again by `tick()`."""
        if text != self.text.text:
            try:
                self.text.edit(text)
            finally:  # it is in the editor, also where no draft of it can be written
                self.look_again()

    def save(self) -> None:
        """Write the file; InputError where it was changed by somebody else, or cannot be written."""
        self.text.save()
        if self.looking:  # the draft that is being read has gone
            self.look_again()

    def discard(self) -> None:
        """Give up what is not saved."""
        self.text.discard()
        self.look_again()

    def save_as(self, name: str) -> None:
        """Save under another name, which is open then; InputError if there is such a file."""
        other = self.text.save_as(name.strip())
        self.text.draft.unlink(missing_ok=True)
        self.choices.set("file", other.name)

    def follow_disk(self) -> bool:
        """Read the file again where somebody else wrote it and nothing here is unsaved; whether that was so.

        The text of a file that was removed stays.
        """
        if self.text.changed or not self.text.replaced:
            return False
        if not self.text.path.exists():
            with contextlib.suppress(InputError):  # a folder that has gone as well
                self.text.lost()
            self.session.say(f"{self.text.name} was removed by somebody else; Save writes it again", "warning")
            self.look_again()
            return True
        try:
            self.text = self._file(self.text.name)
        except InputError as error:
            self.text.accept()
            self.session.say(f"{self.text.name} was replaced by what cannot be edited here: {error}", "warning")
            return False
        self.look_again()
        return True

    # looking at it

    def look_again(self) -> None:
        """Text or setting has changed: what was found does not hold any more."""
        self._looks.again()
        self._early = None

    @property
    def looking(self) -> bool:
        """Whether `latest` is not yet of the text as it is."""
        return self._looks.going_on

    def tick(self) -> CheckState | None:
        """Ten times a second: begin to look where something has changed; what was found, once, when it is there."""
        task = self._looks.tick()
        if task is None:
            found, self._early = self._early, None
            self.latest = found or self.latest
            return found
        self._early = None
        if task.error is not None:  # what was found before is of another text
            from rds.panels.program.check import CheckState, Mark

            self.latest = CheckState((Mark(0, 0, 0, f"the check failed: {task.error}"),))
        else:
            self.latest = task.result
        return self.latest

    def _begin(self) -> Task[CheckState]:
        text, setup, machine = self.text, self.setup(), self.machine
        stock, part = self._named("stock"), self._named("part")

        def work(task: Task[CheckState]) -> CheckState:
            from rds.panels.program.check import look

            def early(found: CheckState) -> None:
                if not task.stopping:
                    self._early = found

            path = self.session.folder / part if part else None
            return look(task, text.on_disk(), text.name, machine, setup, early, stock, path)

        return self.session.work(f"check {text.name}", work)

    def setup(self) -> Setup:
        """What the program is read with."""
        from rds.nc.language.dialect import Dialect
        from rds.nc.setup import Setup

        folder = self.session.folder
        tools, parameters = (folder / name if name else None for name in map(self._named, ("tools", "parameters")))
        return Setup(tools, parameters, Dialect(**{name: bool(self.choices[name]) for name in OPTIONS}))

    def _named(self, name: str) -> str:
        return str(self.choices[name])

    def refresh(self) -> None:
        """Look for tool tables, parameter files and parts that have come or gone."""
        folder = self.session.folder
        found = (_table_field(folder), _offsets_field(folder), _part_field(folder))
        self.choices.replace([each for each in found if each != self.choices.fields[each.name]])

    # running it

    def run(self, begin: int = 0) -> ProgramWork:
        """The run of the program, saved first, to be started, from line `begin` on (0: all of it).

        InputError with the reason where it cannot run.
        """
        if self.latest is not None and not self.looking and not self.latest.ok:
            raise InputError(f"it cannot run yet: {self.latest.sentence}")
        if self.text.changed:
            self.save()
        return self.work_of(self.text.path, begin)

    def work_of(self, file: Path, begin: int) -> ProgramWork:
        """The run of a program as the choices say, to be started."""
        from rds.panels.program.run import ProgramWork

        share = float(self.choices["override"]) / 100.0
        if share == 0.0:
            raise InputError("an override of 0 % never moves; begin with more, and hold while it runs")
        controller, files = self._controller()
        motion, own = self._motion()
        files += own
        if self.session.bus:
            raise InputError(
                "this page has a bus of its own, which programs are not run on here: open a page without [bus] for "
                "it, or run the program by rds nc in a terminal"
            )
        steps = bool(self.choices["single_step"])
        if motion and (begin or steps):
            raise InputError("single step, and a run from a line, go with planned motion; choose it in Settings")
        changes = [(0.0, "override", share)] if share != 1.0 else []
        changes += [] if self.choices["optional_stop"] else [(0.0, "optional_stop", 0.0)]
        T = self.machine.sample_period
        prepare = (lambda pulse: self.builds.require(files, T, pulse)) if files else None
        mode = str(self.choices["mode"])
        motion |= {"begin": begin, "steps": steps} if begin or steps else {}
        return ProgramWork(self.session, file, mode, self.setup(), controller, changes, prepare, motion)

    def _motion(self) -> tuple[dict[str, Any], list[tuple[str, Path]]]:
        """What `PartProgram` is told of an interpolator, and the user's file of it; nothing for planned motion."""
        name, chosen = str(self.choices["interpolator"]), self.choices.values()
        if name == PLANNED:
            return {}, []
        own = []
        if name == USER:
            named = [str(chosen[each]).strip() for each in OWN]
            for text in named if named[1] else named[:1]:  # the second one, of arcs, need not be there
                path = (self.session.folder / text).resolve()
                if not path.is_file():
                    raise InputError(
                        "the interpolator's file is not there; save it in your folder, and name it in Settings"
                    )
                own.append(("interpolator", path))
            name, *arcs = [str(path) for _, path in own]
            both = {"interpolator": name, "arc_interpolator": arcs[0]} if arcs else name
            return {"interpolator": both, **filter_of(chosen)}, own
        return {"interpolator": name, **filter_of(chosen)}, own

    def idle(self) -> set[str]:
        """Choices that say nothing now."""
        return idle_motion(self.choices.values())

    def _controller(self) -> tuple[Any, list[tuple[str, Path]]]:
        name = str(self.choices["controller"]).strip() or usual_controller(self.machine)
        if not name.endswith(".py"):
            if self.choices["coupled"]:
                raise InputError(f"the controller {name} is for single axes; a coupled one is a Python file of yours")
            from rds.controllers import controller_module

            try:
                controller_module(name)
            except RdsError as error:
                raise InputError(str(error)) from error
            return name, []
        path = (self.session.folder / name).resolve()
        if not path.is_file():
            raise InputError(f"there is no file {name} in your folder; save your controller there, or name another")
        if self.choices["coupled"]:  # its check needs the axes; the run tells its faults with their lines
            return {"file": str(path), "coupled": True}, []
        return str(path), [("controller", path)]
