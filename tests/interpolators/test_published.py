"""Published numbers of interpolation, and docs/interpolation.md, which gives them beside ours."""

from __future__ import annotations

import re
from math import cos, pi, sqrt

import numpy as np
import pytest
from documents import ROOT

from rds.core.types import ArcSegment
from rds.interpolators import interpolator_module, interpolator_names
from rds.interpolators.acceleration import LIBRARY as ACCELERATIONS
from rds.interpolators.acceleration import adder_output, output_pulses
from rds.interpolators.reference_word import steps

TEXT = (ROOT / "docs" / "interpolation.md").read_text(encoding="utf-8")
QUADRANT = ArcSegment((100.0, 0.0), (0.0, 100.0), (0.0, 0.0), 10.0)  # mrm-control, section 8.2
R = 100.0 / 0.01  # BLU


def table(heading: str) -> list[list[str]]:
    """The cells of the first table after a heading, without its head."""
    part = TEXT.split(f"{heading}\n", 1)[1]
    lines = [line for line in part.split("\n\n#")[0].splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def taken(name: str, count: int = 0):
    return steps(QUADRANT, {"blu": 0.01, "steps": count}, interpolator_module(name).METHOD)


@pytest.mark.parametrize(
    ("name", "published"), [("improved-tustin", 39), ("euler", 56), ("taylor", 56), ("tustin", None)]
)
def test_the_number_of_steps_by_the_formulas(name: str, published: int | None) -> None:
    formula = taken(name).formula
    assert round(formula) == (published or 56)


def test_equations_7_47_to_7_49() -> None:
    alpha = interpolator_module("improved-tustin").METHOD.formula(R)
    assert alpha == 4 / sqrt(R)  # 7.48
    assert taken("improved-tustin").formula == pytest.approx(pi / 8 * sqrt(R))  # 7.49
    assert cos(alpha / 2) == pytest.approx((R - 1) / (R + 1), abs=2e-8)  # 7.47
    # equation 15 of mrm-control: its middle agrees with this, its right side would make 3927 steps of the quadrant
    assert sqrt(16 / (R - 1)) == pytest.approx(alpha, rel=1e-4)
    assert pi / 2 / (4 / R) == pytest.approx(3927, abs=0.1)


def test_39_steps_cannot_be_within_one_blu_and_40_are() -> None:
    assert taken("improved-tustin").count == 40 and taken("improved-tustin").within
    assert not taken("improved-tustin", 39).within
    # whatever the method: a straight step within ±1 BLU of the circle turns by 2 arccos((R - 1)/(R + 1)) at most
    widest = 2 * np.arccos((R - 1) / (R + 1))
    assert 39 * widest < pi / 2 < 40 * widest


def test_the_table_of_methods_is_what_the_code_gives() -> None:
    rows = table("### A quadrant of 100 mm, BLU 0.01 mm")
    names = [row[0] for row in rows]
    assert names == ["euler", "improved-euler", "taylor", "tustin", "improved-tustin"]
    for name, _, formula, forced, bound, radial, chord in rows:
        ours = taken(name)
        assert f"{ours.formula:.2f}" == formula
        rounded = taken(name, round(ours.formula))
        worst = max(rounded.radial_error, rounded.chord_error)
        assert f"{round(ours.formula)}: {worst:.4f}" == forced
        assert (str(ours.count), f"{ours.radial_error:.4f}", f"{ours.chord_error:.4f}") == (bound, radial, chord)


def test_figure_6() -> None:
    """Maximum 0.012 and mean 0.0051 mm: with 39 chords the corners must then be 0.0152 mm outside on average."""
    height = 100.0 * (1 - cos(pi / 2 / 39 / 2))
    assert f"{height:.4f}" == "0.0203" and "0.0203 mm" in TEXT
    assert f"{height - 0.0051:.4f}" == "0.0152" and "0.0152 mm" in TEXT
    # corners rounded to whole BLU, R(i) taken from them (eq. 11 to 14): the rounding errors add up
    alpha = sqrt(16 / (R - 1))
    corner = complex(100.01, 0.0)
    corners = [corner]
    for i in range(1, 40):
        radius = abs(corner)  # eq. 13
        corner = complex(round(radius * cos(i * alpha) / 0.01) * 0.01, round(radius * np.sin(i * alpha) / 0.01) * 0.01)
        corners.append(corner)
    points = np.array(corners)
    inside = 100.0 - np.abs(points[1:] + points[:-1]) / 2
    assert f"{inside.max():.4f}" == "0.0150" and "0.0150 mm" in TEXT
    assert f"{np.abs(inside).mean():.4f}" == "0.0055" and "0.0055 mm" in TEXT


def test_tables_n30_and_n31_in_the_document() -> None:
    for heading, multipliers in (("### Table N30", [1] * 5), ("### Table N31", [1, 2, 3, 2, 1])):
        rows = table(heading)
        adder = adder_output([5] * 8, multipliers)
        exact = adder / sum(multipliers)
        assert [row[0] for row in rows] == [str(k) for k in range(1, 13)]
        assert [row[1] for row in rows] == [row[2] for row in rows] == [str(value) for value in adder]
        printed = [f"{value:.2f}".removesuffix(".00") for value in exact]
        assert [row[3] for row in rows] == [row[4] for row in rows] == printed
        assert [row[5] for row in rows] == [str(value) for value in output_pulses([5] * 8, multipliers)]


def test_every_name_and_option_is_in_the_document() -> None:
    named = set(re.findall(r"`([\w-]+)`", TEXT))
    assert set(interpolator_names()) | set(ACCELERATIONS.names()) <= named
    for name in interpolator_names():
        assert set(interpolator_module(name).OPTIONS) <= named
    for name in ACCELERATIONS.names():
        assert set(ACCELERATIONS.module(name).OPTIONS) <= named
