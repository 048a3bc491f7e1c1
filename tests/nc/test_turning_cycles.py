"""G70 to G72 by what they promise: nothing cut below the contour and its allowance, everything above it gone, no rapid
through material, no cut deeper than I.

The material is a height over the contour's way, lowered move by move; what may remain is found from the
contour point by point.
"""

from __future__ import annotations

import math
import random
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from rds.machines import load_machine
from rds.nc import Dialect, ProgramError, canon_text, interpret
from rds.nc.check import check_program
from rds.nc.language.arcs import swept
from rds.nc.language.canon import ARC, FEED, TRAVERSE, MotionBlock
from rds.nc.language.turning_contour import CHORD
from rds.nc.setup import Setup
from tests.nc.rs274 import needs_rs274, rs274

STEP = 0.02  # mm, of the material's heights
CLOSE = 2 * CHORD + 1e-6
SHAFT = """\
O100 SUB
  G0 X4 Z2
  G1 Z0
  G3 X6 Z-2 R2
  G1 Z-8
  X9 Z-10
  Z-16
  X12
  G2 X14 Z-18 R2
  G1 Z-22
O100 ENDSUB
"""
POCKETS = """\
O100 SUB
  G0 X5 Z1
  G1 Z-3
  X8 Z-5
  X6 Z-7
  Z-9
  X10 Z-10.5
  G2 X10 Z-16.5 R3.4
  G1 Z-18
  X7.5 Z-19
  X9 Z-20
  X12
O100 ENDSUB
"""


def moves(program: str) -> list[tuple[int, np.ndarray]]:
    """Kind and points (z, x) along each move of a program, from the place where it begins."""
    at = (0.0, 0.0)
    found = []
    for item in interpret(program, options=Dialect()):
        if not isinstance(item, MotionBlock):
            continue
        for row in item.rows:
            values = row["values"].tolist()
            if row["kind"] == ARC:
                end, centre = (values[0], values[1]), (values[2], values[3])
                sweep = swept(at, centre, int(values[4]), end)
                radius = math.dist(at, centre)
                first = math.atan2(at[1] - centre[1], at[0] - centre[0])
                angles = first + sweep * np.linspace(0.0, 1.0, max(3, math.ceil(abs(sweep) * radius / STEP * 2)))
                found.append((FEED, centre + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)))
            elif row["kind"] in (TRAVERSE, FEED):
                end = (values[2], values[0])
                count = max(2, math.ceil(math.dist(at, end) / STEP * 2))
                found.append((int(row["kind"]), np.linspace(at, end, count)))
            else:
                continue
            at = end
    return found


