"""What a cut came to, in words and numbers: the tools, what goes wrong by line, the part against the intended one."""

from __future__ import annotations

from html import escape

from rds.panels.program.stock import WALLS, Cut
from rds.results import html

_MOST = 12  # faults that are listed
_HEADS = ["tool", "removed [mm³]", "in material [s]", "deepest [mm]", "most [mm³/s]", "in line", "per tooth [mm]"]


def cut_html(cut: Cut | None, trouble: str = "", measured: bool = False) -> str:
    """Of the program, or of what was `measured`; `trouble` is why there is no cut."""
    if cut is None:
        return f'<p role="alert">✖ no cut: {escape(trouble)}</p>' if trouble else ""
    rows = [
        [
            *(f"T{load.tool.number} {load.tool.said}", f"{load.volume:.1f}", f"{load.seconds:.1f}"),
            *(f"{load.depth:.3f}", f"{load.rate:.2f}", load.rate_line or "–"),
            f"{load.feed_per_tooth:.4f}" if load.feed_per_tooth else "–",
        ]
        for load in cut.loads
    ]
    title = "The cut as measured, by tool" if measured else "The cut, by tool"
    return html.table(_HEADS, rows, title) + _faults(cut) + _part(cut, measured) + _assumed(cut)


def _faults(cut: Cut) -> str:
    if not cut.faults:
        return '<p class="rds-cut">✔ nothing goes through material that must not</p>'
    found = "".join(f"<li>⚠ {escape(str(fault))}</li>" for fault in cut.faults[:_MOST])
    more = len(cut.faults) - _MOST
    return f'<ul class="rds-cut">{found}</ul>' + (f"<p>and {more} more</p>" if more > 0 else "")


def _part(cut: Cut, measured: bool) -> str:
    if not measured and not cut.part_name:
        return ""  # it is what is cut
    found = cut.difference
    name = f"the part {cut.part_name}" if cut.part_name else "the part as programmed"
    sign = "✔" if max(found.highest, found.deepest) <= WALLS else "⚠"
    said = [f"{sign} against {name}"]
    for what, volume, most, (x, y) in (
        ("left above it", found.left, found.highest, found.highest_at),
        ("cut below it", found.gouged, found.deepest, found.deepest_at),
    ):
        said.append(f"{what} {volume:.2f} mm³ beyond {WALLS:g} mm, at most {most:.3f} mm at X {x:.2f} Y {y:.2f}")
    return f"<p>{escape('; '.join(said))}</p>"


def _assumed(cut: Cut) -> str:
    if not cut.assumed:
        return ""
    names = ", ".join(f"T{number}" if number else "no tool" for number in cut.assumed)
    return f"<p>{escape(names)}: no table gives it a shape; an end mill of 6 mm is assumed</p>"
