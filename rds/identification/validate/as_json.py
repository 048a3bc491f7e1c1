"""A validation as JSON's own types. Numbers that are not defined are null."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from rds.identification.fit.estimate_json import finite

if TYPE_CHECKING:
    from rds.identification.fit.estimate import Errors
    from rds.identification.fit.residuals import Correlation
    from rds.identification.validate.assessment import Assessment
    from rds.identification.validate.candidate import Candidate
    from rds.identification.validate.validate import Validation


def to_json(validation: Validation) -> dict[str, Any]:
    """The object that `rds validate --json` prints."""
    return finite(
        {
            "model": _model(validation.candidate),
            **validation.verdict.to_json(),
            "bands": validation.bands.to_json(),
            "logs": {
                name: _log(a) | {"conclusion": validation.verdicts[name].to_json()}
                for name, a in validation.assessments.items()
            },
            "comparison": {name: asdict(ranking) for name, ranking in validation.rankings.items()},
        }
    )


def _model(candidate: Candidate) -> dict[str, Any]:
    return {
        "name": candidate.name,
        "source": candidate.source,
        "structure": candidate.structure.name,
        "options": list(candidate.structure.options),
        "parameters": {
            name: {"value": float(value), "unit": candidate.structure.units.get(name, "")}
            | (
                {key: getattr(candidate.parameters[name], key) for key in ("std_error", "low", "high")}
                if name in candidate.parameters
                else {}
            )
            for name, value in candidate.values.items()
        },
    }


def _log(a: Assessment) -> dict[str, Any]:
    tests, voltage = a.tests, a.voltage
    return {
        "source": a.log.source,
        "sha256": a.log.sha256,
        "samples": len(a.log),
        "sample_period": a.log.sample_period,
        "closed_loop": a.log.closed_loop,
        "seen_by_fit": {"share": a.overlap.share, "how": a.overlap.how, "known": a.overlap.known},
        "initial_state": {
            "policy": f"estimated from the first {a.first} samples by least squares; errors count from there on",
            "samples": a.first,
            "value": list(a.initial_state),
        },
        "free_run": _errors(a.free_run),
        "unstable_at": a.unstable_at,
        "velocity": _errors(a.velocity),
        "ahead": {str(k): _errors(e) for k, e in a.ahead.items()},
        "without_model": {str(k): _errors(e) for k, e in a.naive.items()},
        "drift": {"value": a.drift, "unit": f"{a.unit}/s"},
        "measured_over_modelled": a.gain,
        "residual": None
        if tests is None
        else {
            "bandwidth": tests.bandwidth,
            "block": tests.block,
            "blocks": tests.blocks,
            "samples": tests.samples,
            "surrogates": tests.surrogates,
            "p_white": tests.p_white,
            "p_command": tests.p_command,
            "autocorrelation": _correlation(tests.auto),
            "cross_correlation": _correlation(tests.cross),
        },
        "voltage": None
        if voltage is None
        else {
            "relative_error_percent": voltage.relative_percent,
            "rmse": voltage.rmse,
            "unit": a.ranges["command"].unit,
            "blocks": len(voltage.extra),
            "left_out": voltage.left_out,
        },
        "noise": {"value": a.noise, "unit": a.unit},
        "attainable": None if a.attainable is None else asdict(a.attainable) | {"ratio": a.attainable.ratio},
        "as_axis": None if a.as_axis is None else asdict(a.as_axis),
        "as_motion": None if a.as_motion is None else asdict(a.as_motion),
        "ranges": {name: asdict(found) for name, found in a.ranges.items()},
    }


def _errors(errors: Errors | None) -> dict[str, Any] | None:
    return None if errors is None else asdict(errors)


def _correlation(found: Correlation) -> dict[str, Any]:
    value, lag = found.largest if len(found.values) else (0.0, 0.0)
    return {"band": found.band, "outside": found.outside, "largest": value, "lag": lag}
