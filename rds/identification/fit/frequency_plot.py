"""A frequency response as a picture: magnitude, phase with 95 % bands, coherence, and the model through them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from rds.core.figure import BLUE, GREEN, VERMILLION, Picture, dress, legend
from rds.identification.fit.frequency_response import model_response

if TYPE_CHECKING:
    from rds.identification.fit.frequency_response import FrequencyResponse


def bode_picture(
    response: FrequencyResponse, values: Mapping[str, float] | None = None, is_rate: bool = False, unit: str = ""
) -> Picture:
    """Bode diagram of `response`; with `values` (tau, K, delay) the model's beside it. `unit` is that of K."""
    picture = Picture(9.0)
    magnitude, phase, coherence = picture.subplots(3, 1, sharex=True, height_ratios=(3, 3, 2))
    f, unit = response.frequency, unit or ("(rev/min)/V" if is_rate else "(mm/s)/V")
    low, high = response.magnitude_band
    size = np.abs(response.response)
    magnitude.fill_between(
        f, np.maximum(low, 1e-6 * size), high, color=BLUE, alpha=0.25, linewidth=0, label="95 % band"
    )
    magnitude.loglog(f, size, ".", color=BLUE, markersize=4, label="measured")
    angle, reach = response.phase, response.phase_error
    phase.fill_between(f, angle - reach, angle + reach, color=BLUE, alpha=0.25, linewidth=0)
    phase.semilogx(f, angle, ".", color=BLUE, markersize=4)
    if values is not None:
        fine = np.geomspace(f[0], f[-1], 400)
        model = model_response(fine, response.sample_period, values, is_rate)
        line = {"color": VERMILLION, "linewidth": 1.3, "linestyle": (0, (5, 2))}
        magnitude.loglog(fine, np.abs(model), label="model", **line)
        phase.semilogx(fine, np.rad2deg(np.unwrap(np.angle(model))), **line)
    coherence.semilogx(f, response.coherence, color=GREEN, linewidth=1.3)
    coherence.set_ylim(min(0.9, float(response.coherence.min()) - 0.02), 1.005)
    dress(
        magnitude,
        f"{'speed' if is_rate else 'velocity'} over {'voltage' if unit.endswith('/V') else 'command'} [{unit}]",
        None,
    )
    dress(phase, "phase [°]", None)
    dress(coherence, "coherence", "frequency [Hz]")
    legend(magnitude)
    return picture
