"""Relay autotuning: oscillate about the reference with a limited voltage, then hold the axis with the gains found.

    u = bias + d      while the error is above ε, and on until it is below -ε
    u = bias - d      while the error is below -ε, and on until it is above ε

The loop swings with amplitude a and period Tu. By the describing function of a relay with hysteresis the gain at which
a proportional loop would just swing is

    Ku = 4 d / (π √(a² - ε²))

where a sampled relay has 4/(N sin(π/N)) in place of 4/π, N the samples of a period (1 for N = 2): 0.6 % more at 16.
(K. J. Åström, T. Hägglund, Automatica 20 (1984) 645-651). Names, the averages over half cycles and the rules `pid` and
`pi` (J. G. Ziegler, N. B. Nichols, Trans. ASME 64 (1942) 759-768) are those of LinuxCNC's at_pid component; the rule
`tyreus-luyben` (B. D. Tyreus, W. L. Luyben, Ind. Eng. Chem. Res. 31 (1992) 2625-2628) is for processes that
integrate, as position axes do. Before half cycles count, `SETTLING` others pass, and the bias is moved by what the two
halves of a cycle differ in length, so that an amplifier's offset, gravity or a spindle's speed leave the swing even.
No model of the axis is used.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from math import exp, inf, isfinite, pi, sin, sqrt
from typing import Any, NamedTuple

from rds.controllers import pid
from rds.controllers.pid_options import BIAS, GAINS
from rds.core.errors import InputError
from rds.core.options import check_known
from rds.core.quantities import Choice, Declaration, Quantity, checked
from rds.core.shared_quantities import SAMPLE_PERIOD
from rds.core.types import SPINDLE_UNIT, Controller, Reference, Source

NAME = "relay"
RULES = {  # Pgain / Ku, Ti / Tu, Td / Tu
    "tyreus-luyben": (1.0 / 2.2, 2.2, 1.0 / 6.3),
    "pid": (0.6, 0.5, 0.125),
    "pi": (0.45, 5.0 / 6.0, 0.0),
}
TUNABLE = {
    "tune_effort": Quantity("voltage of the relay, to either side of the bias", "V", above=0.0),
    "hysteresis": Quantity("error at which the relay changes over; above the encoder's noise", "mm", low=0.0),
    "tune_cycles": Quantity("half cycles that are averaged", "", 2.0, 10_000.0, whole=True),
    "tune_start": Quantity("1 tunes, from 0 to 1 anew; 0 ends the swing", "", 0.0, 1.0, whole=True),
} | BIAS
OPTIONS: Mapping[str, Declaration] = {
    **TUNABLE,
    "tune_type": Choice("rule that makes the gains; a spindle's default is 'pi'", tuple(RULES)),
}
DEFAULTS = {"hysteresis": 0.0, "tune_cycles": 50, "tune_start": 1, "bias": 0.0}
EFFORT = 0.5  # of the converter's range: above the friction of most axes
SETTLING = 12  # half cycles before those that count
PATIENCE, FEW = 1.0, 50  # s, samples: so long the error may neither change its sign nor shrink
FILTER = 8.0  # the derivative is filtered with Td/8
UNEVEN = 0.25  # half cycles that spread by more, rms of their mean, make a doubtful estimate
COARSE = 3.0  # so does an amplitude of fewer counts of the encoder
SLOW = 8.0  # samples of a period from which the smallest change of the measurement is a count
TUNING, HOLDING, NO_OSCILLATION, OFF = 0.0, 1.0, 2.0, 3.0  # what the signal `tuning` says


class State(NamedTuple):
    """Plain floats: what the relay has seen, and what it found."""

    tuning: float = TUNING
    begun: float = 0.0
    started: float = 0.0  # tune_start at the last sample
    effort: float = 0.0  # V, of the relay at this sample
    hysteresis: float = 0.0  # mm
    side: float = 1.0  # of the relay
    bias: float = 0.0  # V
    centre: float = 0.0  # the reference that it swings about, mm
    moved: float = 0.0  # 1: the reference moved meanwhile
    half: float = 0.0  # samples of this half cycle
    before: float = 0.0  # samples of the half cycle before
    peak: float = 0.0  # largest error of this half cycle, mm
    nearest: float = inf  # smallest error since the relay changed over, mm
    waited: float = 0.0  # samples since the error became smaller, or the relay changed over
    passed: float = 0.0  # half cycles, those of settling among them
    lengths: float = 0.0  # sum of the half cycles that count, samples
    squares: float = 0.0  # sum of their squares
    peaks: float = 0.0  # sum of their largest errors, mm
    last: float = 0.0  # measured at the sample before, mm
    step: float = inf  # smallest change of the measurement, mm: a count of the encoder
    amplitude: float = 0.0  # mm
    Ku: float = 0.0  # V/mm
    Tu: float = 0.0  # s
    spread: float = 0.0  # of the half cycles' lengths, rms of their mean
    held: tuple[float, ...] = ()  # state of the PID law that holds the axis


def control(t: float, r: Reference, y: float, state: State, params: Mapping[str, Any]) -> tuple[float, State]:
    """Voltage (V) and next state."""
    s = State(*state)
    start, relay = float(params["tune_start"]), (params["tune_effort"], params["hysteresis"])
    if not s.begun or start > s.started:
        s = State(TUNING if start else OFF, bias=params["bias"], centre=float(r[0]), last=float(y))
    elif start < s.started and s.tuning == TUNING:
        s = s._replace(tuning=OFF)
    elif s.tuning in (TUNING, NO_OSCILLATION) and relay != (s.effort, s.hysteresis):
        s = _anew(s)._replace(tuning=TUNING)
    if s.tuning == TUNING:
        s = s._replace(effort=relay[0], hysteresis=relay[1])
    s = s._replace(begun=1.0, started=start)
    if s.tuning == TUNING:
        s = _swung(float(r[0]), float(y), s, params)
    if s.tuning == TUNING:
        return s.bias + s.side * s.effort, s
    if s.tuning != HOLDING:
        return params["bias"], s
    u, held = pid.law(r[0], r[1], r[2], y, s.held, _coefficients(s, params))
    return u, s._replace(held=held)


def _swung(position: float, y: float, s: State, params: Mapping[str, Any]) -> State:
    """The state after one sample of the relay."""
    error, change = position - y, abs(y - s.last)
    if position != s.centre:
        s = _anew(s)._replace(centre=position, moved=1.0)
    s = s._replace(last=y, step=min(s.step, change) if change > 0.0 else s.step)
    is_over = s.side * error < -s.hysteresis
    size = abs(error)
    if is_over:
        s = _half_cycle(s, params)
        s = s._replace(side=-s.side, before=s.half, half=0.0, peak=0.0, nearest=size, waited=0.0, passed=s.passed + 1.0)
        if s.passed - SETTLING >= params["tune_cycles"]:
            return _found(s, params)
    elif size < s.nearest:
        s = s._replace(nearest=size, waited=0.0)
    if s.waited >= params["patience"]:
        return s._replace(tuning=NO_OSCILLATION)
    return s._replace(half=s.half + 1.0, peak=max(s.peak, size), waited=s.waited + 1.0)


def _anew(s: State) -> State:
    """The same swing, of which nothing counts yet: what was counted is of another reference or relay."""
    kept = ("tuning", "begun", "started", "effort", "hysteresis", "side", "bias", "centre", "moved", "last", "step")
    return State(**{name: getattr(s, name) for name in kept})


def _half_cycle(s: State, params: Mapping[str, Any]) -> State:
    """A half cycle has ended: it counts, or while the swing settles, a whole one moves the bias."""
    if s.passed >= SETTLING:
        lengths, squares = s.lengths + s.half, s.squares + s.half * s.half
        return s._replace(lengths=lengths, squares=squares, peaks=s.peaks + s.peak)
    if s.passed < 2.0 or s.passed % 2.0:
        return s
    room = params["converter_range"] - s.effort
    uneven = s.side * (s.half - s.before) / (s.half + s.before)
    bias = s.bias + s.effort * uneven
    return s._replace(bias=min(max(bias, -room), room) if isfinite(room) else bias)


def _found(s: State, params: Mapping[str, Any]) -> State:
    """The gains are known: the state in which the axis is held, its integral at the voltage that it needs."""
    n = s.passed - SETTLING  # tune_cycles, or more if it was lowered meanwhile
    a, mean = s.peaks / n, s.lengths / n
    Ku = fundamental(2.0 * mean) * s.effort / sqrt(a * a - s.hysteresis**2)
    spread = sqrt(max(s.squares / n - mean * mean, 0.0)) / mean
    s = s._replace(tuning=HOLDING, amplitude=a, Ku=Ku, Tu=2.0 * mean * params["T"], spread=spread)
    return s._replace(held=(s.bias / gains(s.Ku, s.Tu, params["tune_type"])["Igain"], 0.0, 0.0, 0.0, 0.0))


def fundamental(N: float) -> float:
    """Amplitude of the fundamental of a square wave of ±1, sampled N times in each period."""
    return 1.0 if N < 2.5 else 4.0 / (N * sin(pi / N))


def gains(Ku: float, Tu: float, rule: str) -> dict[str, float]:
    """Options of the law `pid` from the ultimate gain (V/mm) and period (s), by one of `RULES`."""
    share, Ti, Td = RULES[rule]
    P = share * Ku
    return {"Pgain": P, "Igain": P / (Ti * Tu), "Dgain": P * Td * Tu, "derivative_filter": Td * Tu / FILTER}


def _coefficients(s: State, params: Mapping[str, Any]) -> tuple[float, ...]:
    """Those of `pid.law`, without feedforward and limits."""
    T, found = params["T"], gains(s.Ku, s.Tu, params["tune_type"])
    q = exp(-T / found["derivative_filter"]) if found["derivative_filter"] > 0.0 else 0.0
    P, I, D = (found[name] for name in GAINS)  # noqa: E741
    none = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # bias, feedforward, deadband
    return (T, q, (1.0 - q) / T, P, I, D, *none, inf, inf, inf, inf, inf, params["converter_range"])


def observe(y: float, state: Any, following: State, params: Mapping[str, Any]) -> tuple[float, ...]:
    """What `SIGNALS` names."""
    s = following
    found = gains(s.Ku, s.Tu, params["tune_type"]) if s.Ku else dict.fromkeys(GAINS, 0.0)
    count = s.step if isfinite(s.step) else 0.0
    told = (s.tuning, s.passed, s.moved, s.effort, s.hysteresis, count, s.spread, s.amplitude, s.Ku, s.Tu)
    return *told, *(found[name] for name in GAINS)


def _signals(unit: str) -> dict[str, str]:
    """What is recorded, with units. `tuning` is 0 while it tunes, then 1: holding, 2: no oscillation, 3: off."""
    per = f"({unit})" if "/" in unit else unit
    plain = {"tuning": "", "half_cycles": "", "moved": "", "effort": "V", "hysteresis": unit, "count": unit}
    found = {"spread": "", "amplitude": unit, "ultimate_gain": f"V/{per}", "ultimate_period": "s"}
    return plain | found | {"Pgain": f"V/{per}", "Igain": f"V/({per} s)", "Dgain": f"V/({per}/s)"}


SIGNALS = tuple(_signals("mm"))


def make(
    axis_model: Mapping[str, Any], T: float, converter_range: float, *, unit: str = "mm", **options: Any
) -> Controller:
    """The relay experiment of one axis, and the PID law that follows it; see `library_controller` and `OPTIONS`.

    `axis_model` is not looked at. Defaults: half of the converter's range (2 V without one), no hysteresis,
    50 half cycles, no bias, the rule `tyreus-luyben` (of a spindle `pi`). InputError for an effort that the converter
    cannot give.
    """
    owner = f"controller {NAME!r}"
    check_known(options, OPTIONS, owner)
    effort = EFFORT * converter_range if isfinite(converter_range) else 2.0
    rule = "pi" if unit == SPINDLE_UNIT else "tyreus-luyben"
    given = {"tune_effort": effort, "tune_type": rule} | DEFAULTS | options
    values = {name: checked(declared, given[name], name, owner) for name, declared in OPTIONS.items()}
    SAMPLE_PERIOD.check(T, "T", owner)
    if values["tune_effort"] + abs(values["bias"]) > converter_range:
        raise InputError(
            f"{owner}: tune_effort = {values['tune_effort']:g} V and bias = {values['bias']:g} V must together stay "
            f"within the converter's range of {converter_range:g} V"
        )
    params = values | {"T": T, "converter_range": converter_range, "patience": float(max(round(PATIENCE / T), FEW))}
    retune = partial(_retuned, T, converter_range, unit, values["tune_type"])
    signals = _signals(unit)
    return Controller(
        control,
        State(),
        params,
        Source(NAME),
        tunable=TUNABLE,
        retune=retune,
        signals=signals,
        observe=observe,
        conclude=conclude,
    )


def _retuned(T: float, limit: float, unit: str, rule: str, values: Mapping[str, float]) -> Mapping[str, Any]:
    """The parameters after they were changed while it runs; the rule stays."""
    return make({}, T, limit, unit=unit, tune_type=rule, **values).params


@dataclass(frozen=True)
class Tuned:
    """What a relay experiment found for one axis."""

    axis: str
    unit: str
    rule: str
    ultimate_gain: float  # V/mm
    ultimate_period: float  # s
    amplitude: float  # mm
    spread: float  # of the half cycles' lengths, rms of their mean
    count: float  # mm, of the encoder; 0 if the swing is too fast to tell
    options: dict[str, float]  # of the law `pid`, six digits

    def controller(self) -> dict[str, Any]:
        """The law that goes on with these gains: what `controller=` of an experiment takes."""
        return {"name": "pid", **self.options, "FF1": 0.0, "FF2": 0.0}

    def __str__(self) -> str:
        per = f"({self.unit})" if "/" in self.unit else self.unit
        said = (
            f"{self.axis}: ultimate gain {self.ultimate_gain:.4g} V/{per}, ultimate period "
            f"{1e3 * self.ultimate_period:.4g} ms, amplitude {self.amplitude:.3g} {self.unit}; "
            f"by the rule {self.rule}: {', '.join(f'{name} = {value:g}' for name, value in self.options.items())}"
        )
        return "; ".join([said, *self.doubts()])

    def doubts(self) -> list[str]:
        """Clauses on what makes the gains doubtful, with the remedy."""
        said = []
        if self.spread > UNEVEN:
            said.append(
                f"these gains are doubtful, as the half cycles differ by {100.0 * self.spread:.0f} % (rms): give more "
                f"tune_effort, or a hysteresis above the encoder's noise"
            )
        if self.amplitude < COARSE * self.count:
            said.append(
                f"these gains are coarse, as the amplitude is {self.amplitude / self.count:.1f} counts of the encoder: "
                f"give more tune_effort, or a hysteresis of {COARSE * self.count:.2g} {self.unit}"
            )
        return said


def tuned(axis: str, unit: str, signals: Mapping[str, Any], params: Mapping[str, Any]) -> Tuned:
    """What the recorded `signals` of one axis tell; InputError with a remedy where the experiment found no gains."""
    if not len(signals[SIGNALS[0]]):
        raise InputError(f"{axis}: the run has no samples, so there are no gains")
    end = {name: float(signals[name][-1]) for name in SIGNALS}
    if end["tuning"] == HOLDING:
        rule, Ku, Tu = str(params["tune_type"]), end["ultimate_gain"], end["ultimate_period"]
        options = {name: float(f"{value:.6g}") for name, value in gains(Ku, Tu, rule).items()}
        count = end["count"] if Tu >= SLOW * params["T"] else 0.0
        return Tuned(axis, unit, rule, Ku, Tu, end["amplitude"], end["spread"], count, options)
    if end["tuning"] == NO_OSCILLATION:
        raise InputError(
            f"{axis}: no sustained oscillation came of {end['effort']:g} V with a hysteresis of {end['hysteresis']:g} "
            f"{unit}, and the relay was switched off; give more tune_effort (friction may hold the axis) or less "
            f"hysteresis, and if the axis ran away, change the sign of its encoder or motor"
        )
    if end["tuning"] == OFF:
        raise InputError(f"{axis}: the relay was not on (tune_start = 0), so there are no gains")
    cause = (
        'the reference moved; let it stand still (kind = "constant")'
        if end["moved"]
        else ("give the run more time, or tune_cycles a smaller number")
    )
    count = max(int(end["half_cycles"]) - SETTLING, 0)
    raise InputError(f"{axis}: the run ended after {count} of {params['tune_cycles']:g} half cycles; {cause}")


def conclude(axis: str, unit: str, signals: Mapping[str, Any], params: Mapping[str, Any]) -> str:
    """The sentence for the notes of the run."""
    try:
        found = tuned(axis, unit, signals, params)
    except InputError as error:
        return str(error)
    return f"{found}; `rds design relay` on the saved run prints them as a table [controller]"
