"""Fits of a linear law alone: which orders are tried, by what they depart, how far their poles may grow."""

from __future__ import annotations

import numpy as np
import pytest

from rds.grading.criteria.law_fit import LawFit, _bounded, departure, law_fits


def test_orders_grow_until_a_law_is_exact_or_none_departs_less() -> None:
    from scipy.signal import lfilter

    rng = np.random.default_rng(1)
    position = lfilter([0.01], [1.0, -0.9], rng.standard_normal(400))
    voltage = lfilter([-5.0, 4.0, 0.5], [1.0, -1.2, 0.3], position)

    def orders(voltage: np.ndarray, part: slice = slice(None), exactly: bool = False) -> list[int]:
        return [len(fit.a) - 1 for fit in law_fits(voltage, position[: len(voltage)], part, exactly)]

    assert orders(voltage) == orders(voltage, slice(100, 140)) == orders(voltage, exactly=True) == [0, 1, 2]
    assert orders(voltage[:11]) == [0] and orders(voltage[:12]) == [0, 1]  # four samples for each unknown
    assert orders(voltage, slice(389, None)) == [0] and orders(voltage, slice(388, None)) == [0, 1]
    assert orders(0.0 * voltage) == orders(np.nan * voltage) == []
    later = np.where(np.arange(400) < 140, voltage, 9.0)
    assert orders(later, slice(100, 140)) == [0, 1, 2]  # what comes after a part is none of its law
    sixth = lfilter([1.0], np.poly([0.9, 0.8, 0.7, -0.5, -0.6, 0.3]), position)
    assert orders(sixth)[-1] == 6 and 6 not in orders(sixth, exactly=True)
    noise = rng.standard_normal(400)
    for fit in law_fits(1e3 * noise, position):
        assert fit.departure == pytest.approx(1.0, abs=0.02)  # as a share, of the answer's size
    assert orders(noise) == [0, 1, 2] and orders(noise, exactly=True) == [0, 1, 2, 3, 4]
    assert orders(np.round(voltage, 2)) == [0, 1, 2, 3, 4]


def test_a_law_departs_as_in_the_worst_of_its_parts() -> None:
    fit, position = LawFit(np.array([1.0, -0.5]), np.array([-4.0, 0.0]), 0.1), np.ones(400)
    own = -8.0 * (1.0 - 0.5 ** np.arange(1.0, 401.0))
    doubled = own * np.where(np.arange(400) < 200, 1.0, 2.0)
    found = [departure(fit, each, position, slice(None), 2) for each in (own, doubled, own / 2.0, np.inf * own)]
    assert found == pytest.approx([0.0, 0.5, 0.5, 1.0], abs=1e-12)
    assert departure(fit, doubled, position, slice(0, 200), 2) < 1e-12
    assert departure(fit, doubled, position, slice(None), 1) == 0.1
    assert departure(fit, 0.0 * own, 0.0 * position, slice(None), 2) == 0.0


def test_poles_that_grow_are_moved_into_the_unit_circle() -> None:
    poles = sorted(np.abs(np.roots(_bounded(np.poly([-2.0, 0.5, 1.0, 1.2 + 0.9j, 1.2 - 0.9j])))))
    assert poles == pytest.approx([0.5, 0.98, 0.98, 0.98, 1.0])
    kept = np.poly([1.0, 0.5])
    assert _bounded(kept) is kept
