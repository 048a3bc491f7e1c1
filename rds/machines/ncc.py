"""The configuration script of mrm-control, section 5 (NCC): links, limits and assembly errors in words beside G-code.

    N001 RF01 LN1 XA0 YA90 ZA0 X-80 Y0 Z75    a link: angles about x, y, z in degrees, offsets in mm
    N003 RF01 LN3 XA0 YA0 ZA# X0 Y0 Z-140     # marks the joint variable
    N004 RF02 LN3 UP180 LW-180                limits of a joint
    N006 RF03 LN1 XA0 YA0 ZA0 X0 Y0 Z-5       assembly error, added to the link's numbers
    N008 BUILD

LN1 holds the tool, the last link the work: T = Mn ... M2 M1. A script without RF01 changes limits and errors of a
machine that is there, whose links `script_of_machine` numbers.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import count
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.toml_table import TomlTable
from rds.core.toml_text import toml_text
from rds.machines.kinematics.kinematics import Kinematics
from rds.machines.kinematics.transform import numbers_of, transformation
from rds.machines.link_table import BED, ENTRIES, ROTARY, ChainEnd, Link
from rds.machines.machine import MACHINE, VOLTAGE_RANGE, Machine, machine_from
from rds.machines.mounting import SPEED, axis_table, chosen_motion

_NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)"
_WORD = re.compile(rf"\s*(XA|YA|ZA|X|Y|Z|UP|LW|LN)\s*(#|{_NUMBER})")
_LINE = re.compile(r"\s*(?:N\d+(?:\.\d+)?)?\s*(?:(RF)\s*(\d+)|(BUILD)\b)?")
_COMMENT = re.compile(r"\([^()]*\)|;.*")
_MOTION = re.compile(rf"\s*(?:N\d+(?:\.\d+)?)?\s*[A-Z]\s*{_NUMBER}", re.IGNORECASE)  # a line of a part program
_WANTED = {1: ("LN", *ENTRIES), 2: ("LN", "UP", "LW"), 3: ("LN", *ENTRIES)}
_LETTERS = {"X": "XU", "Y": "YV", "Z": "ZW", "XA": "A", "YA": "B", "ZA": "C"}  # of the axes, as they are taken
_SAYS = "write RF01 (a link), RF02 (limits), RF03 (assembly error) or BUILD"
_ALONE = "RF02 and RF03 alone change a machine that is there: name it (`like`), or write the links (RF01) before them"


@dataclass(frozen=True)
class ScriptLink:
    """A link of the script: its six numbers (XA, YA, ZA in degrees, X, Y, Z in mm), its variable, limits, errors."""

    numbers: tuple[float, ...]
    variable: str = ""  # which of ENTRIES is the joint's
    limits: tuple[float, float] | None = None  # lower, upper
    errors: tuple[float, ...] = (0.0,) * 6
    line: int = 0  # of its RF01
    error_line: int = 0  # of its RF03


@dataclass
class Script:
    """A configuration script, read line by line."""

    name: str = ""  # of its file, for errors
    links: list[ScriptLink] = field(default_factory=list)  # LN1, LN2...
    built: int = 0  # line of the BUILD that everything before it counts in; 0: changed since
    line: int = 0  # read last
    changes: list[tuple[int, int, dict[str, str]]] = field(default_factory=list)  # without RF01: line, RF word, words
    of: str = ""  # the machine whose links these are; empty: the script's own

    def take(self, text: str, number: int) -> bool:
        """Read a line; False if it is none of a script (then nothing has changed). InputError for one that is wrong."""
        bare = _COMMENT.sub(" ", text).strip().upper()
        found = _LINE.match(bare)
        assert found is not None
        if not found[1] and not found[3]:
            return bare in ("", "%")
        self.line = number
        words = self._words(bare, found.end())
        if found[3]:
            self._build(words)
        elif found[1]:
            self._reconfigure(int(found[2]), words)
        return True

    def check_built(self, number: int, what: str) -> None:
        """InputError where the configuration is not built."""
        self.line = number
        if not self.built:
            raise self._error(f"{what} before BUILD: the links take effect by BUILD; write it behind the last RF word")

    def _words(self, text: str, at: int) -> dict[str, str]:
        words: dict[str, str] = {}
        while text[at:].strip():
            found = _WORD.match(text, at)
            if found is None:
                words_are = "words are LN, XA, YA, ZA, X, Y, Z, UP and LW"
                raise self._error(f"{text[at:].strip():.20} cannot be read; {words_are}")
            if found[1] in words:
                raise self._error(f"{found[1]} stands twice in one line; write it once")
            words[found[1]] = found[2]
            at = found.end()
        return words

    def _reconfigure(self, which: int, words: dict[str, str]) -> None:
        if which not in _WANTED:
            raise self._error(f"RF{which:02d} is no word of the script; {_SAYS}")
        for word in _WANTED[which]:
            if word not in words:
                raise self._error(f"RF{which:02d} needs {' '.join(_WANTED[which])}; {word} is missing")
        if more := [word for word in words if word not in _WANTED[which]]:
            raise self._error(f"RF{which:02d} has no word {more[0]}; it has {' '.join(_WANTED[which])}")
        if not words["LN"].isdigit() or int(words["LN"]) < 1:
            raise self._error(f"LN{words['LN']} must be a whole number from 1 on; LN1 holds the tool")
        if which != 1 and not self.links:
            self._change(which, words)
            return
        number = int(words.pop("LN"))
        if which != 1 and number > len(self.links):
            remedy = f"`rds machine script {self.of}` lists them" if self.of else "write its RF01 first"
            raise self._error(f"there is no link LN{number} (LN1 to LN{len(self.links)}); {remedy}")
        if which == 1:
            self._link(number, words)
        elif which == 2:
            self._limit(number, words)
        else:
            self._correct(number, words)

    def _change(self, which: int, words: dict[str, str]) -> None:
        """A word for a link of a machine that is there; limits take effect at once, errors with the next BUILD."""
        if which == 2:
            self._range(words)
        for word in _WANTED[which][1:]:
            self._plain(word, words)
        counts = which == 2 and (self.built or not self.changes)
        self.built = self.line if counts else 0
        self.changes.append((self.line, which, words))

    def over(self, machine: Machine) -> Script:
        """The links of `machine` with what this script, which has none of its own, changes of them.

        InputError with the line of a word that fits none of them.
        """
        own = [replace(link, line=0, error_line=0) for link in read_script(script_of_machine(machine)).links]
        made = Script(self.name, own, 1, of=machine.name)
        for line, which, words in self.changes:
            self.line = made.line = line
            made._reconfigure(which, dict(words))
        made.built = self.built
        return made

    @property
    def corrects(self) -> bool:
        """Whether it says an assembly error."""
        said = (words for _, which, words in self.changes if which == 3)
        return any(any(link.errors) for link in self.links) or any(
            float(words[word]) != 0.0 for words in said for word in ENTRIES
        )

    def _link(self, number: int, words: dict[str, str]) -> None:
        if self.changes:
            line, which, _ = self.changes[0]
            raise self._error(f"RF01 behind RF{which:02d} of line {line}; write all links before limits and errors")
        if number <= len(self.links):
            first = self.links[number - 1].line
            raise self._error(f"LN{number} is there already, from line {first}; name each link once")
        if number != (due := len(self.links) + 1):
            raise self._error(f"LN{number} out of order: LN{due} is missing; write the links from LN1 on")
        variables = [word for word in ENTRIES if words[word] == "#"]
        if len(variables) > 1:
            raise self._error(f"{' and '.join(variables)} are both variable (#); a link has one joint; divide it")
        numbers = tuple(0.0 if words[word] == "#" else float(words[word]) for word in ENTRIES)
        self.links.append(ScriptLink(numbers, variables[0] if variables else "", line=self.line))
        self.built = 0

    def _limit(self, number: int, words: dict[str, str]) -> None:
        link = self.links[number - 1]
        if not link.variable:
            where = f"in {self.of}" if self.of else f"line {link.line} has no #"
            raise self._error(f"LN{number} is fixed ({where}): limits belong to a joint; remove them")
        limits = self._range(words)
        self.links[number - 1] = replace(link, limits=limits)  # in force without BUILD: the chain is the same

    def _range(self, words: dict[str, str]) -> tuple[float, float]:
        lower, upper = (self._plain(word, words) for word in ("LW", "UP"))
        if not lower < upper:
            raise self._error(f"UP{upper:g} must be more than LW{lower:g}; exchange them")
        return lower, upper

    def _correct(self, number: int, words: dict[str, str]) -> None:
        errors = tuple(self._plain(word, words) for word in ENTRIES)
        self.links[number - 1] = replace(self.links[number - 1], errors=errors, error_line=self.line)
        self.built = 0

    def _plain(self, word: str, words: dict[str, str]) -> float:
        if words[word] == "#":
            raise self._error(f"{word}# must be a number here; # belongs to RF01")
        return float(words[word])

    def _build(self, words: dict[str, str]) -> None:
        if words:
            raise self._error(f"BUILD stands alone; remove {next(iter(words))}")
        if not self.links and not self.changes:
            raise self._error("BUILD without links: write RF01 LN1 first, the link that holds the tool")
        self.built = self.line

    def _error(self, said: str) -> InputError:
        return InputError(said, f"{self.name}, line {self.line}" if self.name else f"line {self.line}")


def read_script(text: str, name: str = "", *, program: bool = False) -> Script:
    """The script in a text that holds nothing else; InputError with the line of what is wrong.

    Of a `program` it is what stands at the head, before the first block.
    """
    script, number = Script(name), 0
    for number, line in enumerate(text.splitlines(), 1):
        if not script.take(line, number):
            if program and script.built:
                break
            if not script.built and _MOTION.match(line):
                script.check_built(number, f"{line.strip():.30}")
            script.line = number
            behind = ", and name a part program that begins with a script .ngc" if script.built and not program else ""
            raise script._error(f"{line.strip():.30} is no line of a configuration script; {_SAYS}{behind}")
    if not script.links and not script.changes:
        raise script._error("there is no link; write RF01 LN1 ..., and BUILD at its end")
    script.check_built(number, "the end of the script")
    return script


def machine_of_script(script: Script, name: str = "script", before: Machine | None = None) -> Machine:
    """The machine of a script, not yet in a file; `before` as for `machine_text_of_script`.

    InputError for a joint without limits.
    """
    table = _table(script, name) if before is None else _completed(script, name, before)
    return machine_from(TomlTable(table, MACHINE))


def machine_text_of_script(script: Script, name: str, before: Machine | None = None) -> str:
    """The machine's file, as TOML.

    What the script does not say (encoders, models, limits of planned motion, spindles, converter) is that of the axes
    of the same name of `before`, the machine that is reconfigured, else chosen. A script without links is about those
    of `before`.
    """
    of = "" if before is None else f", but for what {before.name} has of axes with the same name"
    about = (
        f"A machine configured by the script {script.name or name}. Links are listed from the work on; LN1 holds "
        f"the tool.\nNodes, encoders, models and limits of planned motion are chosen{of}."
    )
    return toml_text(_completed(script, name, before), about)


def _completed(script: Script, name: str, before: Machine | None) -> dict[str, Any]:
    """The machine's tables with what the script does not say."""
    names: Sequence[str] = ()
    if before is not None and script.changes:
        script, names = script.over(before), joints_of(before.kinematics)
    table = _table(script, name, names)
    axes, known = table["axis"], {} if before is None else before.axes
    if before is not None:
        table |= {"sample_period": before.sample_period, "converter": asdict(before.converter)}
        table |= {"power": asdict(before.power)} if before.power is not None else {}
        axes |= {axis.name: axis_table(axis) for axis in known.values() if axis.is_spindle and axis.name not in axes}
    taken = {axis.node for axis in known.values()}
    moving = {link["axis"]: link for link in table["link"] if "axis" in link}
    full = table.get("converter", {}).get("range", VOLTAGE_RANGE.default)
    for axis, link in moving.items():
        own = known.get(axis)
        if own is None or own.unit != axes[axis]["unit"]:
            free = next(node for node in count(2) if node not in taken)
            taken.add(free)
            axes[axis] |= {"node": free} | chosen_motion(SPEED, full)
            continue
        (least, most), (lower, upper) = own.travel, axes[axis]["travel"]
        low, high = max(least, lower), min(most, upper)
        if not low < high:
            said = f"the limits of {link['name']} are outside the travel of {axis}, {least:g} to {most:g}"
            raise script._error(f"{said}; mend RF02")
        link["limits"] = [low, high]
        axes[axis] = chosen_motion(SPEED, full) | axis_table(own)
    return table


