"""A validation as a page: the verdict and its reasons first, then every number and picture that they rest on."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from html import escape
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rds.core.atomic import write_files
from rds.identification.logs.units import acting
from rds.identification.validate.criterion import known
from rds.identification.validate.verdict import Verdict, Word
from rds.results.html import image, notes_list, table
from rds.results.report import page
from rds.results.units import heading

if TYPE_CHECKING:
    from rds.core.figure import Picture
    from rds.identification.fit.estimate import Errors
    from rds.identification.validate.assessment import Assessment
    from rds.identification.validate.criterion import Ranking
    from rds.identification.validate.validate import Validation

PAGE, NUMBERS = "validation.html", "validation.json"
_LOOK = {Word.VALID: "met", Word.PARTLY: "void", Word.NOT: "missed", Word.CANNOT_TELL: "void"}


def write(validation: Validation, folder: Path) -> list[Path]:
    """Write the page, its pictures as PNG and the numbers as JSON into `folder`, all or none; the page is first."""
    contents: dict[Path, bytes] = {}
    drawn = _pictures(validation)
    for name, pictures in drawn.items():
        for what, picture in pictures.items():
            contents[folder / f"{_file_name(name)}-{what.replace(' ', '-')}.png"] = picture
    title = f"Validation of {validation.candidate.name}"
    body = f"<header><h1>{escape(title)}</h1></header>{_fragment(validation, drawn)}"
    numbers = json.dumps(validation.to_json(), indent=2, allow_nan=False)
    files = {
        folder / PAGE: page(title, body).encode(),
        folder / NUMBERS: numbers.encode(),
        **contents,
    }
    write_files(files)
    return list(files)


def section(title: str, validation: Validation) -> str:
    """The validation as a part of another report."""
    return f"<section><h2>{escape(title)}</h2></section>{fragment(validation)}"


def fragment(validation: Validation, pictures: bool = True) -> str:
    """The validation as HTML without a page around it, for a report or a notebook; all text is escaped."""
    return _fragment(validation, _pictures(validation) if pictures else None)


def _fragment(validation: Validation, drawn: Mapping[str, Mapping[str, bytes]] | None) -> str:
    """The same with the pictures that are `drawn` of each log; None: without pictures."""
    parts = [f"<section>{verdict_line(validation.verdict)}{_bands(validation)}</section>"]
    for name, a in validation.assessments.items():
        verdict = validation.verdicts[name]
        line = verdict_line(verdict) if len(validation.assessments) > 1 else ""
        shown = "".join(image(picture, f"{name}: {what}") for what, picture in (drawn or {}).get(name, {}).items())
        parts.append(
            f"<section><h2>On {escape(name)}</h2>{line}{_reasons(verdict)}"
            f"{_conditions(a)}{_errors(a)}{_ahead(a)}{_rest(a)}{shown}</section>"
        )
        if ranking := validation.rankings.get(name):
            parts.append(f"<section><h2>Models compared on {escape(name)}</h2>{_ranking(ranking)}</section>")
    if drawn is not None:
        from rds.identification.validate.plots import intervals

        drawing = intervals([validation.candidate, *validation.others])
        if drawing is not None:
            parts.append(
                "<section><h2>Parameters with 95 % intervals</h2>"
                f"{image(drawing.png(), 'parameters')}{_parameters(validation)}</section>"
            )
    return "".join(parts)


def verdict_line(verdict: Verdict) -> str:
    """The verdict as a paragraph."""
    text = f"{verdict.word} {verdict.purpose}".strip()
    return f'<p class="verdict {_LOOK[verdict.word]}"><strong>{escape(text)}</strong> {escape(verdict.sentence)}</p>'


def _reasons(verdict: Verdict) -> str:
    return table(["", "reason"], [[str(reason.side), reason.what] for reason in verdict.ranked()])


def _bands(validation: Validation) -> str:
    rows = list(validation.bands.to_json().items())
    return f"<details><summary>Bands of the verdict</summary>{table(['band', 'limit'], rows)}</details>"


def _conditions(a: Assessment) -> str:
    loop = {True: "closed loop", False: "open loop", None: "whether a loop was closed is not known"}[a.log.closed_loop]
    notes = [
        f"{len(a.log)} samples of {a.log.sample_period:.6g} s, {loop}; {a.overlap.how}"
        + (f" ({100 * a.overlap.share:.0f} %)" if a.overlap.share > 0.0 else ""),
        f"initial state ({', '.join(f'{value:.4g}' for value in a.initial_state)}), estimated with the model from the "
        f"first {a.first} samples by least squares; errors count from there on",
    ]
    return notes_list(notes)


def _errors(a: Assessment) -> str:
    rows: list[list[Any]] = []
    if a.free_run is not None:
        rows.append(_row("free run, speed" if a.velocity is None else "free run, position", a.free_run))
    if a.velocity is not None:
        rows.append(_row(f"free run, velocity (means over {a.block * a.log.sample_period * 1e3:.3g} ms)", a.velocity))
    for k, errors in a.ahead.items():
        rows.append(_row(f"{k} {'sample' if k == 1 else 'samples'} ahead", errors))
    note = "The fit is 100 (1 − |y − ŷ| / |y − mean y|) %."
    return table(["prediction", "fit [%]", "RMSE", "maximum", "unit"], rows, note=note) if rows else ""


def _row(what: str, errors: Errors) -> list[Any]:
    return [what, f"{errors.fit_percent:.3f}", errors.rmse, errors.maximum, errors.unit]


def _ahead(a: Assessment) -> str:
    rows = [[k, a.ahead[k].rmse, e.rmse, a.ahead[k].rmse / e.rmse if e.rmse else None] for k, e in a.naive.items()]
    columns = ["samples ahead", heading("RMSE", a.unit), heading("RMSE without a model", a.unit), "ratio"]
    note = "Without a model: the axis stays, or moves on as it did over the last k samples, whichever is better."
    return table(columns, rows, note=note) if rows else ""


def _rest(a: Assessment) -> str:
    rows: list[list[Any]] = []
    if a.voltage is not None:
        unit = a.ranges["command"].unit
        rows += [
            [f"{acting(unit)} error [%]", a.voltage.relative_percent],
            [heading(f"{acting(unit)} error, RMS", unit), a.voltage.rmse],
            ["blocks for it, and left out", f"{len(a.voltage.extra)}, {a.voltage.left_out}"],
        ]
    if a.drift is not None:
        rows.append([heading("drift of the residual", f"{a.unit}/s"), a.drift])
    if a.gain is not None:
        rows.append(["measured over modelled velocity", a.gain])
    if a.tests is not None:
        rows += [
            ["p that an exact model's residual is no whiter", a.tests.p_white],
            ["p that it is no less correlated with the command", a.tests.p_command],
            ["averaged over [samples]; bandwidth [Hz]", f"{a.tests.block}; {a.tests.bandwidth:.3g}"],
            ["lags beyond the 99 % band [%]", 100.0 * a.tests.auto.outside],
        ]
    for name, found in a.ranges.items():
        rows.append([heading(f"{name} here", found.unit), f"{found.here[0]:.4g} to {found.here[1]:.4g}"])
        if found.fitted is not None:
            rows.append(
                [heading(f"{name} in the fit's data", found.unit), f"{found.fitted[0]:.4g} to {found.fitted[1]:.4g}"]
            )
    return table(["", ""], rows)


def _ranking(ranking: Ranking) -> str:
    columns = ["model", "k", "fitted here", "RMSE", "AICc", "difference", "weight", "BIC", "difference", "weight"]
    rows = [
        [
            r.name,
            r.counted,
            r.fitted_here,
            *map(known, (r.rmse, r.aicc, r.aicc_difference)),
            _weight(r.aicc_weight),
            *map(known, (r.bic, r.bic_difference)),
            _weight(r.bic_weight),
        ]
        for r in ranking.ranks
    ]
    note = (
        f"{ranking.samples} samples, whose residuals are worth {ranking.independent:.3g} independent ones. "
        "k counts what was estimated from these data: variance, initial state, and parameters if fitted here."
    )
    return table(columns, rows, note=note) + notes_list(ranking.warnings)


def _weight(value: float) -> str | None:
    return f"{value:.3f}" if isfinite(value) else None


def _parameters(validation: Validation) -> str:
    rows = []
    for model in (validation.candidate, *validation.others):
        for name, value in model.values.items():
            known = model.parameters.get(name)
            spread = [known.std_error, known.low, known.high] if known and known.told else [None, None, None]
            if known is not None and not known.told:
                name = f"{name} (assumed: not determined by the fit's data)"
            rows.append([model.name, name, float(value), *spread, model.structure.units.get(name, "")])
    return table(["model", "parameter", "value", "standard error", "low", "high", "unit"], rows)


def _pictures(validation: Validation) -> dict[str, dict[str, bytes]]:
    """What is drawn of each log: PNG by what it shows."""
    from rds.identification.validate import plots as plots

    def of(a: Assessment) -> Iterator[tuple[str, Picture]]:
        if a.unstable_at is None:
            yield "overlay", plots.overlay(a)
        if a.tests is not None and len(a.tests.auto.values):
            yield "correlations", plots.correlations(a)
        if a.voltage is not None and len(a.voltage.extra) >= 3:
            yield "friction curve", plots.friction_curve(validation.candidate, a)
            yield "voltage errors", plots.voltage_errors(a)

    return {name: {what: picture.png() for what, picture in of(a)} for name, a in validation.assessments.items()}


def _file_name(name: str) -> str:
    """A log's name as part of a file's."""
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in name).lstrip(".") or "log"
