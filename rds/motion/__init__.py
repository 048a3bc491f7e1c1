"""Motion: from path segments to the samples of all axes, within each axis's velocity, acceleration and jerk.

`rds.motion.segments` describes the programmed path, `rds.motion.limits` what the axes can do, `rds.motion.plan` turns
both into samples.
"""