def joints_of(kinematics: Kinematics) -> list[str]:
    """The axes of the joints in the order of the chain, from the work on."""
    return [kinematics.joints[joint.number] for joint in kinematics.chain.joints]


def _table(script: Script, name: str, names: Sequence[str] = ()) -> dict[str, Any]:
    """The machine's tables. `names` are the axes of the joints from the work on, where they have names already."""
    if script.changes:
        raise script._error(_ALONE)
    axes: dict[str, Any] = {}
    links = []
    for number, link in reversed(list(enumerate(script.links, 1))):
        table: dict[str, Any] = {"name": f"LN{number}"}
        if link.variable:
            script.line = link.line
            if link.limits is None:
                raise script._error(f"LN{number} moves and has no limits; write RF02 LN{number} UP... LW...")
            axis = names[len(axes)] if names else axis_name(link.variable, axes)
            unit = "deg" if link.variable in ROTARY else "mm"
            axes[axis] = {"node": len(axes) + 2, "unit": unit, "travel": list(link.limits), "resolution": 0.001}
            table |= {"axis": axis, "joint": link.variable}
        table |= {"angles": list(link.numbers[:3]), "offset": list(link.numbers[3:])}
        if any(link.errors):
            table |= {"error_angles": list(link.errors[:3]), "error_offset": list(link.errors[3:])}
        links.append(table)
    if not axes:
        raise script._error("no link has a joint variable (#): nothing would move")
    return {"name": name, "title": f"Configured by {name}", "sample_period": 0.001, "axis": axes, "link": links}