class Material:
    """Heights above the way u of a contour, from the cycle's start to the contour's end."""

    def __init__(self, cycle: str, contour: str, start: tuple[float, float], along_z: bool, inside: bool = False):
        head = f"G21 G18 G90 F100\nG0 X{start[1]} Z{start[0]}\n"
        self.along_z, self.sign = along_z, -1.0 if inside else 1.0
        all_moves = moves(f"{contour}{head}O100 CALL\nM2")
        path = np.concatenate([self.turn(points) for _, points in all_moves[2:]])  # behind the move to its start
        self.way = 1.0 if path[-1, 0] > path[0, 0] else -1.0
        path[:, 0] *= self.way
        self.path = path
        turned = moves(f"{contour}{head}{cycle}\nM2")
        self.moves = [(kind, self.turn(points) * (self.way, 1.0)) for kind, points in turned]
        begin, self.top = self.turn(np.array([start]))[0] * (self.way, 1.0)
        self.u = np.arange(min(begin, path[0, 0]) + STEP, path[-1, 0] - STEP, STEP)
        self.height = np.full(len(self.u), self.top)

    def turn(self, points: np.ndarray) -> np.ndarray:
        """From (z, x) to (u, v)."""
        return (points if self.along_z else points[:, ::-1]) * (1.0, self.sign)

    def dense(self, closed: bool = True) -> np.ndarray:
        """Points of the contour, with what lies before its beginning and, `closed`, the wall behind its end."""
        first, last = self.path[0], self.path[-1]
        before = [(u, first[1]) for u in np.arange(self.u[0] - STEP, first[0], STEP / 2)]
        wall = np.linspace(last, (last[0], self.top), math.ceil(2 * abs(self.top - last[1]) / STEP) + 2)
        return np.concatenate([np.array(before).reshape(-1, 2), self.path, wall if closed else wall[:1]])

    def remains(self, distance: float) -> np.ndarray:
        """The heights that may remain over each u: what lies within `distance` of the contour, or below it, and the
        highest of it nearby, since a grid does not tell on which side of a wall a place lies.
        """
        fine = np.arange(self.u[0] - 2 * STEP, self.u[-1] + 3 * STEP, STEP / 4)
        heights = np.full(len(fine), -np.inf)
        for u, v in self.dense():
            low, high = np.searchsorted(fine, (u - distance - STEP / 8, u + distance + STEP / 8))
            round_it = np.sqrt(np.maximum(distance**2 - (fine[low:high] - u) ** 2, 0.0))
            np.maximum(heights[low:high], v + round_it, out=heights[low:high])
        around = np.lib.stride_tricks.sliding_window_view(heights, 17)[::4][: len(self.u)]
        return np.minimum(around.max(axis=1), self.top)

    def cut(self, deepest: float, distance: float, closed: bool = True) -> None:
        """Make all moves. Fails for a rapid in material, a deep cut, or one nearer to the contour than `distance`."""
        contour = self.dense(closed)
        near = cKDTree(contour)
        for number, (kind, points) in enumerate(self.moves[2:]):
            if kind == FEED:
                away = near.query(points)[0]
                assert away.min() >= distance - CLOSE, f"move {number} cuts into the contour's allowance"
                floor = [np.interp(points[:, 0] + side, *contour.T) for side in (-1e-6, 1e-6)]
                low = (points[:, 1] < np.min(floor, axis=0) - CLOSE) & (away > CLOSE + STEP / 10)
                assert not low.any(), f"move {number} cuts below the contour"
            at = np.rint((points[:, 0] - self.u[0]) / STEP).astype(int)
            on = (at >= 0) & (at < len(self.u))
            at, v = at[on], points[on, 1]
            way = np.abs(points[-1] - points[0])
            slope = 1.5 * STEP * (1.0 if way[0] < STEP else min(way[1] / way[0], 1e3))
            if kind == TRAVERSE:
                lowest = np.min([np.roll(self.height, k) for k in (-1, 0, 1)], axis=0)
                assert (v >= lowest[at] - slope - CLOSE).all(), f"move {number}, a rapid, goes through material"
                continue
            below = np.full(len(self.u), np.inf)
            np.minimum.at(below, at, v)
            beside = np.min([np.roll(self.height, k) for k in (-2, -1, 0, 1, 2)], axis=0)  # walls are not cut through
            depth = float((beside - below).max()) - slope
            assert depth <= deepest + CLOSE, f"move {number} cuts {depth:.3f} deep"
            np.minimum(self.height, below, out=self.height)

    def all_is_gone(self, limit: np.ndarray) -> bool:
        return bool((self.height[3:-3] <= limit[3:-3] + CLOSE).all())


def check(cycle: str, contour: str, start: tuple[float, float], depth: float, distance: float, **how: bool) -> None:
    material = Material(cycle, contour, start, **how)
    material.cut(depth, distance)
    assert material.all_is_gone(material.remains(distance))


@pytest.mark.parametrize("distance", [0.0, 0.4])
@pytest.mark.parametrize("contour", [SHAFT, POCKETS])
def test_roughing_along_z_takes_all_above_the_contour(contour: str, distance: float) -> None:
    check(f"G71 Q100 D{distance} I0.7 R0.3", contour, (2.0, 16.0), 0.7, distance, along_z=True)


def test_facing_takes_all_in_front_of_the_contour() -> None:
    contour = "O100 SUB\nG0 X12 Z-8\nG1 X10\nX8 Z-6\nX6 Z-6\nG2 X4 Z-4 R2\nG1 Z-1\nX0 Z0\nO100 ENDSUB\n"
    check("G72 Q100 D0.2 I0.5", contour, (1.0, 13.0), 0.5, 0.2, along_z=False)


def test_a_bore_is_turned_from_within() -> None:
    contour = "O100 SUB\nG0 X9 Z1\nG1 Z-4\nX7 Z-6\nZ-10\nX5\nZ-12\nO100 ENDSUB\n"
    check("G71 Q100 D0.1 I0.4", contour, (1.0, 4.0), 0.4, 0.1, along_z=True, inside=True)


