"""The certificate of a motion as a picture: what holds it back along the path, how much of each limit is used when."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rds.core.private_files import open_private
from rds.interpolators.motion.segments import AXES

if TYPE_CHECKING:
    from rds.interpolators.motion.certificate import Certificate
    from rds.interpolators.motion.limiting import LimitingCauses


def plot_certificate(
    certificate: Certificate, path: str | Path | None = None, explained: LimitingCauses | None = None
) -> Any:
    """Largest velocity, acceleration and jerk of each axis in % of its limit, and the deviation from the path, over
    time. Above them, with `explained`, the speeds along the path, what holds them back, and what would save a second.

    Saved as PNG at `path` if given.
    """
    from rds.core.figure import CYCLE, GREY, VERMILLION, Picture, dress, legend

    trace = certificate.trace()
    if explained is None:
        drawn = Picture(7.6)
        grid = drawn.subplots(4, 1, sharex=True)
    else:
        # inches: of the causes each is one line of text
        lines = max(0.24 * (len(explained.limiting.seconds) + 1), 1.7)
        drawn = Picture(10.3 + lines)
        top, below, *grid = drawn.subplots(6, 1, height_ratios=[2.55, lines, 1.7, 1.7, 1.7, 1.7])
        explained.limiting.draw(top, below)
        drawn.suptitle("\n".join(explained.savings()), fontsize="medium")
        below.sharex(top)
        for axes in grid[1:]:
            axes.sharex(grid[0])
    time = trace[:, 0]
    styles = ("-", (0, (5, 2)), (0, (1, 1.5)), (0, (6, 1.5, 1, 1.5)), (0, (3, 1)), (0, (8, 2)))
    for row, kind in enumerate(("velocity", "acceleration", "jerk")):
        for i, axis in enumerate(AXES):
            if certificate.limits.velocity[i] > 0.0:
                worst = certificate.worst.get((kind, axis))
                label = f"{axis}, at most {100 * worst.share:.1f} % in line {worst.line}" if worst else axis
                values = 100.0 * trace[:, 1 + 6 * row + i]
                grid[row].step(
                    time, values, where="post", color=CYCLE[i], linestyle=styles[i], linewidth=1.1, label=label
                )
        grid[row].axhline(100.0, color=GREY, linewidth=0.9)
        grid[row].set_ylim(0.0, None)
        dress(grid[row], f"{kind} [% of limit]", None)
        legend(grid[row], 3)
    worst = certificate.worst.get(("deviation", ""))
    label = f"at most {1000.0 * worst.value:.3g} µm in line {worst.line}" if worst else "deviation"
    grid[3].step(time, 1000.0 * trace[:, 19], where="post", color=VERMILLION, linewidth=1.1, label=label)
    grid[3].set_ylim(0.0, max(1.05e3 * trace[:, 19].max(initial=0.0), 0.001))
    dress(grid[3], "off the path [µm]")
    legend(grid[3])
    drawn.align_ylabels()
    if path is not None:
        with open_private(path, "wb") as stream:
            drawn.savefig(stream, format=Path(path).suffix.removeprefix(".") or "png")
    return drawn