def axis_name(variable: str, taken: Iterable[str]) -> str:
    """The name of an axis by what it does (X, XA...): the first letter that is not taken."""
    names = [*_LETTERS[variable], *(f"{_LETTERS[variable][0]}{number}" for number in range(2, 100))]
    return next(name for name in names if name not in taken)


def script_of_machine(machine: Machine) -> str:
    """A script of a machine's chain, which numbers its links.

    Of a machine that a script made (links LN1, LN2...) that script, with its limits and errors; else `script_of`.
    """
    links = machine.links[::-1]
    carriers = [*(link.name for link in links[1:]), BED][: len(links)]
    is_own = all(_is_of_script(link, n, by) for n, (link, by) in enumerate(zip(links, carriers, strict=True), 1))
    if not links or not is_own or machine.tool != ChainEnd("LN1") or machine.work != ChainEnd():
        return script_of(machine.kinematics)
    lines, said = [f"({machine.name}: from the tool, LN1, to the work)"], []
    for link in links:
        numbers: list[float | str] = [*(link.angles or (0.0,) * 3), *(link.offset or (0.0,) * 3)]
        if link.axis:
            numbers[ENTRIES.index(link.joint)] = "#"
        lines.append(f"RF01 {link.name} {words_of(numbers)}")
        if link.axis:
            lower, upper = link.limits or machine.axes[link.axis].travel
            said.append(f"RF02 {link.name} UP{_shown(upper)} LW{_shown(lower)}")
    for link in links:
        errors = (*link.error_angles, *link.error_offset)
        if any(errors):
            said.append(f"RF03 {link.name} {words_of(errors)}")
    return "\n".join([*lines, *said, "BUILD"]) + "\n"


