"""One criterion of an assignment: what is measured on which cases, its bands, points and visibility."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from types import ModuleType
from typing import Any

from rds.core.errors import InputError
from rds.core.quantities import Quantity
from rds.core.toml_table import TomlTable
from rds.grading.assignment.unit_tests import UnitTest, read_tests
from rds.grading.cases.case import LINEAR, Case, CaseRun
from rds.grading.criteria import KINDS
from rds.grading.criteria.bands import Bands
from rds.grading.criteria.measuring import NotMeasured
from rds.grading.grade import Band, CriterionScore, with_unit

DIGITS = 9  # of a value: so many are the same on every computer
UNKNOWN = 0.5  # of the points, at most, where nothing could be measured; as a gate it leaves so much of them
STEPS = 20  # of the points of a hidden criterion
GATE = 0.25  # of the points of a required criterion: with so many it takes nothing from those that require it


@dataclass(frozen=True)
class Criterion:
    """The words of one table `[[criterion]]`. `cases` are names; `unit` is that of the bands."""

    name: str
    title: str
    kind: str
    cases: tuple[str, ...]
    max_score: float  # points times weight
    bands: Bands
    unit: str
    is_visible: bool
    options: Mapping[str, Any]
    tests: tuple[UnitTest, ...] = ()
    requires: tuple[str, ...] = ()  # criteria without whose points this one earns none

    @property
    def module(self) -> ModuleType:
        """What measures it; see `rds.grading.criteria`."""
        return KINDS.module(self.kind)

    @property
    def needs(self) -> tuple[str, ...]:
        """What its runs must hold besides their samples."""
        return getattr(self.module, "NEEDS", ())

    def measure(self, run: CaseRun) -> float:
        """Its value on one run, in `unit`; NotMeasured where there is none."""
        if run.fault:
            raise NotMeasured(run.fault)
        value = float(self.module.measure(run, self.options))
        if not isfinite(value):
            raise NotMeasured("the value is beyond measure")
        return float(f"{value:.{DIGITS}g}")

    def worse(self, value: float, than: float) -> bool:
        """Whether `value` earns less than another, or as much with less margin."""
        return self.bands.margin(value) < self.bands.margin(than)

    def score(self, value: float, case: str) -> CriterionScore:
        """The points that a value earns, and a sentence about it."""
        band, share = self.bands.band(value), self.bands.share(value)
        return self._scored(
            self._counted(share) * self.max_score, value, band, self._sentence(value, band, share), case
        )

    def nothing(self, why: str, case: str = "") -> CriterionScore:
        """No value, no points."""
        return self._scored(0.0, None, Band.NONE, f"{self.meaning} could not be measured: {why.rstrip('.')}.", case)

    def unknown(self, why: str, case: str, share: float) -> CriterionScore:
        """No value, but perhaps one to be had: `share` of the points until somebody has looked."""
        said = f"{self.meaning} could not be measured: {why.rstrip('.')}. This is for a review by your instructor"
        share = min(share, UNKNOWN)
        said += (
            f"; until then it counts as the rest of your work does, half at most: {100 * share:.3g} % of the points."
        )
        return self._scored(self._counted(share) * self.max_score, None, Band.REVIEW, said, case)

    def gated(self, score: CriterionScore, title: str, factor: float, is_known: bool = True) -> CriterionScore:
        """The same with `factor` of its points: the criterion called `title` earned too little, or is not known."""
        share = factor * score.score / self.max_score if self.max_score else 0.0
        points = float(f"{self._counted(share) * self.max_score:.{DIGITS}g}")
        if score.value is None:
            return replace(score, score=points, band=score.band if points else Band.NONE, gate=title)
        sentence = self._sentence(score.value, score.band, self.bands.share(score.value), "would earn").rstrip(".")
        if not points:
            said = f"{sentence}; it counts only where points are earned for {title}."
            return replace(score, score=0.0, band=Band.NONE, sentence=said, gate=title)
        why = (
            f"earns less than {100 * GATE:g} % there"
            if is_known
            else "could not be measured; your instructor looks at it"
        )
        said = f"{sentence}; {100 * factor:.3g} % of that count, because {title} {why}."
        return replace(score, score=points, band=Band.PARTIAL, sentence=said, gate=title)

    def _counted(self, share: float) -> float:
        """The share that counts: of a hidden criterion in steps, so that attempts cannot find its value by the points.

        What earns a little, or not all, is never rounded to nothing, or to all.
        """
        return share if self.is_visible or self.tests else in_steps(share)

    @property
    def meaning(self) -> str:
        """What is measured, to begin a sentence with."""
        text = str(self.module.MEANING)
        return text[0].upper() + text[1:]

    @property
    def bounds(self) -> str:
        """The bands in words."""
        way = "at most" if self.bands.more_is_worse else "at least"
        beyond = "from" if self.bands.more_is_worse else "at or below"
        tail = "on" if self.bands.more_is_worse else ""
        nothing = f"none {beyond} {with_unit(self.bands.none, self.unit)} {tail}".rstrip()
        return f"full points for {way} {with_unit(self.bands.full, self.unit)}, {nothing}"

    def _sentence(self, value: float, band: Band, share: float, earns: str = "earns") -> str:
        said = {
            Band.FULL: f"which {earns} full points",
            Band.PARTIAL: f"which {earns} {100 * share:.3g} % of the points",
            Band.NONE: f"which {earns} no points",
            Band.REVIEW: "",
        }[band]
        # some meanings end with a comma, as they explain themselves
        return f"{self.meaning} is {with_unit(value, self.unit)}, {said} ({self.bounds})."

    def _scored(self, score: float, value: float | None, band: Band, sentence: str, case: str) -> CriterionScore:
        rounded = float(f"{score:.{DIGITS}g}")
        return CriterionScore(
            self.name, self.title, rounded, self.max_score, value, self.unit, band, sentence, self.is_visible, case
        )


def in_steps(share: float) -> float:
    """The nearest of `STEPS` steps between nothing and all, which are themselves for nothing less and nothing more."""
    return min(max(round(share * STEPS), 1), STEPS - 1) / STEPS if 0.0 < share < 1.0 else share


_SHARE = Quantity("share of the points", "", 0.0, 1.0)


def read_criterion(words: TomlTable, kind_of_submission: str, cases: Mapping[str, Case]) -> Criterion:
    """A table `[[criterion]]`. InputError with its place for a word, a value or a case that will not do."""
    name = words.read("name")
    if not name:
        raise InputError("name is missing; give each criterion a name of its own", words.place())
    kind = words.read("kind")
    module = KINDS.module(kind)
    if kind_of_submission not in module.FOR:
        said = f"is for {' and '.join(module.FOR)} assignments; this one's kind is {kind_of_submission}"
        raise words.fault("kind", said)
    tests = read_tests(words) if kind == "unit-tests" else ()
    chosen = _cases(words, cases, kind)
    if kind == "unit-tests" and not tests:
        raise InputError("it has no test; add [[criterion.test]] with function, args, expected", words.place())
    _check_cases(words, module, [cases[each] for each in chosen])
    options = _options(words, module)
    points = words.read("points")
    weight = words.read("weight")
    unit = _unit(words, module, [cases[each] for each in chosen])
    criterion = Criterion(
        name,
        words.read("title", name) or name,
        kind,
        chosen,
        points * weight,
        _bands(words, module, unit),
        unit,
        words.read("visible"),
        options,
        tests,
        _requires(words, name),
    )
    words.done()
    return criterion


def _cases(words: TomlTable, cases: Mapping[str, Case], kind: str) -> tuple[str, ...]:
    one, several = words.read("case"), words.any("cases")
    if kind == "unit-tests":
        if one is not None or several is not None:
            raise InputError("unit tests need no case; remove it", words.place("case" if one else "cases"))
        return ()
    if one is not None and several is not None:
        raise InputError("case and cases both say where to measure; give one of them", words.place("cases"))
    names = [one] if one is not None else list(cases) if several is None else several
    if not isinstance(names, list) or not names or not all(isinstance(each, str) for each in names):
        raise words.fault("cases", "must be a list of the names of cases")
    for each in names:
        if each not in cases:
            key = "case" if one is not None else "cases"
            raise words.fault(key, f"names {each!r}, which is no case; there are {', '.join(cases) or 'none'}")
    return tuple(dict.fromkeys(names))


def _check_cases(words: TomlTable, module: ModuleType, cases: Sequence[Case]) -> None:
    for case in cases:
        for part in getattr(module, "CASE_HAS", ()):
            if not getattr(case, part, None):
                raise words.fault("kind", f"needs a case with {part}; case {case.name!r} has none")
        if LINEAR in getattr(module, "NEEDS", ()) and not case.can_be_linearized:
            said = "needs cases whose axes have a controller each, and a library model that can be linearized"
            raise words.fault("kind", f"{said}; case {case.name!r} is not one")


def _unit(words: TomlTable, module: ModuleType, cases: Sequence[Case]) -> str:
    units = {case.unit for case in cases} if module.UNIT is None else {module.UNIT}
    if len(units) > 1:
        raise words.fault("cases", f"measure in different units ({', '.join(sorted(units))}); split the criterion")
    unit = str(units.pop())
    written = words.read("unit")
    if written is None:
        raise InputError(f'unit is missing; write `unit = "{unit}"`, so that nobody mistakes the bands', words.place())
    if written != unit:
        raise words.fault("unit", f"must be {unit!r}: that is what this criterion is measured in")
    return unit


def _bands(words: TomlTable, module: ModuleType, unit: str) -> Bands:
    full, none = words.read("full"), words.read("none")
    partial = words.any("partial", "linear")
    if partial != "linear" and (fault := _SHARE.fault(partial)) is not None:
        raise words.fault("partial", f'{fault}, or "linear"')
    share = None if partial == "linear" else float(partial)
    if full == none or (none > full) is not module.MORE_IS_WORSE:
        way = "more" if module.MORE_IS_WORSE else "less"
        raise words.fault("none", f"must be {way} than full = {full:g} {unit}: {way} is worse for this criterion")
    return Bands(full, none, share)


def _options(words: TomlTable, module: ModuleType) -> dict[str, Any]:
    known: Mapping[str, Quantity] = getattr(module, "OPTIONS", {})
    found: dict[str, Any] = dict(getattr(module, "DEFAULTS", {}))
    for key, option in known.items():
        if key in words:
            try:
                found[key] = option.check(words.any(key), key, "criterion")
            except InputError as error:
                raise InputError(str(error), words.place(key)) from error
    for key in getattr(module, "NEEDED", ()):
        if key not in found:
            raise InputError(f"{key} is missing; give it: {known[key].described}", words.place())
    return found


def _requires(words: TomlTable, name: str) -> tuple[str, ...]:
    given = words.any("requires", [])
    given = [given] if isinstance(given, str) else given
    if not isinstance(given, list) or not all(isinstance(each, str) for each in given):
        raise words.fault("requires", "must be a list of the names of criteria")
    if name in given:
        raise words.fault("requires", "names the criterion itself")
    return tuple(given)
