"""What a fit found, as a page with pictures: parameters first, then how the free run follows the data, then doubts."""

from __future__ import annotations

import json
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rds.core.atomic import write_files
from rds.identification.fit.estimate_json import correlation_rows, described, error_rows, note, parameter_rows, to_json
from rds.identification.logs.log import named_apart
from rds.results.html import image, notes_list, table
from rds.results.report import page

if TYPE_CHECKING:
    from rds.core.figure import Picture
    from rds.identification.fit.estimate import Estimate
    from rds.identification.logs.log import Log
    from rds.identification.structures.structure import Structure

PAGE, NUMBERS = "fit.html", "fit.json"
_POINTS = 20_000  # that a line of a picture is drawn with


def write_fit(folder: Path, estimate: Estimate, logs: Sequence[Log], structure: Structure) -> list[Path]:
    """Write the page, a picture for each log and the numbers into `folder`, all or none; the page is first."""
    pictures = []
    for number, log in enumerate(named_apart(logs), 1):
        run = free_run_picture(estimate, log, structure).png()
        pictures.append(_Drawn(f"fit-{number}.png", log.name, "measured and free run", run))
        if estimate.method == "frequency":
            bode = _bode(estimate, log, structure).png()
            pictures.append(_Drawn(f"bode-{number}.png", f"{log.name}: frequency response", "Bode diagram", bode))
    files = {PAGE: _page(estimate, pictures).encode(), NUMBERS: json.dumps(to_json(estimate), indent=2).encode()}
    files |= {picture.file: picture.png for picture in pictures}
    write_files({folder / name: data for name, data in files.items()})
    return [folder / name for name in files]


class _Drawn(NamedTuple):
    file: str
    title: str
    shows: str  # in words, for who does not see it
    png: bytes


def _bode(estimate: Estimate, log: Log, structure: Structure) -> Picture:
    from rds.identification.fit.frequency_plot import bode_picture
    from rds.identification.fit.frequency_response import frequency_response

    is_rate = structure.is_rate
    response = frequency_response(log, is_rate, estimate.details["period"])
    return bode_picture(response, estimate.values(), is_rate, estimate.parameters["K"].unit)


def free_run_picture(estimate: Estimate, log: Log, structure: Structure) -> Picture:
    """Measurement and free run, their difference, and the command, over time."""
    from rds.core.figure import BLUE, RESPONSES, VERMILLION, Picture, dress, legend

    modelled = structure.respond(log.time, log.command, estimate.initial_state[log.name], estimate.values())
    every = slice(None, None, max(1, len(log) // _POINTS))
    t, unit = log.time[every], structure.output_unit
    picture = Picture(7.0)
    response, error, command = picture.subplots(3, 1, sharex=True, height_ratios=(2.2, 1.2, 1.0))
    response.plot(t, log.position[every], label="measured", **RESPONSES["measured"])
    response.plot(t, modelled[every], label="free run of the fitted model", **RESPONSES["modelled"])
    dress(response, f"{'speed' if structure.is_rate else 'position'} [{unit}]", None)
    legend(response)
    error.plot(t, (log.position - modelled)[every], color=VERMILLION, linewidth=0.8)
    dress(error, f"measured - model [{unit}]", None)
    command.plot(t, log.command[every], color=BLUE, linewidth=0.9, drawstyle="steps-post")
    dress(command, f"command [{log.units.get('command', 'V')}]")
    return picture


def _page(estimate: Estimate, pictures: Sequence[_Drawn]) -> str:
    title = f"Fit of {described(estimate)} to {', '.join(estimate.free_run)}"
    images = [f"<section><h2>{escape(drawn.title)}</h2>{image(drawn.png, drawn.shows)}</section>" for drawn in pictures]
    return page(title, f"<header><h1>{escape(title)}</h1></header>{fragment(estimate)}{''.join(images)}")


def fragment(estimate: Estimate) -> str:
    """The estimate as HTML without a page around it, for a notebook or another report; all text is escaped."""
    doubts = [*estimate.unidentifiable, *estimate.warnings]
    parts = [
        f'<p class="about">Method: {escape(estimate.method)}; {len(estimate.logs)} '
        f"{'log' if len(estimate.logs) == 1 else 'logs'}.</p>",
        table(*parameter_rows(estimate)),
        f"<h2>To doubt</h2>{notes_list(doubts)}" if doubts else "",
        f"<h2>On the data that were fitted</h2>{table(*error_rows(estimate), note=note(estimate))}",
        f"<h2>Correlation of the estimates</h2>{table(*correlation_rows(estimate))}",
    ]
    return f"<section>{''.join(parts)}</section>"