def _is_of_script(link: Link, number: int, parent: str) -> bool:
    """Whether words of a script say all of this link."""
    numbers = (*(link.angles or (0.0,) * 3), *(link.offset or (0.0,) * 3))
    says_more = link.matrix is not None or link.module or link.sign != 1
    zero = not link.axis or numbers[ENTRIES.index(link.joint)] == 0.0
    return link.name == f"LN{number}" and link.parent == parent and zero and not says_more


def script_of(kinematics: Kinematics) -> str:
    """A script of any machine's chain, from the tool to the work; read again it gives the same poses.

    Its joints are those of the machine in the order of the chain; one that counts backwards is turned over by the links
    beside it.
    """
    matrices, links = [kinematics.chain.fixed[0]], []
    for joint, fixed in zip(kinematics.chain.joints, kinematics.chain.fixed[1:], strict=True):
        over = np.eye(4)
        if joint.sign < 0:  # half a turn about another axis turns the joint's own round
            over = transformation([180.0 if k == (joint.along + 1) % 3 else 0.0 for k in range(3)] + [0.0] * 3)
        matrices[-1] = matrices[-1] @ over
        matrices.append(over @ fixed)
        variable = ("XA", "YA", "ZA")[joint.along] if joint.turns else "XYZ"[joint.along]
        links.append((variable, kinematics.limits[joint.number], kinematics.joints[joint.number]))
    entries: list[tuple[Sequence[float | str], Any, str]] = []
    for place, matrix in enumerate(matrices):
        if np.abs(matrix - np.eye(4)).max() > 1e-12:
            entries.append((numbers_of(matrix), None, "fixed"))
        if place < len(links):
            variable, limits, name = links[place]
            entries.append((["#" if word == variable else 0.0 for word in ENTRIES], limits, name))
    lines, limited = [f"({kinematics.name}: from the tool, LN1, to the work)"], []
    for number, (values, limits, name) in enumerate(reversed(entries), 1):
        lines.append(f"RF01 LN{number} {words_of(values)} ({name})")
        if limits is not None:
            limited.append(f"RF02 LN{number} UP{_shown(limits[1])} LW{_shown(limits[0])}")
    return "\n".join([*lines, *limited, "BUILD"]) + "\n"


def words_of(values: Iterable[float | str]) -> str:
    """The six numbers of a link, or #, behind their words."""
    shown = (value if isinstance(value, str) else _shown(value) for value in values)
    return " ".join(f"{word}{value}" for word, value in zip(ENTRIES, shown, strict=True))


def _shown(value: float) -> str:
    return np.format_float_positional(value + 0.0, trim="-")
