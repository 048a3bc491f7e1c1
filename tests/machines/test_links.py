"""Links in machine files: what they say, what is refused with its line; a machine without them stays as it was."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from machines.machine_text import link, machine

from rds.core.errors import InputError
from rds.machines import load_machine
from rds.machines.kinematics.transform import numbers_of, transformation
from rds.machines.library import library


def test_a_link_is_equation_1() -> None:
    """By hand: XA = γ, YA = β, ZA = α in equation (1) of mrm-control."""
    gamma, beta, alpha = np.radians([10.0, 20.0, 30.0])
    ca, sa, cb, sb, cg, sg = (f(x) for x in (alpha, beta, gamma) for f in (np.cos, np.sin))
    equation_1 = [
        [ca * cb, ca * sb * sg - sa * cg, ca * sb * cg + sa * sg, 1.0],
        [sa * cb, sa * sb * sg + ca * cg, sa * sb * cg - ca * sg, 2.0],
        [-sb, cb * sg, cb * cg, 3.0],
        [0.0, 0.0, 0.0, 1.0],
    ]
    made = transformation([10.0, 20.0, 30.0, 1.0, 2.0, 3.0])
    np.testing.assert_allclose(made, equation_1, atol=1e-15)
    np.testing.assert_allclose(numbers_of(made), [10.0, 20.0, 30.0, 1.0, 2.0, 3.0], atol=1e-9)


def test_a_machine_without_links_stays_what_it_is() -> None:
    mini = load_machine("mini-cnc")
    assert (mini.links, mini.tool, mini.work) == ((), None, None)
    np.testing.assert_array_equal(mini.kinematics.forward([1.0, 2.0, 3.0])[:3, 3], [1.0, 2.0, 3.0])


def test_the_thesis_s_chain_is_the_product_of_its_matrices() -> None:
    """Equation 7.11 with equations 7.12 to 7.16, the arm's -370 and the drill's -75 from tables A27 and A26."""
    x, z, a = 583.0 + 20.0, 385.0 - 40.0, np.radians(30.0)
    shift = lambda *by: np.block([[np.eye(3), np.array(by)[:, None]], [0, 0, 0, 1]])  # noqa: E731
    turned = np.array([[np.cos(a), -np.sin(a), 0, 0], [np.sin(a), np.cos(a), 0, 0], [0, 0, 1, -152.0], [0, 0, 0, 1]])
    expected = turned @ shift(x, 0, -111) @ shift(-54.5, 0, z) @ shift(-370, 0, 0) @ shift(-75, 0, -81.5)
    got = load_machine("mrmt-oacs").kinematics.forward({"X": 20.0, "Z": -40.0, "A": 30.0})
    np.testing.assert_allclose(got, expected, atol=1e-12)


def test_an_assembly_error_is_added_to_the_numbers(tmp_path: Path) -> None:
    """Equation (3): α + 10, and 75 - 5."""
    right = machine(tmp_path, "C", link(axis="C", joint="ZA") + link(name="head", offset=[0.0, 0.0, 70.0]))
    other = machine(
        tmp_path,
        "C",
        link(axis="C", joint="ZA", error_angles=[0.0, 0.0, 10.0])
        + link(name="head", offset=[0.0, 0.0, 75.0], error_offset=[0.0, 0.0, -5.0]),
    )
    np.testing.assert_allclose(other.kinematics.forward([20.0]), right.kinematics.forward([30.0]), atol=1e-12)


@pytest.mark.parametrize(("theta", "d", "a", "alpha"), [(20.0, 40.0, 150.0, 90.0), (-75.0, -3.0, 12.5, -30.0)])
def test_a_row_of_denavit_and_hartenberg_is_two_links(
    tmp_path: Path, theta: float, d: float, a: float, alpha: float
) -> None:
    """Equation 7.8 of oacs-thesis, with the axis adding to θ, and to d."""
    arm = link(name="arm", angles=[alpha, 0.0, 0.0], offset=[a, 0.0, 0.0])
    stands = {"angles": [0.0, 0.0, theta], "offset": [0.0, 0.0, d]}
    for joint, axis, q in (("ZA", "A", 33.0), ("Z", "Z", 7.0)):
        own = machine(tmp_path, axis, link(axis=axis, joint=joint, **stands) + arm)
        angle, shift = np.radians(theta + (q if axis == "A" else 0.0)), d + (q if axis == "Z" else 0.0)
        (c, s), (ca, sa) = (np.cos(angle), np.sin(angle)), (np.cos(np.radians(alpha)), np.sin(np.radians(alpha)))
        meant = [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, shift], [0, 0, 0, 1]]
        np.testing.assert_allclose(own.kinematics.forward({axis: q}), meant, atol=1e-9)


X = link(axis="X", joint="X")


@pytest.mark.parametrize(
    ("axes", "links", "says"),
    [
        ("X", "[[link]]\n", "needs a name, a module or an axis"),
        ("X", X + link(axis="X", joint="X", name="Y"), "moves link 'X' already"),
        ("X", link(axis="U", joint="X"), "'U' is no axis of the machine; axes: X"),
        ("X", link(axis="X"), "joint is missing"),
        ("X", link(axis="X", joint="XA"), "needs unit = \"deg\", and X has 'mm'"),
        ("A", link(axis="A", joint="X"), "its axis is in mm, and A has 'deg'"),
        ("X", link(axis="X", joint="Q"), "is unknown; known: XA, YA, ZA, X, Y, Z"),
        ("X", link(name="a", joint="X"), "belongs to a link that moves"),
        ("X", link(name="a", limits=[0.0, 1.0]), "belongs to a link that moves"),
        ("X", link(axis="X", joint="X", limits=[0.0, 101.0]), "within the axis's travel, -100 to 100"),
        ("X", link(axis="X", joint="X", sign=0), "must be 1 or -1"),
        ("X", X + link(name="a", parent="Z"), "is no link before this one; those are bed, X"),
        ("X", X + X, "two links are called 'X'"),
        ("X", link(name="bed"), "two links are called 'bed'"),
        ("X", X + link(name="a", ofset=[0, 0, 0]), "unknown key 'ofset'"),
        ("X", X + link(name="a", offset=[0, 0]), "[X, Y, Z], three lengths in mm"),
        ("X", X + '[tool]\nlink = "head"\n', "is no link; links: bed, X"),
        ("X", "[tool]\noffset = [0, 0, 1]\n", "[tool] needs links"),
    ],
)  # fmt: skip
def test_what_is_refused_as_it_is_read(tmp_path: Path, axes: str, links: str, says: str) -> None:
    with pytest.raises(InputError) as refusal:
        machine(tmp_path, axes, links)
    assert says in str(refusal.value)
    assert "line" in str(refusal.value)


@pytest.mark.parametrize(
    ("links", "says"),
    [
        (link(name="a", matrix=[[1, 0, 0, 0], [0, 2, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), "no rigid motion"),
        (link(name="a", matrix=[[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), "no rigid motion"),
        (link(module="slide-q"), "there is no module 'slide-q'"),
        (link(module="vice", axis="X"), "its module vice is fixed"),
        (link(module="rotary-a", axis="X"), "needs unit = \"deg\""),
    ],
)  # fmt: skip
def test_what_is_refused_when_the_chain_is_built(tmp_path: Path, links: str, says: str) -> None:
    with pytest.raises(InputError) as refusal:
        _ = machine(tmp_path, "X", links).kinematics
    assert says in str(refusal.value)
    assert "line" in str(refusal.value)


def test_the_library_has_the_tables_of_the_thesis() -> None:
    """Tables A23 to A27, at the axes' zero: offsets and joints."""
    offsets = {name: [row[3] for row in module.matrix[:3]] for name, module in library().items() if module.matrix}
    assert offsets == {
        "oacs-x": [583, 0, -111], "oacs-z": [-54.5, 0, 385], "oacs-a": [0, 0, -152], "oacs-drill": [-75, 0, -81.5],
        "oacs-range-arm": [-370, 0, 0],
    }  # fmt: skip
    assert (library()["oacs-x"].travel, library()["oacs-z"].travel) == ((433 - 583, 733 - 583), (85 - 385, 685 - 385))
