"""A submission's closed loop, linearized about its motion, from outside.

The controller is a black box. The linear law that answers as it did in its own run is found there (`law_fit`); with it
and the axis's linear part G the loop is closed here, and answers a pulse D at the plant's input with the voltage Uc:

    L(z) = - Uc(z) / (Uc(z) + D(z)),    1 + L = 0 at the closed loop's poles.

What the law is depends on nothing but the run that is graded: no other plant is shown to it, so that none can be
noticed, and deviations are as large as a force on the axis makes them, many counts of the encoder.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice, pairwise
from operator import mul

import numpy as np

from rds.core.types import Model
from rds.grading.criteria.law_fit import LawFit, departure, law_fits
from rds.identification.robustness.margins import margins_of
from rds.modes.parts import start

PULSE = 1.0  # V, for one sample
MOST = 0.25  # of the answer: by how much the linear law may depart in the whole stretch
MOST_IN_A_PART = 0.45  # and in each of `_PARTS`: who is another law for a while is found, too
_PARTS = 8
_QUARTERS = 4  # of the stretch, in which a law that is not one is fitted by itself
_SHORTEST = 40  # samples: a part that is halved again
_VALUES = 6  # different ones, at least, in such a part
_SIMPLER = 1.1  # a law of higher order must depart less than by this factor
_SURELY = 0.05  # of the answer: a law that departs by more may be given poles that it does not have
_AT_LIMIT, _OFTEN = 0.9, 0.2  # of the converter's limit; of the samples: where a loop that is not stable ends
_CHATTERS = 0.25  # of the limit: RMS change of a voltage from sample to sample that switches rather than controls
_FEW_JUMPS = 6  # in a part that switches: a law that starts, or meets its limit, has fewer
_GONE, _LEFT = 1e-6, 1e-3  # of the largest deviation: enough, and most, that may be left of it at the end
_SHORT, _LONG = 1 << 10, 1 << 14  # samples of an answer
SWITCHES = "its voltage switches from sample to sample by a good part of the converter's range"
_GROWS = "the loop is not stable: a deviation grows"
_FAR = 1e9  # mm: an axis that has gone as far does not come back
_GRID = 1 << 16
_HANKEL = 300  # rows
_RANK = 1e-7  # of the largest singular value: what counts as a mode


@dataclass(frozen=True)
class LinearLoop:
    """The loop's answer to a pulse of `PULSE` V: deviations of voltage (V) and position (mm), every `T` s."""

    voltage: np.ndarray
    position: np.ndarray
    T: float

    @cached_property
    def margins(self) -> tuple[float, float, float]:
        """Gain margin (dB), phase margin (°), least distance of L from -1; inf where nothing crosses."""
        w, locus = self.locus(_GRID)
        gain, phase, modulus = margins_of(w, locus[None])[0]
        return float(gain), float(phase), float(modulus)

    def locus(self, points: int) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies (rad/s) up to half the sampling rate, half of `points` at least, and L there."""
        answer = np.fft.rfft(self.voltage, max(points, 4 * len(self.voltage)))[1:]
        w = np.linspace(0.0, np.pi / self.T, len(answer) + 1)[1:]
        return w, np.asarray(-answer / (answer + PULSE))

    @cached_property
    def poles(self) -> np.ndarray:
        """The poles z that show in the position, largest first, by realization from its Hankel matrix (Ho and Kalman).

        Modes that the pulse hardly moves, or that have gone within a sample, are not found.
        """
        h = self.position[1:]
        rows = min(_HANKEL, len(h) // 2)
        hankel = np.lib.stride_tricks.sliding_window_view(h, rows)[: rows + 1].T
        left, sizes, _ = np.linalg.svd(hankel[:, :-1], full_matrices=False)
        rank = int(np.count_nonzero(sizes > _RANK * sizes[0]))
        seen = left[:, :rank] * np.sqrt(sizes[:rank])
        step = np.linalg.lstsq(seen[:-1], seen[1:], rcond=None)[0]
        poles = np.linalg.eigvals(step)
        return np.asarray(poles[np.argsort(-np.abs(poles), kind="stable")])

    @property
    def least_damping(self) -> float:
        """The least damping ratio ζ of its poles z = exp(s T), ζ = -Re s / |s|; 1 where none oscillates."""
        found = self.poles[np.abs(self.poles) > 1e-3]
        s = np.log(found.astype(complex)) / self.T
        ratios = -s.real / np.maximum(np.abs(s), 1e-300)
        swings = np.abs(s.imag) > 1e-6 * np.abs(s)
        return float(np.where(swings, ratios, 1.0).min(initial=1.0))


@dataclass(frozen=True)
class NoLoop:
    """Why there is no linearized loop. `is_known`: it was seen that there is none; else it could not be measured.

    `nearest` is then the loop of the linear law that departs least, by however much.
    """

    why: str
    is_known: bool
    nearest: LinearLoop | None = None


def switches(command: np.ndarray, limit: float) -> bool:
    """Whether a voltage goes to and fro by a good part of `limit` (V) from sample to sample, as that of a relay."""
    changes = np.diff(command)
    return not np.isfinite(changes).all() or bool(np.sqrt(np.mean(changes**2)) >= _CHATTERS * limit)


def switches_again(command: np.ndarray, limit: float) -> bool:
    """Whether a part of a voltage (V) switches as a relay, again and again, once it is cut at `limit` (V)."""
    changes = np.diff(np.clip(command, -limit, limit))
    jumps = np.count_nonzero(np.abs(changes) >= _CHATTERS * limit)
    return bool(jumps >= _FEW_JUMPS and np.sqrt(np.mean(changes**2)) >= _CHATTERS * limit)


def _runs_away(command: np.ndarray, limit: float) -> bool:
    """Whether a voltage (V) is often at the converter's `limit`, or at one of its own, as that of an unstable loop."""
    at_end = (command == command.max()) | (command == command.min()) | (np.abs(command) >= _AT_LIMIT * limit)
    return bool(at_end.mean() >= _OFTEN)


