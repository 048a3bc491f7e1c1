"""Quantities that more than one room takes, each with its one range."""

from __future__ import annotations

from rds.core.quantities import Quantity

SAMPLE_PERIOD = Quantity("time from one sample to the next", "s", 1e-6, 1000.0)
DURATION = Quantity("length of the run", "s", 0.0, 1e9)
NODE = Quantity("CAN node of the axis, different for each; a dialect may take fewer", "", 1, 127, whole=True)
FEED_RATE = Quantity("feed rate along the path", "mm/s", 1e-6, 1e6)
FEED_OVERRIDE = Quantity("feed as a share of the programmed one", "%", 0.0, 200.0, default=100.0, live=True)
# Who has a say in it: the operator; the program alone (M49); the turning spindle, in threads and taps, for which a
# hold, a step and the way home wait as well.
FREE_FEED, LOCKED_FEED, TIED_FEED = 0.0, 1.0, 2.0
FEED_SHARE = Quantity("multiple of the programmed feed", "", 0.0, FEED_OVERRIDE.high / 100.0, default=1.0, live=True)
CLOCK_DRIFT = Quantity("how much faster a node's clock runs than true time", "ppm", -10_000.0, 10_000.0, default=0.0)
