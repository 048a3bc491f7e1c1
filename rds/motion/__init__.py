"""Motion: from path segments to the samples of all axes, within each axis's velocity, acceleration and jerk.

`rds.motion.segments` describes the programmed path, `rds.motion.limits` what the axes can do; `plan` turns both into
samples.
"""

from rds.motion.limits import Limits
from rds.motion.planner import plan, predicted_time
from rds.motion.samples import SampleBlock

__all__ = ["Limits", "SampleBlock", "plan", "predicted_time"]
