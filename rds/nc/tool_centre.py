"""Moves programmed for the tool's tip, made into moves of the joints: the stage between interpreter and planner.

Each line or arc of the tip, rotary axes in proportion, becomes chords in the space of the joints. Of the tolerance P of
G64 (0.05 mm without one), chords and the planner's blends between them get equal parts: with s the way of the tip for
1 mm of the linear joints and r that for one degree of the rotary ones, e = P/(1 + s + r) for each, in joint space,
keeps the tip within P. A chord's length and rate are the tip's, so the feed is the tip's; the planner, which keeps to
the limits of every joint, slows it down where a joint can do no more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rds.core.errors import InputError
from rds.interpolators.motion.planner import TOLERANCE
from rds.interpolators.motion.segments import BLEND, JOINTS, LINE, MOVED, SEGMENT, TILTED, pieces, points_at
from rds.machines import Machine
from rds.machines.kinematics.tip import Tip
from rds.nc.language.frame import only_rotary

WIDEST = np.radians(10.0)  # of an arc, in one chord
WIDEST_TURN = 10.0  # degrees of a rotary axis, in one chord
MOST_CHORDS = 4096  # of one move; one that needs more passes a singular place
_ROUNDS = 10
_LOOKED_AT = (0.25, 0.5, 0.75)  # of a chord
_MARGIN = 0.8  # of the tolerance, for what lies between those places

Complain = Callable[[int, str], None]


def has_tool_centre(machine: Machine) -> bool:
    """Whether tool centre point control is of use: links with a rotary axis."""
    return any(link.axis and machine.axes[link.axis].unit == "deg" for link in machine.links)


def without_errors(machine: Machine) -> Machine:
    """The machine as it was meant to be: no assembly errors in its links."""
    zero = (0.0, 0.0, 0.0)
    return replace(machine, links=tuple(replace(link, error_angles=zero, error_offset=zero) for link in machine.links))


class ToolCentre:
    """From the tip to the joints of one machine. `correct`: of the chain with its assembly errors, else without them.

    Raises InputError for a machine that has no links, or none from which the joints follow.
    """

    def __init__(self, machine: Machine, correct: bool = False):
        if not machine.links:
            raise InputError(f"{machine.name} has no [[link]] tables to say how its axes move the tool", machine.path)
        self.correct = correct
        self.meant = Tip(without_errors(machine).kinematics)
        self.real = Tip(machine.kinematics) if correct else self.meant
        self.length = 0.0  # mm

    def begin(self, position: np.ndarray) -> np.ndarray:
        """The tip's position (6,) where the joints are at `position`."""
        return self.meant.begin(self.joints_meant(position), self.length)

    def joints_meant(self, position: np.ndarray) -> np.ndarray:
        """Where the joints of the machine as meant would be (6,), for tip and tool to be where they are."""
        if not self.correct:
            return position
        place, direction = self.real.places(position[None], self.length)
        return self.meant.corrected(position[None], place, direction, self.length)[0]

    def bring(self, wanted: np.ndarray, near: np.ndarray, joints: bool) -> np.ndarray:
        """The joints' positions (n, 6) for `wanted` of the tip or, with `joints`, of the joints as meant."""
        meant = wanted if joints else self.meant.positions(wanted, self.length, near)
        if not self.correct:
            return meant
        whole = ~np.isnan(meant).any(axis=1)
        found = np.full_like(wanted, np.nan)
        if whole.any():
            places, directions = self.meant.places(meant[whole], self.length)
            found[whole] = self.real.corrected(meant[whole], places, directions, self.length)
        return found

    def chords(
        self, segments: np.ndarray, before: np.ndarray, complain: Complain, joints: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Chords in joint space (SEGMENT) of moves of the tip, from the joints' position `before` (6,) on.

        Also which move each of them is of. What cannot be goes to `complain` with its line, and leaves the joints
        where they are. `joints`: the moves are of the joints of the machine as it was meant to be.
        """
        wrong = segments["mode"] != BLEND
        if wrong.any() and not joints:
            complain(
                int(segments["line"][np.argmax(wrong)]),
                "exact path and exact stop (G61, G61.1) do not go with tool centre point control; write G64 P0.01",
            )
        if self.meant.follows and not joints:
            column = int(self.meant.columns[self.meant.rotary[0]])
            given = segments["start"][:, column] != segments["end"][:, column]
            if given.any():
                name = "XYZABC"[column]
                complain(
                    int(segments["line"][np.argmax(given)]),
                    f"{name} follows from X and Y of the tip on this machine; leave {name} away until G49",
                )
        count = self._first_count(segments)
        share = self._share(segments, before, joints)
        for _ in range(_ROUNDS):
            owner, u = pieces(count)
            made = self.bring(
                np.concatenate([points_at(segments[:1], u[:1] * 0.0), points_at(segments[owner], u)]), before, joints
            )
            made[0] = before
            off = self._off(segments, owner, u, count, made, joints)
            worst = np.zeros(len(segments))
            np.maximum.at(worst, owner, np.where(np.isnan(off), 0.0, off))
            more = (worst > _MARGIN * share) & (count < MOST_CHORDS)
            if not more.any():
                break
            grown = np.ceil(count[more] * np.clip(np.sqrt(worst[more] / (0.7 * _MARGIN * share[more])), 1.3, 8.0))
            count[more] = np.minimum(grown, MOST_CHORDS).astype(int)
        self._complain(segments, owner, made[1:], worst, share, complain)
        return self._made(segments, owner, count, made, share), owner

    def _share(self, segments: np.ndarray, before: np.ndarray, joints: bool) -> np.ndarray:
        """mm of the tolerance for chords, and as much for blends."""
        ends = self.bring(segments["end"], before, joints)
        ends[np.isnan(ends).any(axis=1)] = before
        shifts, turns = (
            np.maximum(each, np.concatenate((each[:1], each[:-1]))) for each in self.real.leverage(ends, self.length)
        )
        tolerance = np.where(np.isfinite(segments["tolerance"]), segments["tolerance"], TOLERANCE)
        found: np.ndarray = tolerance / (1.0 + shifts + 1.1 * turns)
        return found

    @staticmethod
    def _first_count(segments: np.ndarray) -> np.ndarray:
        turned = np.abs(segments["end"] - segments["start"])[:, 3:].max(axis=1) / WIDEST_TURN
        count = np.maximum(turned, np.abs(segments["sweep"]) / WIDEST * (segments["plane"] != LINE))
        return np.maximum(np.ceil(count - 1e-9), 1.0).astype(int)

    def _off(
        self, segments: np.ndarray, owner: np.ndarray, u: np.ndarray, count: np.ndarray, made: np.ndarray, joints: bool
    ) -> np.ndarray:
        """How far the tip is from its path within each chord, mm."""
        off = np.zeros(len(owner))
        for share in _LOOKED_AT:
            wanted = points_at(segments[owner], u - (1.0 - share) / count[owner])
            if joints:
                wanted[:, :3] = self.meant.places(wanted, self.length)[0]
            place, _ = self.real.places(made[:-1] + share * (made[1:] - made[:-1]), self.length)
            off = np.fmax(off, np.linalg.norm(place - wanted[:, :3], axis=1))
        return off

    def _complain(
        self,
        segments: np.ndarray,
        owner: np.ndarray,
        made: np.ndarray,
        worst: np.ndarray,
        share: np.ndarray,
        complain: Complain,
    ) -> None:
        lost = np.isnan(made).any(axis=1)
        for at in np.unique(owner[lost]):
            x, y, z = segments["end"][at, :3]
            complain(
                int(segments["line"][at]),
                f"no position of the joints brings the tip to X{x:g} Y{y:g} Z{z:g}, or along the way there: the axes "
                "do not reach it, or lie in one plane there (singular)",
            )
        far = (worst > share) & ~np.isin(np.arange(len(segments)), owner[lost])
        for line in np.unique(segments["line"][far]):
            complain(
                int(line),
                f"the tip cannot keep to this move within {MOST_CHORDS} chords: a rotary axis turns through a singular "
                "place (the tip on its axis); lead the tip past it, or raise P of G64",
            )

    def _made(
        self,
        segments: np.ndarray,
        owner: np.ndarray,
        count: np.ndarray,
        made: np.ndarray,
        share: np.ndarray,
    ) -> np.ndarray:
        """The rows of the chords."""
        lost = np.isnan(made).any(axis=1)
        kept = np.maximum.accumulate(np.where(lost, 0, np.arange(len(made))))
        made = np.round(made[kept], 12)
        rows = segments[owner]
        tilted = only_rotary(segments)
        rows["start"], rows["end"] = made[:-1], made[1:]
        rows["plane"], rows["sweep"], rows["centre"] = LINE, 0.0, 0.0
        rows["length"] = (segments["length"] / count)[owner]
        rows["tolerance"] = np.where(rows["mode"] == BLEND, share[owner], rows["tolerance"])
        rows["collinear"] = 0.0
        rows["tip"] = np.where(tilted, TILTED, MOVED)[owner]
        rows["tool_length"] = self.length
        return rows


def path_of_tip(tip: Tip, segments: np.ndarray) -> np.ndarray:
    """The same segments with X Y Z of the tip in work coordinates, straight: to measure moves for the tip against."""
    made = segments.astype(SEGMENT)
    for name in ("start", "end"):
        made[name][:, :3] = tip.places(segments[name], segments["tool_length"])[0]
    made["plane"], made["sweep"] = LINE, 0.0
    return made


def slowed(segments: np.ndarray, velocity: np.ndarray) -> tuple[int, int, float] | None:
    """Line, axis and share of its velocity of the move for the tip whose feed asks most of a joint; None if all can."""
    some = segments[(segments["tip"] != JOINTS) & ~segments["rapid"] & (segments["rate"] > 0.0)]
    if not len(some):
        return None
    speed = np.abs(some["end"] - some["start"]) * (some["rate"] / some["length"])[:, None]
    share = np.divide(speed, velocity, out=np.zeros_like(speed), where=velocity > 0.0)
    at, axis = np.unravel_index(np.argmax(share), share.shape)
    return (int(some["line"][at]), int(axis), float(share[at, axis])) if share[at, axis] > 1.0 + 1e-6 else None


def shown(segments: np.ndarray, machine: Machine) -> np.ndarray:
    """Segments for a picture: where some are for the tool's tip, the path of the tip on the work."""
    if not (segments["tip"] != JOINTS).any():
        return segments
    return path_of_tip(Tip(machine.kinematics), segments)