def test_random_contours_are_kept() -> None:
    rng = random.Random(5)
    for number in range(10):
        x, z, words = rng.uniform(3, 8), 1.0, []
        for _ in range(rng.randint(3, 7)):
            wall = rng.random() < 0.3
            x = min(max(x + (rng.uniform(-3, 3) if wall else rng.choice((0.0, rng.uniform(-3, 3)))), 2.0), 13.0)
            if wall:
                words.append(f"G1 X{x:.3f} Z{z:.3f}")
            z -= rng.uniform(0.2, 3.0)
            words.append(f"G1 X{x:.3f} Z{z:.3f}")
        contour = f"O100 SUB\nG0 X{rng.uniform(3, 8):.3f} Z1\n" + "\n".join(words) + f"\nZ{z - 1:.3f}\nO100 ENDSUB\n"
        distance = 0.3 * (number % 2)
        check(f"G71 Q100 D{distance} I0.9 R0.4", contour, (1.5, 15.0), 0.9, distance, along_z=True)


def test_71_1_leaves_pockets_and_71_2_cuts_them() -> None:
    start, contour = (1.5, 14.0), POCKETS
    without = Material("G71.1 Q100 D0.3 I0.5", contour, start, along_z=True)
    without.cut(0.5, 0.3)
    filled = np.maximum.accumulate(without.remains(0.3))
    assert without.all_is_gone(filled)
    assert (without.height >= filled - 0.1).mean() > 0.95
    both = Material("G71.1 Q100 D0.3 I0.5\nG71.2 Q100 X14 Z1.5 D0.1 I0.5", contour, start, along_z=True)
    both.cut(4.0, 0.1)  # along walls it takes 0.2 off, 3.9 high
    assert both.all_is_gone(both.remains(0.1))


def test_71_2_goes_by_feed_to_where_an_earlier_cycle_has_left_more() -> None:
    """Without X and Z it begins where the first cycle ends; a rapid went down into 0.2 mm of material there."""
    Material("G71.1 Q100 D0.3 I0.5\nG71.2 Q100 D0.1 I0.5", POCKETS, (1.5, 14.0), along_z=True).cut(4.0, 0.1)


@needs_rs274
def test_the_cuts_end_where_those_of_rs274_do() -> None:
    """Each layer's end, within what chords leave. rs274 makes a first cut at the start's height, too."""
    program = f"{SHAFT}G21 G18 G90 F100\nG71 Q100 X16 Z2 I1.3 R0.2\nM2\n"
    printed, complaint = rs274(program.encode())
    assert not complaint
    numbers = [[float(n) for n in re.findall(r"-?\d+\.\d+", line)] for line in printed if "STRAIGHT_FEED" in line]
    theirs = [(values[2], values[0]) for values in numbers]
    layers = [points[-1] for kind, points in moves(program) if kind == FEED and points[0, 1] == points[-1, 1]]
    layers = [end for end in layers if abs((16 - end[1]) / 1.3 - round((16 - end[1]) / 1.3)) < 1e-6]
    assert len(layers) >= 8
    for end in layers:
        assert min(math.dist(end, other) for other in theirs) < 0.002


def test_finishing_follows_the_contour_to_the_last_digit() -> None:
    program = f"{SHAFT}G21 G18 G90 F100\nG0 X16 Z2\nO100 CALL\nM2\n"
    cycle = f"{SHAFT}G21 G18 G90 F100\nG0 X16 Z2\nG70 Q100\nM2\n"
    assert feeds(cycle) == feeds(program)


def feeds(program: str) -> list[str]:
    return [line.split(maxsplit=2)[-1] for line in canon_text(interpret(program)) if "FEED(" in line]


def test_corners_are_rounded_and_broken() -> None:
    """A1 between moves at right angles: an arc of radius 1 that touches both; C has its ends and is straight."""
    head = "G21 G18 G90 F100\nG0 X20 Z0\n"
    program = "O1 SUB\nG1 X5 Z-1\nZ-5 A1\nX9 C0.5\nZ-10\nO1 ENDSUB\n" + head + "G70 Q1\nM2\n"
    by_hand = head + "G0 X5 Z-1\nG1 Z-4\nG2 X6 Z-5 I1\nG1 X8.5\nX9 Z-5.5\nZ-10\nM2\n"
    assert feeds(program) == feeds(by_hand)


def test_finishing_in_passes_comes_nearer_by_equal_steps() -> None:
    material = Material("G70 Q100 D0.6 E0.1 P2", SHAFT, (2.0, 16.0), along_z=True)
    material.cut(20.0, 0.1, closed=False)
    first = Material("G70 Q100 D0.35 E0.35", SHAFT, (2.0, 16.0), along_z=True)
    assert len(material.moves) > len(first.moves)
    shared = [points[-1] for _, points in material.moves[: len(first.moves)]]
    assert np.allclose(shared, [points[-1] for _, points in first.moves])


