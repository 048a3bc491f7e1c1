"""A recorded step as a picture: the response, the tangent at its steepest point, delay and time constant."""

from __future__ import annotations

from rds.bus.modules.oacs.tuning import reaction_curve
from rds.core.errors import InputError
from rds.core.figure import RESPONSES, VERMILLION, Picture, dress, legend, quantity
from rds.results import Result


def plot(result: Result) -> Picture:
    """The response of the first axis, and what its tangent says (`tuning.reaction_curve`), or why it says nothing."""
    name = result.axes[0]
    time, measured = result["time"], result[f"{name}_measured"]
    unit = result.units.get(f"{name}_measured", "")
    picture = Picture(4.2)
    axes = picture.subplots()
    for kind in ("reference", "measured"):
        axes.plot(time, result[f"{name}_{kind}"], label=kind, **RESPONSES[kind])
    try:
        curve = reaction_curve(time, measured)
    except InputError as error:
        axes.plot([], [], " ", label=f"no delay and time constant: {str(error).partition(';')[0]}")
    else:
        ends = [curve.delay, curve.delay + curve.time_constant]
        label = f"tangent: delay {1e3 * curve.delay:.3g} ms, time constant {1e3 * curve.time_constant:.3g} ms"
        axes.plot(
            ends, [measured[0], measured[-1]], color=VERMILLION, linewidth=1.3, linestyle=(0, (5, 2)), label=label
        )
        for end in ends:
            axes.axvline(end, color=VERMILLION, linewidth=0.8, linestyle=":")
    dress(axes, quantity(name, unit))
    legend(axes, columns=3)
    return picture
