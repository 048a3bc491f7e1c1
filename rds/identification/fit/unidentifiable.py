"""What the data cannot tell, in sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rds.identification.fit.uncertainty import Uncertainty
from rds.identification.structures.structure import Structure

_HARDLY = 0.5  # standard error over value


def unidentifiable_by(
    structure: Structure,
    names: Sequence[str],
    values: Mapping[str, float],
    uncertainty: Uncertainty,
    unmoved: Sequence[str] = (),
) -> list[str]:
    """Sentences about the free parameters `names`: without effect, only together, or hardly at all.

    `unmoved` are those that the logs give no occasion to tell, and that were not estimated.
    """
    said = []
    for name in (*unmoved, *(names[i] for i in uncertainty.without_effect if i < len(names))):
        why = structure.no_effect.get(name)
        value = _with_unit(structure, name, values[name])
        origin = "an assumption" if name in unmoved else "only the value that the search began with"
        said.append(
            f"{name} has no effect on the response to these commands{f' ({why})' if why else ''}. The data do not "
            f"determine it; {value} is {origin}. Record a motion that shows it (`rds excite`), or hold it with "
            f"--fix {name}=VALUE"
        )
    for direction in uncertainty.directions:
        sentence = _together(structure, values, names, direction)
        if sentence:
            said.append(sentence)
    error = np.sqrt(np.diag(uncertainty.covariance))
    for i, name in enumerate(names):
        size = abs(values[name])
        if np.isfinite(error[i]) and error[i] > _HARDLY * size:
            said.append(
                f"{name} is poorly determined by these data: {_with_unit(structure, name, values[name])} with a "
                f"standard error of {_with_unit(structure, name, float(error[i]))}"
            )
    return said


def _together(
    structure: Structure, values: Mapping[str, float], names: Sequence[str], direction: np.ndarray
) -> str | None:
    """Which parameters can change together, without any difference in the response."""
    changes = direction[: len(names)]
    largest = float(np.abs(changes).max(initial=0.0))
    if largest == 0.0:
        return None
    parts = [(name, change / largest) for name, change in zip(names, changes, strict=True) if change]
    if len(parts) < 2:
        return None
    if len(parts) == 2 and abs(abs(parts[0][1]) - abs(parts[1][1])) < 0.02:
        (one, by), (other, as_well) = parts
        # shares of equal size are a sum: by small changes it looks like a product
        adds = structure.units.get(one) == structure.units.get(other) and np.isclose(values[one], values[other], 0.02)
        words = ("difference", "sum") if adds else ("ratio", "product")
        word = words[int(by * as_well < 0.0)]
        return f"{one} and {other} come only as their {word}: these data cannot tell them apart"
    if parts[0][1] < 0.0:
        parts = [(name, -change) for name, change in parts]
    changing = ", ".join(f"{name} by {change:+.3g} %" for name, change in parts)
    return (
        f"{_and([name for name, _ in parts])} cannot be told apart: the response stays the same where they change "
        f"together ({changing}); only combinations of them are known"
    )


def _with_unit(structure: Structure, name: str, value: float) -> str:
    unit = structure.units.get(name, "")
    return f"{value:.3g}{f' {unit}' if unit else ''}"


def _and(words: Sequence[str]) -> str:
    return ", ".join(words[:-1]) + " and " + words[-1]