def test_diameters_are_halved_once() -> None:
    radii = f"{SHAFT}G21 G18 G90 G8 F100\nG71 Q100 X16 Z2 I1\nM2\n"
    words = SHAFT.replace("X4", "X8").replace("X6", "X12").replace("X9", "X18").replace("X14", "X28")
    words = words.replace("  X12\n  G2", "  X24\n  G2")
    diameters = f"{words}G21 G18 G90 G7 F100\nG71 Q100 X32 Z2 I1\nM2\n"
    assert [row for _, row in moves(radii)][-1].tolist() == [row for _, row in moves(diameters)][-1].tolist()
    assert len(moves(radii)) == len(moves(diameters))


@pytest.mark.parametrize(
    ("cycle", "contour", "message"),
    [
        ("G71 X16", SHAFT, "G71 without Q"),
        ("G71 Q7 X16 Z2", SHAFT, "the subroutine 7 is not defined"),
        ("G71 Q100 X10 Z2", SHAFT, "between the contour's ends, 4 and 14"),
        ("G71 Q100 X16 Z2 I0", SHAFT, "must be above 0"),
        ("G71 Q100 X16 Z2 P2", SHAFT, "P goes with the form"),
        ("G17 G71 Q100 X16 Z2", SHAFT, "write G18"),
        ("G71 Q100 X16 Z2", SHAFT.replace("Z-8", "Z1"), "line 5 of the contour turns back along Z"),
        ("G71 Q100 X16 Z2", SHAFT.replace("G2 X14 Z-18 R2", "G33 Z-18 K1"), "no part of a contour"),
        ("G71 Q100 X16 Z2", SHAFT.replace("Z-10", "Z-10 A9"), "make it smaller"),
        ("G72 Q100 X16 Z2 D-1", SHAFT, "negative"),
    ],
)
def test_what_cannot_be_cut_is_refused(cycle: str, contour: str, message: str) -> None:
    with pytest.raises(ProgramError, match=message):
        list(interpret(f"{contour}G21 G18 G90 F100\n{cycle}\nM2\n"))


def test_the_document_s_lathe_program_is_cut_on_the_shipped_lathe(tmp_path: Path) -> None:
    document = (Path(__file__).parents[2] / "docs/part-program-language.md").read_text()
    program = tmp_path / "shaft.ngc"
    program.write_text(next(part.split("```")[0] for part in document.split("```gcode\n")[1:] if "G71 Q100" in part))
    found, _ = check_program(program, load_machine("lathe"), Setup())
    assert found.ok, str(found)


FANUC = """\
G71 U1.5 R0.5
G71 P100 Q200 U{u} W0.1
N100 G0 X4
  G1 Z0
  X6 Z-2
  Z-8
  G3 X9 Z-11 R3
N200 G1 X12 Z-14
"""


def test_fanuc_s_two_lines_rough_as_the_subroutine_with_the_contour_moved_does() -> None:
    """The same cuts as of a subroutine that is the contour moved by U and W; then back to the start."""
    head = "G21 G18 G90 G8 F100 S500 M3\nG0 X12 Z2\n"
    moved = "O100 SUB\nG0 X4.3 Z2.1\nG1 Z0.1\nX6.3 Z-1.9\nZ-7.9\nG3 X9.3 Z-10.9 R3\nG1 X12 Z-13.6\nO100 ENDSUB\n"
    plain = moves(f"{moved}{head}G71 Q100 I1.5 R0.5\nG0 X12 Z2\nM2\n")
    ours = moves(f"{head}{FANUC.format(u=0.3)}M2\n")
    assert [kind for kind, _ in ours[: len(plain)]] == [kind for kind, _ in plain]
    for (_, one), (_, other) in zip(ours, plain, strict=True):
        assert one[-1] == pytest.approx(other[-1], abs=1e-4)
    of_diameter = head.replace("G8", "G7").replace("X12", "X24")
    doubled = re.sub(r"X([0-9]+)", lambda match: f"X{2 * int(match[1])}", FANUC.format(u=0.6))
    for (_, one), (_, other) in zip(moves(f"{of_diameter}{doubled}M2\n"), ours, strict=True):
        assert one[-1] == pytest.approx(other[-1], abs=1e-4)


