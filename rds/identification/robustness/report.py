"""A study as files: a page with its tables and pictures, and the figures of every draw as CSV."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from io import StringIO
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from rds.core.atomic import write_files
from rds.identification.robustness.figures import FIGURES
from rds.identification.robustness.plots import dependence, distributions
from rds.identification.robustness.summary import PERCENTS, AxisSummary, sentences, summaries
from rds.results import html
from rds.results.report import page
from rds.results.units import heading

if TYPE_CHECKING:
    from rds.identification.robustness.study import Study

COLUMNS = ("figure", "estimate", *(f"{p} %" for p in PERCENTS), "worst", "unit")


def write_study(study: Study, folder: Path, title: str) -> dict[str, Path]:
    """The page, the pictures and `draws.csv` in `folder`, all or none; each file's path by its kind."""
    pictures = {}
    for number, axis in enumerate(study.axes):
        pictures[f"{axis}_figures"] = distributions(study, number)
        if study.task.axes[number].spread.varied:
            pictures[f"{axis}_dependence"] = dependence(study, number)
    files = {name: folder / f"{name}.png" for name in pictures}
    drawn = {name: picture.png() for name, picture in pictures.items()}
    data = {files[name]: picture for name, picture in drawn.items()}
    files |= {"report": folder / "report.html", "draws": folder / "draws.csv"}
    data[files["report"]] = study_page(study, title, drawn).encode()
    data[files["draws"]] = draws_table(study).encode()
    write_files(data)
    return files


FIGURES_NOTE = (
    "Under 95 %: 95 % of the draws are no worse than this; a margin is worse when it is smaller. An unstable loop has "
    "margins of 0."
)


def figure_rows(found: AxisSummary) -> list[list[float | str | None]]:
    """The table of one axis, under `COLUMNS`."""
    return [
        [FIGURES[name][0], values["nominal"], *(values[f"p{p}"] for p in PERCENTS), values["worst"], found.units[name]]
        for name, values in found.figures.items()
    ]


def parameter_rows(found: AxisSummary) -> list[list[float | str | None]]:
    """What each parameter is in the worst draw, and how far the error follows it."""
    return [
        [
            name,
            value,
            found.worst_values.get(name),
            found.deviations.get(name),
            found.drivers.get(name),
            found.parameter_units.get(name, ""),
        ]
        for name, value in found.nominal_values.items()
    ]


PARAMETER_COLUMNS = ("parameter", "estimate", "in the worst draw", "deviation", "rank correlation", "unit")
PARAMETER_NOTE = (
    "Deviation: in standard deviations of the draws (of ranges: in halves of the range). Rank correlation (Spearman's) "
    "with the largest tracking error: 1 when the error always grows with the parameter, -1 when it always falls."
)


def study_page(study: Study, title: str, pictures: dict[str, bytes]) -> str:
    """The page as HTML that fetches nothing, with the `pictures` (PNG) of each axis."""
    runs = len(study.figures)
    drawn = f"{runs} runs of {study.task.plan.samples * study.task.plan.T:g} s, seed {study.task.seed}"
    header = f'<header><h1>{escape(title)}</h1><p class="about">{escape(drawn)}</p></header>'
    return page(title, header + fragment(study, pictures))


def fragment(study: Study, pictures: Mapping[str, bytes] = MappingProxyType({})) -> str:
    """What was found as HTML without a page around it, for a notebook or the page; all text is escaped."""
    parts = [html.notes_list([*sentences(study), *study.notes])]
    for found in summaries(study):
        images = "".join(
            html.image(picture, name) for name, picture in pictures.items() if name.startswith(f"{found.axis}_")
        )
        parts.append(
            f"<section><h2>Axis {escape(found.axis)}</h2>{html.table(COLUMNS, figure_rows(found), note=FIGURES_NOTE)}"
            f"{html.table(PARAMETER_COLUMNS, parameter_rows(found), note=PARAMETER_NOTE)}{images}</section>"
        )
    return "\n".join(parts)


def draws_table(study: Study) -> str:
    """Every draw as CSV: its parameters and figures, units in the headings."""
    names, columns = ["draw"], [np.arange(len(study.figures), dtype=float)]
    for number, axis in enumerate(study.task.axes):
        unit = study.task.plan.axes[number].axis.unit
        names += [heading(f"{axis.name}_{name}", axis.spread.units.get(name, "")) for name in axis.spread.names]
        columns += list(study.drawn[number].T)
        for i, (name, (_, own_unit, _)) in enumerate(FIGURES.items()):
            names.append(heading(f"{axis.name}_{name}", (own_unit or unit).replace("1", "")))
            columns.append(study.figures[:, number, i])
    stream = StringIO()
    stream.write(",".join(names) + "\n")
    for row in zip(*columns, strict=True):
        stream.write(",".join([str(int(row[0])), *(repr(float(value)) for value in row[1:])]) + "\n")
    return stream.getvalue()
