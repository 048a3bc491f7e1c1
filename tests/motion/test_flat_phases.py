"""Phases of the speed profile that differ by rounding only, as long chains of lines and arcs make them."""

from __future__ import annotations

from math import nextafter, sqrt

import numpy as np
import pytest

from rds.interpolators.motion.profile import hold_tops, phases_of


def test_a_top_beside_a_speed_one_bit_lower_is_held() -> None:
    below = nextafter(5.0, 0.0)
    phases = np.array([[1.0, 0.0, below], [1e-9, below, below], [1e-9, 5.0, 5.0], [1.0, 5.0, 0.0]])
    held = hold_tops(phases.copy(), 0.02)
    assert held[:, 0].sum() == pytest.approx(2.0 + 2e-9)
    assert held[0, 1] == 0.0 and held[-1, 2] == 0.0
    top = held[:, 1:].max()
    flat = held[(held[:, 1] == top) & (held[:, 2] == top), 0].sum()
    assert flat >= top * 0.02 * (1 - 1e-9)


@pytest.mark.parametrize("slows", [True, False])
def test_a_line_that_is_entered_at_its_speed_less_one_bit_is_passed_at_it(slows: bool) -> None:
    """It was one ramp of its whole length, at 0.08 instead of 200 mm/s²: the line took twice its time."""
    feed, way = 1.4, 12.5
    below = nextafter(feed, 0.0)
    ends = np.array([below, 0.0] if slows else [0.0, below])
    phases = phases_of(np.array([0.0, way]), np.array([feed]), np.array([200.0]), ends)
    assert phases[:, 0].sum() == pytest.approx(way)
    assert (2.0 * phases[:, 0] / (phases[:, 1] + phases[:, 2])).sum() < way / feed + feed / 200.0


def test_a_line_that_is_one_ramp_stays_one() -> None:
    way, push = 1e-3, 200.0
    reached = sqrt(2.0 * push * way)
    for ends in ([0.0, reached], [reached, 0.0]):
        phases = phases_of(np.array([0.0, way]), np.array([nextafter(reached, 1.0)]), np.array([push]), np.array(ends))
        assert len(phases) == 1 and phases[0, 0] == way
