"""What a drive's parameters say before anything moves: units, mapping, limits, inputs; each finding with its remedy."""

from __future__ import annotations

from dataclasses import dataclass

import canopen

from rds.bus.modules.cia402 import codes
from rds.bus.modules.cia402.codes import State, error_text, state_of, status_text
from rds.bus.modules.cia402.identity import number

_LOWEST, _HIGHEST = -(1 << 31), (1 << 31) - 1
_SWITCHES = {1: "negative limit switch", 2: "positive limit switch", 8: "interlock (emergency stop)"}


@dataclass(frozen=True)
class Units:
    """How a drive counts. Ratios of its objects; None where it has none."""

    encoder: float | None  # 0x608F: increments per motor revolution
    gear: float  # 0x6091: motor revolutions per shaft revolution
    feed: float | None  # 0x6092: position units per shaft revolution

    def counts(self, lead: float) -> float | None:
        """Position units per axis unit, where the axis moves by `lead` of them with a revolution of the shaft."""
        per_turn = self.feed if self.feed is not None else self.encoder and self.encoder * self.gear
        return per_turn / lead if per_turn else None

    @property
    def per_increment(self) -> float | None:
        """Position units (0x6064) per increment of the encoder (0x6063) as the objects say it."""
        if self.feed is None or not self.encoder:
            return None
        return self.feed / (self.encoder * self.gear)

    def __str__(self) -> str:
        words = [f"encoder {_value(self.encoder)} increments per motor revolution (0x608F)"]
        words.append(f"gear {self.gear:g} motor revolutions per shaft revolution (0x6091)")
        words.append(f"{_value(self.feed)} position units per shaft revolution (0x6092)")
        return ", ".join(words)


def read_units(node: canopen.RemoteNode) -> Units:
    """From 0x608F, 0x6091 and 0x6092, where the drive has them."""
    gear = _ratio(node, 0x6091)
    return Units(_ratio(node, 0x608F), 1.0 if gear is None else gear, _ratio(node, 0x6092))


@dataclass(frozen=True)
class ExaminationFinding:
    """Something that is not as it should be, and what to do; `write` are the values that would mend it."""

    text: str
    write: tuple[tuple[int, int, int], ...] = ()
    stops: bool = False  # nothing may move with it


def limits(node: canopen.RemoteNode, torque: int) -> list[ExaminationFinding]:
    """Limits that leave no motion, switches that are active, faults that stay. `torque` is the ‰ that are wanted."""
    found = []
    largest = number(node, 0x6072)
    if largest is not None and 0 < largest < torque / 2:
        found.append(
            ExaminationFinding(
                f"the largest torque, 0x6072, is {largest} ‰ of the rated one: an axis that needs more falls behind "
                "(following error); raise it in the drive once its motor's data are in"
            )
        )
    if largest == 0:
        found.append(
            ExaminationFinding(
                f"the largest torque, 0x6072, is 0: the drive would never move; it is to be {torque} ‰",
                ((0x6072, 0, torque),),
            )
        )
    low, high = (number(node, 0x607D, place, signed=True) for place in (1, 2))
    if low is not None and high is not None and low >= high:
        found.append(
            ExaminationFinding(
                f"the software limits, 0x607D, are {low} and {high}, which leave no way; they are to be taken off. Set "
                "yours once the axis is homed",
                ((0x607D, 1, _LOWEST), (0x607D, 2, _HIGHEST)),
            )
        )
    inputs = number(node, 0x60FD) or 0
    for bit, name in _SWITCHES.items():
        if inputs & bit:
            found.append(
                ExaminationFinding(
                    f"the {name} is active (0x60FD = {inputs:#x}): release it, connect it, or configure its polarity",
                    stops=True,
                )
            )
    status = number(node, 0x6041)
    if status is not None and state_of(status) in (State.FAULT, State.FAULT_REACTION_ACTIVE):
        code = number(node, 0x603F) or 0
        found.append(
            ExaminationFinding(
                f"the drive is in fault: {error_text(code)}; it is reset before the axis moves; if it stays, "
                "see the manual"
            )
        )
    if status is not None and not status & codes.VOLTAGE_ENABLED:
        found.append(
            ExaminationFinding(
                f"the power stage has no supply (statusword {status_text(status)}): switch the drive's motor supply on",
            )
        )
    return found


def gear_finding(units: Units, increments: int, moved: int) -> ExaminationFinding | None:
    """Whether a motion of `increments` (0x6063) and `moved` position units (0x6064) contradicts the objects."""
    said = units.per_increment
    if said is None or abs(increments) < 10:
        return None
    was = moved / increments
    if abs(was - said) <= 0.2 * abs(said) + 2.0 / abs(increments):
        return None
    return ExaminationFinding(
        f"the objects 0x608F, 0x6091 and 0x6092 say {said:g} position units per increment, and the motion showed "
        f"{was:g}: {units}. Correct the one that is not your motor's or gear's, or give the units yourself by --counts",
        stops=True,
    )


def _ratio(node: canopen.RemoteNode, index: int) -> float | None:
    above, below = number(node, index, 1), number(node, index, 2)
    return above / below if above and below else None


def _value(value: float | None) -> str:
    return "?" if value is None else f"{value:g}"
