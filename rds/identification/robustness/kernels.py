"""Many closed loops of one axis in machine code: the functions of the ordinary loop, and sums instead of samples.

Every sample is the ordinary simulation's to the last bit. One thread can run a stretch of the draws without holding
the interpreter's lock, so as many stretches run at once as there are processors.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

from rds.machines import converter

LIMIT = 1e9  # of a position, in the axis's unit: what is beyond has diverged


@lru_cache
def sweep(law: Callable[..., Any], motion: str) -> Callable[..., None]:
    """The compiled loops under `law` with the "linear-axis" or the "machine-axis" in motion.

    `constants` (draws, n) are those of the motion's one-sample function; `wait` (draws) whole samples of delay.
    Fills `rows` (draws, 4) with the figures of `figures.TRACKING`; infinite errors mean that it diverged.
    """
    from numba import njit

    from rds.models.linear_axis import respond
    from rds.models.machine_model import sampled
    from rds.models.machine_motion import moved, pull_of

    law = njit(law)
    counted, converted = converter.compiled()
    if motion == "linear-axis":
        step_linear = njit(respond)

        @njit
        def move(x, w, z, before, now, c):
            x, w = step_linear(x, w, now, c[0], c[1], c[2], c[3], c[4], c[5], c[6])
            return x, w, z

    else:
        pulls, moves = njit(pull_of), njit(moved)
        # `sampled` itself calls Python functions by their global names; bound to compiled ones here
        step_machine = njit(_bound(sampled, pull_of=pulls, moved=moves))

        @njit
        def move(x, w, z, before, now, c):
            return step_machine(
                x, w, z, before, now, c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8], c[9], c[10], c[11], c[12]
            )

    @njit(nogil=True)
    def simulate(p, v, a, coefficients, state0, constants, wait, start, limits, resolution, first, T, rows):
        low, high, step = limits
        for i in range(len(constants)):
            c, whole = constants[i], wait[i]
            x, w, z = start
            state = state0
            waiting = [0.0] * (whole + 2)
            worst, squares, peak, saturated = 0.0, 0.0, 0.0, 0
            diverged = False
            for k in range(len(p)):
                y = counted(x, resolution)
                u, state = law(p[k], v[k], a[k], y, state, coefficients)
                e = p[k] - y
                if k >= first:
                    worst = max(worst, abs(e))
                    squares += e * e
                peak = max(peak, abs(u))
                if u <= low or u >= high:
                    saturated += 1
                u = converted(u, low, high, step)
                if whole == 0:
                    before, now = waiting[0], u
                    waiting[0] = u
                else:
                    for j in range(whole + 1):
                        waiting[j] = waiting[j + 1]
                    waiting[whole + 1] = u
                    before, now = waiting[0], waiting[1]
                x, w, z = move(x, w, z, before, now, c)
                if not abs(x) < LIMIT:
                    diverged = True
                    break
            rows[i, 0] = float("inf") if diverged else worst
            rows[i, 1] = float("inf") if diverged else (squares / (len(p) - first)) ** 0.5
            rows[i, 2] = peak
            rows[i, 3] = saturated * T

    compiled: Callable[..., None] = simulate
    return compiled


def _bound(function: Callable[..., Any], **names: Any) -> Callable[..., Any]:
    """The same function with other globals."""
    from types import FunctionType

    assert isinstance(function, FunctionType)
    return FunctionType(function.__code__, function.__globals__ | names, function.__name__, function.__defaults__)
