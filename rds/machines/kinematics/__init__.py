"""Kinematics of machines: the chain from the work to the tool, forward, inverse, Jacobian, singularities, workspace."""

from rds.machines.kinematics.build import identity_of, kinematics_of
from rds.machines.kinematics.kinematics import Kinematics

__all__ = ["Kinematics", "identity_of", "kinematics_of"]
