"""Distances from the path: of a part program as it was programmed, else of the references of all axes together."""

from __future__ import annotations

import numpy as np

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import NotMeasured, Options, actual, used
from rds.interpolators.motion.segments import LINE, SEGMENT
from rds.nc.run.contour import contour_error

_LINEAR = ("X", "Y", "Z")


def contour(run: CaseRun, options: Options) -> np.ndarray:
    """The contour error of each sample that counts, mm."""
    result = run.result
    chosen = used(run, result.axes[0], options)
    if "contour_error" in result and not run.fact("noisy"):
        errors = result["contour_error"][chosen]
    else:
        errors = _from_references(run)[chosen]
    if not len(errors):
        raise NotMeasured("the program has not begun to move the axes")
    return np.asarray(errors)


def _from_references(run: CaseRun) -> np.ndarray:
    """Distance to the line from reference to reference, near where the reference is; only X, Y and Z count."""
    result = run.result
    axes = [axis for axis in result.axes if axis in _LINEAR]
    if len(axes) < 2:
        raise NotMeasured("a contour takes two linear axes or more; with one axis use max-error")
    wanted, points = np.zeros((len(result), 3)), np.zeros((len(result), 3))
    for axis in axes:
        column = _LINEAR.index(axis)
        wanted[:, column], points[:, column] = result[f"{axis}_reference"], actual(run, axis)
    if len(result) < 2:
        raise NotMeasured("the run has no path")
    path = np.zeros(len(result) - 1, SEGMENT)
    path["plane"] = LINE
    path["start"][:, :3], path["end"][:, :3] = wanted[:-1], wanted[1:]
    segment = np.clip(np.arange(len(result)) - 1, 0, len(path) - 1)
    reach = np.linalg.norm(points - wanted, axis=1) + 1e-3
    return contour_error(points, path, segment, reach)[0]