@np.errstate(over="ignore", invalid="ignore")  # of voltages that no converter has
def linear_loop(
    voltage: np.ndarray, position: np.ndarray, command: np.ndarray, limit: float, model: Model, T: float
) -> LinearLoop | NoLoop:
    """The loop about the linear axis `model`, of the law that answers deviations `position` (mm) with `voltage` (V).

    Both are of a stretch that begins with the force; `command` (V) is that of the same stretch without it, `limit` (V)
    the converter's. Of a law that is several, one after the other, the least stable.
    """
    if not np.any(position):
        return NoLoop("a force on the axis moves nothing: how its voltage answers cannot be seen", False)
    if not np.any(voltage):
        return NoLoop("its voltage does not depend on the measured position: there is no loop", True)
    nearest = None
    if np.isfinite(voltage).all():
        about = _Answer(voltage, position, command + voltage, limit, model, T)
        whole = about.best(slice(None), _PARTS)
        if whole is not None:
            return whole
        if any(switches_again(part, limit) for part in np.array_split(command, _PARTS)):
            return NoLoop(SWITCHES, True)
        edges = np.linspace(0, len(voltage), _QUARTERS + 1).astype(int)
        quarters = [slice(int(a), int(b)) for a, b in pairwise(edges)]
        loops = [loop for quarter in quarters for loop in about.of_part(quarter)]
        if unstable := next((loop for loop in loops if isinstance(loop, NoLoop)), None):
            return unstable
        if loops:
            return min((loop for loop in loops if isinstance(loop, LinearLoop)), key=lambda loop: loop.margins[2])
        nearest = about.nearest()
    if switches(command, limit):
        return NoLoop(SWITCHES, True)
    return NoLoop("no linear law answers a force as it does, not even nearly", False, nearest)


