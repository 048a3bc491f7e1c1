"""Loads of joints link by link (equations 6 to 9), against hand calculations and virtual work through the Jacobian."""

from __future__ import annotations

from math import cos, radians, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.strategies import integers, sampled_from

from rds.machines import load_machine, machine_names
from rds.machines.forces.propagation import joint_loads
from rds.machines.kinematics.chain import Joint, joined
from rds.machines.kinematics.kinematics import Kinematics

CHAINS = {name: load_machine(name).kinematics for name in machine_names()}


@settings(max_examples=60, deadline=None)
@given(name=sampled_from(sorted(CHAINS)), seed=integers(0, 10_000))
def test_they_are_the_virtual_work_of_every_machine(name, seed):
    """τ·δq = F·δx + M·δφ for any small motion: τ = Jᵀ (F, M)."""
    chain, rng = CHAINS[name], np.random.default_rng(seed)
    q = chain.random(5, seed)
    force, torque = rng.normal(0, 100, (5, 3)), rng.normal(0, 3, (5, 3))  # N, N m
    wrench = np.concatenate([force, 1000.0 * torque], axis=1)
    expected = np.einsum("nij,ni->nj", chain.jacobian(q), wrench) / np.where(chain.turns, 1000.0, 1.0)
    assert joint_loads(chain, q, force, torque) == pytest.approx(expected, abs=1e-9)


def arm():
    """A turn about z, an arm of 300 mm along x, a slide along x, and a tool 50 mm below."""
    reach, drop = np.eye(4), np.eye(4)
    reach[0, 3], drop[2, 3] = 300.0, -50.0
    chain = joined([Joint(0, True, 2, 1), reach, Joint(1, False, 0, 1), drop])
    travel = np.array([[-180.0, 180.0], [-100.0, 100.0]])
    return Kinematics("arm", ("C", "X"), (True, False), travel, travel, chain, {})


@pytest.mark.parametrize("angle", [0.0, 30.0, 90.0, -135.0])
@pytest.mark.parametrize("slide", [0.0, 40.0])
def test_an_arm_by_hand(angle, slide):
    """A force of 80 N along the work's y: its lever about z is r cos φ, its share along the slide sin φ."""
    c, x = joint_loads(arm(), np.array([angle, slide]), np.array([0.0, 80.0, 0.0]))[0]
    assert c == pytest.approx(80.0 * 0.001 * (300.0 + slide) * cos(radians(angle)), abs=1e-9)
    assert x == pytest.approx(80.0 * sin(radians(angle)), abs=1e-9)


def test_an_orthogonal_mill_takes_the_force_axis_by_axis():
    loads = joint_loads(CHAINS["mini-cnc"], {"X": 3.0}, np.array([10.0, -20.0, 30.0]))[0]
    assert loads == pytest.approx([10.0, -20.0, 30.0])


def test_a_torque_about_the_tool_loads_only_what_turns():
    c, x = joint_loads(arm(), np.array([25.0, 10.0]), np.zeros(3), np.array([1.0, 2.0, 3.0]))[0]
    assert (c, x) == (pytest.approx(3.0), pytest.approx(0.0))
