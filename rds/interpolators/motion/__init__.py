"""Motion: from path segments to the samples of all axes, within each axis's velocity, acceleration and jerk.

`rds.interpolators.motion.segments` describes the programmed path, `rds.interpolators.motion.limits` what
the axes can do; `plan` turns both into samples.
"""

from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.planner import plan, predicted_time
from rds.interpolators.motion.samples import SampleBlock

__all__ = ["Limits", "SampleBlock", "plan", "predicted_time"]
