"""A friction curve as a picture: the steady stretches as points, the fitted curve of each direction."""

from __future__ import annotations

import numpy as np

from rds.core.figure import BLUE, VERMILLION, Picture, dress, legend
from rds.identification.fit.friction_curve import FrictionCurve

_COLOURS = {"forward": BLUE, "backward": VERMILLION}


def friction_picture(curve: FrictionCurve) -> Picture:
    """Friction over speed, both directions."""
    picture = Picture(9.0)
    axes = picture.subplots(1, 1)
    for way, sign in (("forward", 1.0), ("backward", -1.0)):
        points = [p for p in curve.points if sign * p.speed > 0.0]
        if not points:
            continue
        v, f, e = (np.array([getattr(p, name) for p in points]) for name in ("speed", "force", "error"))
        axes.errorbar(v, f, yerr=2.0 * e, fmt="o", markersize=3, color=_COLOURS[way], label=way)
        if way in curve.directions:
            fine = np.linspace(float(np.abs(v).min()), float(np.abs(v).max()), 300)
            axes.plot(sign * fine, curve.at(sign * fine, way), color=_COLOURS[way], linewidth=1.2)
    dress(axes, f"friction [{curve.force_unit}]", f"speed [{curve.speed_unit}]")
    legend(axes, 2)
    return picture