@dataclass(frozen=True)
class _Answer:
    """How a law answers a force: deviations `voltage` (V) and `position` (mm); the `command` (V) under the force."""

    voltage: np.ndarray
    position: np.ndarray
    command: np.ndarray
    limit: float
    model: Model
    T: float

    def of_part(self, part: slice) -> Iterator[LinearLoop | NoLoop]:
        """The loop of the law in this part; where it has none, those of what is exactly a linear law in parts of it."""
        loop = self.best(part, 1)
        if loop is not None:
            yield loop
            return
        todo = [part]
        while todo:
            part = todo.pop()
            if min(len(np.unique(each[part])) for each in (self.voltage, self.position)) < _VALUES:
                continue  # held, as it is rounded: no law
            for fit in law_fits(self.voltage, self.position, part, exactly=True):
                if fit.is_exact:
                    loop = closed(fit, self.model, self.T)
                    if isinstance(loop, LinearLoop) or loop.why == _GROWS:  # else nothing was measured in this part
                        yield loop
                    break
            else:
                if (length := part.stop - part.start) >= _SHORTEST:
                    middle = part.start + length // 2
                    todo += [slice(part.start, middle), slice(middle, part.stop)]

    def nearest(self) -> LinearLoop | None:
        """The loop of the law that departs least, of those with a stable one."""
        fits = sorted(law_fits(self.voltage, self.position), key=lambda fit: fit.departure)
        loops = (closed(fit, self.model, self.T) for fit in fits)
        return next((loop for loop in loops if isinstance(loop, LinearLoop)), None)

    def best(self, part: slice, parts: int) -> LinearLoop | NoLoop | None:
        """The loop of the law that fits this part; NoLoop where that is surely unstable; None where none fits."""
        found: list[LawFit] = []
        for fit in law_fits(self.voltage, self.position, part):
            if fit.departure > MOST or departure(fit, self.voltage, self.position, part, parts) > MOST_IN_A_PART:
                continue
            if fit.is_exact:
                return closed(fit, self.model, self.T)
            found.append(fit)
        loops: dict[int, LinearLoop | NoLoop] = {}  # by place in `found`: only those that are looked at are computed
        nearest_first = sorted(range(len(found)), key=lambda place: found[place].departure)
        for nearest in nearest_first:
            loops[nearest] = closed(found[nearest], self.model, self.T)
            if isinstance(loops[nearest], NoLoop):
                continue
            for place, fit in enumerate(found[:nearest]):
                if fit.departure > _SIMPLER * found[nearest].departure:
                    continue
                loop = loops[place] if place in loops else closed(fit, self.model, self.T)
                if isinstance(loop, LinearLoop):
                    return loop
            return loops[nearest]
        if not found:
            return None
        share, unstable = found[nearest_first[0]].departure, loops[nearest_first[0]]
        return unstable if share <= _SURELY or _runs_away(self.command[part], self.limit) else None


def closed(fit: LawFit, model: Model, T: float) -> LinearLoop | NoLoop:
    """The answer of a linear law on a linear axis to a pulse, until it has died down."""
    samples = _SHORT
    answers = _answers(fit, model, T)
    voltages: list[float] = []
    positions: list[float] = []
    while True:
        for voltage, position in islice(answers, samples - len(positions)):
            voltages.append(voltage)
            positions.append(position)
        loop = LinearLoop(np.array(voltages), np.array(positions), T)
        if len(loop.position) < samples:  # of a loop that grows fast there may be a few only
            return NoLoop(_GROWS, True)
        size = np.abs(loop.position).max()
        ends = [np.abs(part).max() for part in np.array_split(loop.position, 20)]
        if not np.isfinite(size):
            return NoLoop(_GROWS, True)
        if ends[-1] <= _GONE * size or (samples == _LONG and ends[-1] <= _LEFT * size):
            return loop
        if samples == _LONG:
            if ends[-1] >= ends[-2]:
                return NoLoop("the loop is not stable: a deviation does not die down", True)
            return NoLoop(f"a deviation takes longer than {_LONG * T:.3g} s to die down", False)
        samples *= 4


def _answers(fit: LawFit, model: Model, T: float) -> Iterator[tuple[float, float]]:
    """Voltage and position at each sample, as long as the axis comes back."""
    motion = start(model, T)
    a, b = fit.a[1:].tolist(), fit.b.tolist()
    last_u, last_y = deque([0.0] * len(a), len(a)), deque([0.0] * len(b), len(b))  # the latest first
    pulse = PULSE
    while True:
        y = motion.read()
        last_y.appendleft(y)
        u = sum(map(mul, b, last_y)) - sum(map(mul, a, last_u))
        last_u.appendleft(u)
        if not abs(y) < _FAR:
            return
        yield u, y
        motion.write(u + pulse)
        pulse = 0.0