def test_fanuc_s_g70_finishes_the_blocks_themselves_and_the_program_goes_on() -> None:
    found = moves(f"G21 G18 G90 G8 F100 S500 M3\nG0 X12 Z2\n{FANUC.format(u=0.3)}G70 P100 Q200 F50\nG0 X20 Z9\nM2\n")
    ends = [tuple(points[-1].round(4)) for _, points in found]
    cut = [(2.0, 4.0), (0.0, 4.0), (-2.0, 6.0), (-8.0, 6.0), (-11.0, 9.0), (-14.0, 12.0)]
    assert ends[-9:] == [(2.0, 12.0), *cut, (2.0, 12.0), (9.0, 20.0)]


@pytest.mark.parametrize(
    ("text", "says", "line"),
    [
        ("G71 P100 Q200 U.3\nN100 G0 X4\nN200 G1 Z-5", "U goes with the form", 2),  # no line before it
        ("G71 U1 R.5\nG71 P100 Q300 U.3\nN100 G0 X4\nN200 G1 Z-5", "the contour ends before a block N300", 3),
        ("G71 U1 R.5\nG71 P90 Q200 U.3\nN100 G0 X4\nN200 G1 Z-5", "the block N90 does not follow", 3),
        ("G71 U0 R.5", "U, the depth of each cut, must be above 0", 2),
        ("G71 U1 U2 R.5", "the word U stands twice", 2),
        ("G71 U1 R.5\nG71 P100 Q100 U.3\nN100 G0 X4", "P and Q name the same block", 3),
        ("G71 U1 R.5\nG71 P1.5 Q100 U.3\nN100 G0 X4", "P1.5 is no block's number", 3),
        ("G71 U1 R.5\nG71 P100 Q200 U9\nN100 G0 X4\nG1 Z0\nN200 Z-5", "U leaves more on the contour than there is", 3),
        ("G71 U1 R.5\nG71 P100 Q200\nM8\nN100 G0 X4\nN200 G1 Z-5", "the block N100 does not follow", 3),
        ("G71 U1 R.5\nG70 P100 Q200", "no G71 or G72 P100 Q200 stands before", 3),
        ("G71 U1 R.5\nG71 P100 Q200\nN100 G0 X4\nG70 P100 Q200", "has no end before this cycle", 5),
        ("G71 U1 R.5\nG71 P100 Q200\nN100 G0 X4\nG91 G1 Z-1\nN200 Z-5", "G91 in a contour changes what", 5),
        ("O5 SUB\nG71 U1 R.5\nG71 P1 Q2\nO5 ENDSUB\nO5 CALL\nN1 G0 X4\nN2 G1 Z-5", "the block N1 does not follow", 4),
        (
            "G71 U1 R.5\nG71 P100 Q200 U.3\nN100 G0 X4 Z0\nG2 X5 Z-1 R1\nG33 Z-2 K1\nN200 G1 X9",
            "no part of a contour",
            6,
        ),
    ],
)
def test_what_is_wrong_in_fanuc_s_form_is_told_by_line(text: str, says: str, line: int) -> None:
    with pytest.raises(ProgramError, match=says) as caught:
        list(interpret(f"G21 G18 G90 G8 F100 S500 M3 G0 X12 Z2\n{text}\nM2\n"))
    assert caught.value.line == line


def test_what_stands_around_fanuc_s_blocks_and_in_them_changes_no_cut() -> None:
    """Comments, blank lines, a call within that G70 makes again, and block numbers with blanks."""
    head, tail = "G21 G18 G90 G8 F100 S500 M3\nG0 X12 Z2\n", "G70 P100 Q200 F50\nM2\n"
    plain = f"{head}{FANUC.format(u=0.3)}{tail}"
    around = FANUC.format(u=0.3).replace("R0.5\n", "R0.5 (half a mm back)\n").replace("N200 ", "N 2 00 ")
    around = around.replace("W0.1\n", "W0.1 (left)\n\n(the contour)\n").replace("  Z-8\n", "  O5 CALL\n")
    called = f"O5 SUB\nZ-8\nO5 ENDSUB\n{head}{around}{tail}"
    for (kind, one), (other_kind, other) in zip(moves(plain), moves(called), strict=True):
        assert kind == other_kind and one[-1] == pytest.approx(other[-1], abs=1e-9)


def test_cuts_within_one_another_may_be_a_thousand() -> None:
    contour = "O100 SUB\nG0 X10\nG1 Z-5\nX8\nX20 Z-20\nO100 ENDSUB\n"
    program = f"G21 G18 G90 G8 F100\n{contour}G0 X20 Z2\nG71 Q100 I0.009 R0.5\nM2\n"
    assert sum(len(item) for item in interpret(program) if isinstance(item, MotionBlock)) > 4 * 1100
