"""Cutting parameters: equations 5.3 to 5.6 of dcs-thesis, and what of its tables 5.3 and 5.4 follows from them."""

from __future__ import annotations

import pytest
from hypothesis import assume, given
from hypothesis.strategies import floats

from rds.core.errors import InputError
from rds.machines.forces.milling import cut, largest_feed, warnings

# Tables 5.1, 5.3 and 5.4: the tool of 6 mm with two teeth, a_e = 1, a_p = 6, 14 degrees, aluminium.
THESIS = {"speed": 2000, "teeth": 2, "depth": 6, "width": 1, "diameter": 6, "kc11": 700, "mc": 0.25, "rake": 14}
FEED, ENGAGED = 0.59, 180.0
SPINDLE, FASTEST = 0.16, 1200.0  # kW, mm/min


def test_the_thesis_chip_thickness_does_not_follow_from_its_feed():
    """Equation 5.6 gives 0.0626 mm where table 5.4 has 0.1."""
    made = cut(**THESIS, feed=FEED, engaged=ENGAGED)
    assert made.chip_thickness == pytest.approx(0.0626, abs=5e-5)


def test_the_thesis_specific_force_follows_from_neither_thickness():
    """Equation 5.5 gives 1070.5 N/mm² at the table's 0.1 mm, and 1203.5 at 5.6's 0.0626 mm; table 5.4 has 1796.6."""
    at_their_thickness = cut(**THESIS, feed=FEED * 0.1 / 0.0626009, engaged=ENGAGED)
    assert at_their_thickness.chip_thickness == pytest.approx(0.1, rel=1e-5)
    assert at_their_thickness.specific_force == pytest.approx(1070.5, abs=0.1)
    assert cut(**THESIS, feed=FEED, engaged=ENGAGED).specific_force == pytest.approx(1203.5, abs=0.1)


def test_the_thesis_feed_is_beyond_the_machine():
    made = cut(**THESIS, feed=FEED, engaged=ENGAGED)
    assert made.feed_speed == pytest.approx(2360.0)
    power, feed = warnings(made, SPINDLE, FASTEST)
    assert power.startswith("the cut takes 284 W, and the spindle has 160 W")
    assert feed.startswith("the feed is 2360 mm/min, and the machine does 1200 mm/min")


def test_a_side_cut_of_1_mm_is_not_engaged_over_180_degrees():
    assert cut(**THESIS, feed=FEED).engaged == pytest.approx(48.19, abs=0.01)
    assert cut(**{**THESIS, "width": 6}, feed=FEED).engaged == pytest.approx(180.0)
    assert cut(**THESIS, feed=FEED).chip_thickness == pytest.approx(0.2338, abs=1e-4)


@given(power=floats(0.01, 5.0), width=floats(0.1, 6.0))
def test_the_largest_feed_takes_exactly_the_power(power, width):
    values = {**THESIS, "width": width}
    feed = largest_feed(power, **values)
    assume(feed <= values["diameter"])  # beyond that it is no feed per tooth
    assert cut(**values, feed=feed).power == pytest.approx(power, rel=1e-9)


def test_what_160_W_allow():
    assert largest_feed(SPINDLE, **THESIS, engaged=ENGAGED) == pytest.approx(0.2745, abs=1e-4)
    slower = cut(**THESIS, feed=0.25, engaged=ENGAGED)
    assert warnings(slower, SPINDLE, FASTEST) == []


def test_power_is_torque_times_speed_and_force_times_speed():
    made = cut(**THESIS, feed=0.1, efficiency=0.8)
    omega = 2000 * 2 * 3.141592653589793 / 60
    assert made.torque * omega == pytest.approx(0.8e3 * made.power)


@pytest.mark.parametrize(
    "change, fault",
    [
        ({"width": 7}, "width = 7 mm is more than the tool's diameter of 6 mm"),
        ({"feed": 590.0}, "feed = 590 mm per tooth is more than the tool's diameter"),
        ({"feed": 0.0}, "feed = 0.0 must be more than 0 mm"),
        ({"teeth": 1.5}, "teeth = 1.5 must be a whole number"),
        ({"depht": 1.0}, "a cut has no 'depht'"),
        ({"speed": None}, "a cut needs speed"),
    ],
)
def test_impossible_cuts_are_refused(change, fault):
    with pytest.raises(InputError) as error:
        cut(**{**THESIS, "feed": 0.1, **change})
    assert fault in str(error.value)
