"""Phases of the speed profile that differ by rounding only, as long chains of lines and arcs make them."""

from __future__ import annotations

from math import nextafter

import numpy as np
import pytest

from rds.interpolators.motion.profile import hold_tops


def test_a_top_beside_a_speed_one_bit_lower_is_held() -> None:
    below = nextafter(5.0, 0.0)
    phases = np.array([[1.0, 0.0, below], [1e-9, below, below], [1e-9, 5.0, 5.0], [1.0, 5.0, 0.0]])
    held = hold_tops(phases.copy(), 0.02)
    assert held[:, 0].sum() == pytest.approx(2.0 + 2e-9)
    assert held[0, 1] == 0.0 and held[-1, 2] == 0.0
    top = held[:, 1:].max()
    flat = held[(held[:, 1] == top) & (held[:, 2] == top), 0].sum()
    assert flat >= top * 0.02 * (1 - 1e-9)
