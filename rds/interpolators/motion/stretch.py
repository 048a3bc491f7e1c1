"""The motion along pieces, from rest to rest: it looks ahead over a window of pieces, and hands out samples.

It plans as if the motion ended with the window, and takes over the part of the profile that this end does not touch. So
memory is bounded. What is in a window does not depend on how many pieces come at a time.

Two choices are made by trying, and counting the time: how long a stretch is averaged over (τ: on short ways less than
the whole ramp of the acceleration, which is not reached there), and how much of acceleration and jerk the bends of the
path may take: little where the motion slows down and speeds up within them, and nearly all where it goes through them
at an even speed.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, sqrt

import numpy as np

from rds.core.compiling import tiered_kernel
from rds.interpolators.motion.corners import motion, seam
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.pieces import CAP, END, FIRST, LAST, LENGTH, REST, SHARE, no_pieces
from rds.interpolators.motion.profile import cut, hold_tops, phases_of, settled, speeds
from rds.interpolators.motion.sampling import LASTS, PLACE, SINCE, sample, timed
from rds.interpolators.motion.speed import envelope, joint_limits, piece_limits

WINDOW = 1024  # pieces that are looked ahead over, at least
LONGEST_WINDOW = 65536  # pieces: if these are too short a way to stop in, the motion stops after them
PROGRESS = 0.2  # of a window, that must be settled; else a longer one is taken
MOST_ROWS = 16384  # samples at a time
FIRST_SHARES = (0.7, 0.4, 0.15)  # of acceleration and jerk for bends; less leaves more for changes of the speed
SHARES = (0.4, 0.7, 0.85, 0.98)  # for those that are passed at an even speed
AVERAGES = (1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.13)  # of the longest ramp, to average over
SHORTEST_AVERAGE = 4  # samples
FINE = 1.06  # the best average of a stretch of few pieces is found to so much
FEW = 3  # pieces

# position, velocity, acceleration (m, 6), programmed distance (m), first and last segment of each sample's piece (m)
_Profile = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
Samples = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


class Stretch:
    """Takes pieces in (`extend`) and gives samples out (`run`); at the end of each stretch it stops giving.

    limits: what is planned with; tau: s, what the profile is averaged over at most; T: s between samples.
    """

    def __init__(self, limits: Limits, tau: float, T: float):
        self._limits, self._longest, self._T = limits, tau, T
        highest = float(limits.velocity.max()) * sqrt(float(limits.present.sum()))
        # As far as the limits of a place reach, of a joint also through its neighbours within 3 T.
        self._reach = highest * (0.5 * tau + 4.5 * T)
        self._f, self._u = no_pieces()
        self._begin()

    def _begin(self) -> None:
        self._place, self._speed, self._time = 0.0, 0.0, 0.0  # where the profile is known to
        self._tau = 0.0  # not chosen yet
        self._known = 0  # pieces whose shares have been chosen
        self._passed = 0  # pieces before this place
        self._next = 1  # sample of the stretch
        self._window = WINDOW
        self._rows = np.empty((0, 5))
        self._phases = np.empty((0, 6))  # of the motion, in its own time
        self._moved, self._lasts = 0.0, 0.0  # the profile's time up to which there are some, and the motion's

    def extend(self, f: np.ndarray, u: np.ndarray) -> None:
        """More pieces that follow. Between stretches and within."""
        self._f, self._u = np.concatenate((self._f, f)), np.concatenate((self._u, u))

    @property
    def oldest_segment(self) -> int | None:
        """The first segment of which a piece is kept; None without pieces."""
        return int(self._u[0, FIRST]) if len(self._u) else None

    def run(self) -> Iterator[tuple[Samples, int | None]]:
        """Samples, and the segment after which they end at rest (None: the motion goes on, when there are more
        pieces).
        """
        while True:
            last = self._passed + self._window
            at = np.concatenate(([0.0], np.cumsum(self._f[:last, LENGTH])))
            rests = np.flatnonzero(self._u[:last, REST])
            if len(rests):
                count, ends = int(rests[0]) + 1, True
            elif len(self._f) >= last:
                count, ends = last, False
            else:
                return
            if not self._look_ahead(at[: count + 1], count, ends):
                self._window *= 2
                if self._window > LONGEST_WINDOW:
                    self._u[count - 1, REST] = 1
                    self._window = WINDOW
                continue
            if ends:
                finish = int(self._u[count - 1, LAST])
                yield from self._samples(at, count, finish)
                self._f, self._u = self._f[count:], self._u[count:]
                self._begin()
            else:
                yield from self._samples(at, count, None)
                self._forget(at)

    def _look_ahead(self, at: np.ndarray, count: int, ends: bool) -> bool:
        """Extend the profile; whether that was possible in this window."""
        f = self._f[:count]
        end = at[count] if ends else at[count] - self._reach
        if end <= self._place:
            return False
        if not self._tau:
            self._tau = self._best_average(f, at, end)
        edges, cap, push, v, phases = self._first_shares(f, at, end)
        for share in SHARES:
            bent = self._evenly_passed(f, at, edges, v, share)
            if not bent.any():
                continue
            before = f[:, SHARE].copy()
            f[bent, SHARE] = share
            found = self._profile(f, at, end, self._tau)
            if _lasting(found[4]) >= _lasting(phases):
                f[:, SHARE] = before
                self._limit(f, self._tau)
                continue
            edges, cap, push, v, phases = found
        if not ends:
            done = settled(edges, cap, push, self._speed, v) - self._place
            if done < PROGRESS * (end - self._place):
                return False
            phases = cut(phases, done)
        rows = timed(phases, self._time, self._place)
        self._rows = np.concatenate((self._rows, rows))
        self._place = end if ends else self._place + float(phases[:, 0].sum())
        self._speed = float(phases[-1, 2])
        self._time = float(rows[-1, SINCE] + rows[-1, LASTS])
        return True

    def _first_shares(self, f: np.ndarray, at: np.ndarray, end: float) -> _Profile:
        """The profile with the best share for the bends of pieces that were in no window before."""
        new = self._untouched(f, at)
        new[: self._known] = False
        self._known = len(f)
        best, best_share = self._profile(f, at, end, self._tau), FIRST_SHARES[0]
        if not new.any():
            return best
        for share in FIRST_SHARES[1:]:
            f[new, SHARE] = share
            found = self._profile(f, at, end, self._tau)
            if _lasting(found[4]) < _lasting(best[4]):
                best, best_share = found, share
        f[new, SHARE] = best_share
        self._limit(f, self._tau)
        return best

    def _untouched(self, f: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Which pieces are so far on that their limits do not reach back to where the profile is settled."""
        return at[:-1] - self._longest * f[:, CAP] > self._place if self._place > 0.0 else np.ones(len(f), bool)

    def _limit(self, f: np.ndarray, tau: float) -> None:
        piece_limits(f, self._limits.velocity, self._limits.acceleration, self._limits.jerk, tau)

    def _profile(self, f: np.ndarray, at: np.ndarray, end: float, tau: float) -> _Profile:
        """The fastest from where it is known to, that rests at `end`: edges, limits between them, speeds, phases."""
        limits = self._limits
        self._limit(f, tau)
        joints = joint_limits(f, at, limits.acceleration, limits.jerk, tau, self._T)
        edges, cap, push = envelope(f, at, joints, tau, self._place, end)
        v = speeds(edges, cap, push, self._speed, 0.0)
        return edges, cap, push, v, hold_tops(phases_of(edges, cap, push, v), tau)

    def _best_average(self, f: np.ndarray, at: np.ndarray, end: float) -> float:
        """τ with which the stretch, or its first window, takes the least time."""
        least = min(SHORTEST_AVERAGE * self._T, self._longest)

        def time(tau: float) -> float:
            return _lasting(self._profile(f, at, end, tau)[4]) + tau

        tried = {tau: time(tau) for share in AVERAGES if (tau := max(share * self._longest, least))}
        best = min(tried, key=lambda tau: (tried[tau], -tau))
        while best == min(tried) > least:  # a move far shorter than the ramp to full acceleration
            shorter = max(AVERAGES[-1] / AVERAGES[-2] * best, least)
            tried[shorter] = time(shorter)
            best = min(tried, key=lambda tau: (tried[tau], -tau))
        if len(f) > FEW:
            return best
        step = sqrt(AVERAGES[0] / AVERAGES[1])
        while step > FINE:
            for tau in (best / step, best * step):
                if least <= tau <= self._longest and (lasts := time(tau)) < tried[best]:
                    tried[tau], best = lasts, tau
            step = sqrt(step)
        return best

    def _evenly_passed(
        self, f: np.ndarray, at: np.ndarray, edges: np.ndarray, v: np.ndarray, share: float
    ) -> np.ndarray:
        """Which pieces are passed as fast as their bends allow from end to end, and may get a larger share.

        Not those whose limits would reach back to where the profile is settled.
        """
        first = np.searchsorted(edges, at[:-1], side="right") - 1
        last = np.searchsorted(edges, at[1:], side="left")
        inside = self._untouched(f, at) & (last < len(edges)) & (first >= 0)
        bent = np.zeros(len(f), bool)
        which = np.flatnonzero(inside & (f[:, SHARE] < share))
        if not len(which):
            return bent
        lowest = np.minimum.reduceat(np.append(v, np.inf), np.column_stack((first[which], last[which] + 1)).ravel())[
            ::2
        ]
        bent[which] = lowest >= f[which, CAP] * (1.0 - 1e-9)
        return bent

    def _samples(self, at: np.ndarray, count: int, finish: int | None) -> Iterator[tuple[Samples, int | None]]:
        f, u, limits = self._f[:count], self._u[:count], self._limits
        ends = self._time + self._tau if finish is not None else seam(self._rows, self._tau, self._moved, self._time)
        phases, self._lasts = motion(
            *(self._rows, self._tau, self._moved, ends, self._lasts, f, u, at[: count + 1]),
            *(limits.velocity, limits.acceleration, limits.jerk),
        )
        self._moved = ends
        self._phases = np.concatenate((self._phases, phases))
        lasts = self._lasts / self._T
        stop = int(lasts * (1.0 - 1e-12)) if finish is None else ceil(lasts - 1e-9)
        while self._next <= stop:
            m = min(stop - self._next + 1, MOST_ROWS)
            position, velocity, acceleration = np.empty((m, 6)), np.empty((m, 6)), np.empty((m, 6))
            distance, piece = np.empty(m), np.empty(m, np.int64)
            out = (position, velocity, acceleration, distance, piece)
            sample(self._phases, self._T, self._next, m, f, u, at, *out)
            self._next += m
            ended = finish is not None and self._next > stop
            if ended:
                position[-1], velocity[-1], acceleration[-1] = f[-1, END : END + 6], 0.0, 0.0
                piece[-1] = count - 1
            samples = (position, velocity, acceleration, distance, u[piece, FIRST], u[piece, LAST])
            yield samples, finish if ended else None

    def _forget(self, at: np.ndarray) -> None:
        """Drop what no further sample needs, and count place and time from later on, which keeps them precise."""
        since = self._moved - self._tau
        old = max(int(np.searchsorted(self._rows[:, SINCE], since, side="right")) - 1, 0)
        before = float(self._rows[old, SINCE])
        self._rows = self._rows[old:]
        self._rows[:, SINCE] -= before
        self._time -= before
        self._moved -= before
        done = (self._next - 1) * self._T
        self._phases = self._phases[self._phases[:, SINCE] + self._phases[:, LASTS] > done]
        self._phases[:, SINCE] -= done
        self._lasts -= done
        self._next = 1
        needed = float(self._rows[0, PLACE])
        if len(self._phases):
            needed = min(needed, float(self._phases[0, PLACE]))
        needed -= 2.0 * self._reach
        gone = max(int(np.searchsorted(at, needed, side="right")) - 1, 0)
        self._passed = max(int(np.searchsorted(at, self._place, side="right")) - 1 - gone, 0)
        if gone > 0:
            self._f, self._u = self._f[gone:], self._u[gone:]
            self._known = max(self._known - gone, 0)
            self._rows[:, PLACE] -= at[gone]
            self._phases[:, PLACE] -= at[gone]
            self._place -= at[gone]


@tiered_kernel
def _lasting(phases):
    """s."""
    total = 0.0
    for i in range(len(phases)):
        if phases[i, 1] + phases[i, 2] > 0.0:
            total += 2.0 * phases[i, 0] / (phases[i, 1] + phases[i, 2])
    return total
