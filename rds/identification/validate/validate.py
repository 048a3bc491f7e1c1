"""Validation: what a model says of data that it has not seen, and what that proves.

from rds.identification.validate.validate import validate

validation = validate("fitted.toml", logs)
print(validation)
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.identification.logs.log import Log, apart, as_logs, only_log
from rds.identification.validate.alternatives import with_alternatives
from rds.identification.validate.assessment import Assessment, assess
from rds.identification.validate.candidate import Candidate, as_candidate
from rds.identification.validate.conclusion import overall
from rds.identification.validate.contradictions import contradictions
from rds.identification.validate.criterion import Ranking, Rival, rank
from rds.identification.validate.in_loop import Loop, closed_loop_reasons
from rds.identification.validate.judge import judge
from rds.identification.validate.verdict import Bands, Verdict


@dataclass(frozen=True, repr=False)
class Validation:
    """One model on one log or several: what was measured, the verdict on each log and over all.

    `others` are models that were compared with it on the same logs, and `rankings` the comparison per log.
    """

    candidate: Candidate
    assessments: Mapping[str, Assessment]  # by the log's name
    verdicts: Mapping[str, Verdict]
    bands: Bands
    others: tuple[Candidate, ...] = ()
    rankings: Mapping[str, Ranking] = field(default_factory=dict)

    @property
    def verdict(self) -> Verdict:
        """Over all logs, and whether these contradict each other."""
        return overall(dict(self.verdicts), tuple(contradictions(self.assessments, self.bands)))

    @property
    def exit_code(self) -> int:
        """0 where the model is valid, or valid for what the verdict names; else 1."""
        return 0 if self.verdict.ok else 1

    def to_json(self) -> dict[str, Any]:
        """As a dict that JSON can hold; docs/validation.md says what is in it."""
        from rds.identification.validate.as_json import to_json

        return to_json(self)

    def write(self, folder: str | Path) -> list[Path]:
        """The report as a page with its pictures, and the numbers as JSON, in `folder`; their paths, the page first."""
        from rds.identification.validate.report import write

        return write(self, Path(folder))

    def __repr__(self) -> str:
        return f"<Validation of {self.candidate.name} on {', '.join(self.assessments)}: {self.verdict.word}>"

    def __str__(self) -> str:
        return str(self.verdict)

    def _repr_html_(self) -> str:
        from rds.identification.validate.report import fragment

        return fragment(self, pictures=False)


def validate(
    model: Any,
    logs: Log | Iterable[Log],
    *,
    against: Sequence[Any] = (),
    bands: Bands | None = None,
    initial_samples: int | None = None,
    loop: Loop | None = None,
) -> Validation:
    """Validate `model` on `logs`, and compare it with the models `against` on the same samples.

    `model` may be the path of a model file (.toml) or a student's file (.py), an `Estimate`, a `ModelFile`, an
    `rds.Model` or a `Candidate`. The initial state of each log is estimated from its first `initial_samples` (default
    50, of a short log a tenth), which no error counts. `loop` runs the experiment that was logged, whose controller
    and reference are known, with the model that it is given: `lambda model: rds.Experiment(..., model=model).run()`;
    without it, the loops of our own results with a controller of the library are known from these.
    Raises InputError for a model or log that will not do.
    """
    candidate = as_candidate(model)
    logs = as_logs(logs)
    if not logs:
        raise InputError("there is no log to validate on; name at least one")
    bands = bands or Bands()
    names = apart([log.name for log in logs])
    others = _others(candidate, against)
    assessments = {
        name: assess(candidate, log, initial_samples, bands.bandwidth) for name, log in zip(names, logs, strict=True)
    }
    verdicts = {}
    for name, a in assessments.items():
        more = tuple(closed_loop_reasons(candidate, a, loop, bands))
        verdicts[name] = with_alternatives(candidate, a, judge(candidate, a, bands, more), bands, more)
    rankings = {name: _ranking(candidate, a, others, bands, initial_samples) for name, a in assessments.items()}
    return Validation(candidate, assessments, verdicts, bands, others, rankings if others else {})


def compare_models(
    models: Sequence[Any], log: Log, *, bands: Bands | None = None, initial_samples: int | None = None
) -> Ranking:
    """Two models or more on one data set, by information criteria; see `criterion`. InputError as for `validate`."""
    if len(models) < 2:
        raise InputError("a comparison needs two models or more")
    first = as_candidate(models[0])
    a = assess(first, only_log(log), initial_samples)
    return _ranking(first, a, _others(first, models[1:]), bands or Bands(), initial_samples)


def _others(candidate: Candidate, against: Sequence[Any]) -> tuple[Candidate, ...]:
    others = [as_candidate(model) for model in against]
    names = apart([candidate.name, *(other.name for other in others)])
    return tuple(as_candidate(other, name) for other, name in zip(others, names[1:], strict=True))


def _ranking(
    candidate: Candidate,
    a: Assessment,
    others: Sequence[Candidate],
    bands: Bands,
    initial_samples: int | None,
) -> Ranking:
    if not others:
        return Ranking((), 0, 0.0, ())
    found = [(candidate, a), *((other, assess(other, a.log, initial_samples)) for other in others)]
    return rank(
        [
            Rival(
                name=model.name,
                residual=assessment.residual,
                parameters=len(model.estimated) or (len(model.parameters) if model.fitted_on else 0),
                states=model.structure.states,
                fitted_here=assessment.overlap.share > bands.seen,
            )
            for model, assessment in found
        ]
    )
