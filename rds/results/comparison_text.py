"""A comparison as a table to read: plain text, and HTML for a notebook."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rds.results.html import METRIC_TITLES, notes_list, number, table
from rds.results.metrics import ERROR_METRICS
from rds.results.units import heading

if TYPE_CHECKING:
    from rds.results.compare import AxisComparison, Comparison


def labels(comparison: Comparison) -> tuple[str, str]:
    """What to call the two results: their modes where these differ, else a and b with the mode."""
    a, b = comparison.a.mode, comparison.b.mode
    if a and b and a != b:
        return a, b
    return f"a ({a or 'run'})", f"b ({b or 'run'})"


def rows(axis: AxisComparison) -> list[list[Any]]:
    """Quantity with unit, of a, of b, and what the two have in common."""
    found = []
    for key in (*ERROR_METRICS, "fit_percent"):
        if key not in axis.metrics_a and key not in axis.metrics_b:
            continue
        left, right = axis.metrics_a.get(key), axis.metrics_b.get(key)
        unit = "%" if key == "fit_percent" else axis.unit
        change = right - left if left is not None and right is not None else None
        found.append([heading(METRIC_TITLES[key], unit), left, right, change])
    return found


def findings(axis: AxisComparison) -> list[str]:
    """What the responses have in common, in sentences."""
    unit = axis.unit
    said = [
        f"measured responses differ by at most {number(axis.max_difference)} {unit}, "
        f"RMS {number(axis.rms_difference)} {unit}, over {axis.samples} common samples"
    ]
    if axis.fit_percent is not None:
        said.append(f"fit of b's measured response to a's: {number(axis.fit_percent)} %")
    if axis.identical:
        said.append("identical sample for sample")
    else:
        said.append(f"first difference at {number(axis.first_difference)} s, in {', '.join(axis.differing_columns)}")
    for name, signal in axis.signals.items():
        found = (
            f"at most {number(signal.max_difference)} {signal.unit}, RMS {number(signal.rms_difference)} {signal.unit}"
        )
        said.append(f"signal {name} differs by {found}")
    said.append(_controller(axis))
    return said


def _controller(axis: AxisComparison) -> str:
    if axis.same_controller is None:
        return "controller: not known whether it is the same"
    if not axis.same_controller:
        return "controller: not the same"
    return (
        "controller: the same"
        + {True: ", same parameters", False: ", different parameters", None: ""}[axis.same_params]
    )


def contour_rows(comparison: Comparison) -> list[list[Any]]:
    """The contour and path errors of runs along a path, mm; none for other runs."""
    return [[heading(name, "mm"), a, b, b - a] for name, (a, b) in comparison.contour.items()]


def text(comparison: Comparison) -> str:
    """The whole comparison in plain text, columns aligned."""
    lines: list[str] = []
    columns = ["", *labels(comparison), "b - a"]
    for axis in comparison.axes.values():
        lines += [f"Axis {axis.axis}", *_aligned(columns, rows(axis))]
        lines += [f"  {finding}" for finding in findings(axis)]
        lines.append("")
    if found := contour_rows(comparison):
        lines += ["Contour", *_aligned(columns, found), ""]
    lines += [f"Note: {note}" for note in comparison.notes]
    return "\n".join(lines).rstrip()


def _aligned(columns: list[str], found: list[list[Any]]) -> list[str]:
    """The lines of a table, each column as wide as it must be."""
    cells = [columns, *([row[0], *map(number, row[1:])] for row in found)]
    widths = [max(len(row[i]) for row in cells) for i in range(4)]
    lines = []
    for row in cells:
        right = [cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)]
        lines.append("  " + "  ".join([row[0].ljust(widths[0]), *right]).rstrip())
    return lines


def fragment(comparison: Comparison) -> str:
    """The whole comparison as HTML."""
    columns = ["", *labels(comparison), "b − a"]
    parts = [
        table(columns, rows(axis), f"Axis {axis.axis}", "; ".join(findings(axis)) + ".")
        for axis in comparison.axes.values()
    ]
    if found := contour_rows(comparison):
        parts.append(table(columns, found, "Contour"))
    return "".join(parts) + notes_list(comparison.notes)
