"""Histograms as SVG for pages: how many of a class have which number of points."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

_WIDTH, _HEIGHT, _LEFT, _BOTTOM, _TOP = 400, 130, 30, 30, 14  # px
_BINS = 10

STYLE = """
.histogram { width: 400px; max-width: 100%; height: auto; font: 11px system-ui, sans-serif; }
.histogram text { fill: var(--dim); } .histogram rect { fill: #0072B2; } .histogram path { stroke: var(--line); }
.histogram .mark { fill: var(--ink); stroke: none; }
"""


def histogram(values: Sequence[float], most: float, bins: int = _BINS, mark: float | None = None) -> str:
    """Points from 0 to `most` in `bins` equal parts; full points belong to the last part. SVG for a page with `STYLE`.

    Every bar says how many it stands for. A needle at the bottom shows `mark`, in points.
    """
    most = most if most > 0.0 else 1.0
    counts = [0] * bins
    for value in values:
        counts[min(max(int(value / most * bins + 1e-9), 0), bins - 1)] += 1
    highest = max(max(counts), 1)
    wide, high = (_WIDTH - _LEFT) / bins, _HEIGHT - _TOP - _BOTTOM
    parts = []
    for k, count in enumerate(counts):
        tall = high * count / highest
        x = _LEFT + k * wide
        parts.append(f'<rect x="{x + 1:.1f}" y="{_TOP + high - tall:.1f}" width="{wide - 2:.1f}" height="{tall:.1f}"/>')
        if count:
            at = _TOP + high - tall - 3
            parts.append(f'<text x="{x + wide / 2:.1f}" y="{at:.1f}" text-anchor="middle">{count}</text>')
    for k in range(0, bins + 1, ceil(bins / 5)):
        at = _LEFT + k * wide
        parts.append(f'<text x="{at:.1f}" y="{_HEIGHT - 16}" text-anchor="middle">{most * k / bins:.4g}</text>')
    parts.append(f'<path d="M{_LEFT} {_TOP + high}H{_WIDTH}"/>')
    if mark is not None:
        at = _LEFT + (_WIDTH - _LEFT) * min(max(mark / most, 0.0), 1.0)
        parts.append(f'<path class="mark" d="M{at:.1f} {_TOP + high}l-5 9h10z"/>')
    parts.append(f'<text x="{(_LEFT + _WIDTH) / 2}" y="{_HEIGHT - 3}" text-anchor="middle">points</text>')
    said = f"{len(values)} students, from 0 to {most:.4g} points: {', '.join(map(str, counts))}"
    return (
        f'<svg class="histogram" viewBox="0 0 {_WIDTH + 12} {_HEIGHT}" role="img" aria-label="{said}">'
        f"{''.join(parts)}</svg>"
    )
