"""Values that can be changed while a run goes on, as choices: each is sent to the loop when it is set."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rds.modes.loop.live_values import Channel
from rds.panels.equipment.run import EquipmentRun
from rds.panels.equipment.taken_up import TakenUpRun
from rds.panels.session.choices import Choices
from rds.panels.session.fields import Number


class LiveValues(Choices):
    """The live values of a run. One that the loop will not take stays what it was, with InputError."""

    def at_rest(self, name: str, parameters: Iterable[str]) -> str | None:
        """Which of `parameters`, the run's own, a live value is: that of one axis alone, or of its one controller."""
        called = name.rpartition(".")[2]
        alone = sum(other.rpartition(".")[2] == called for other in self.fields) == 1
        found = (each for each in parameters if each.rpartition(".")[2] == called)
        return next(found, None) if alone and "." in name else None

    def __init__(self, run: EquipmentRun | TakenUpRun):
        channels: Mapping[str, Channel] = run.live_values
        several = len({name.partition(".")[0] for name in channels if "." in name}) > 1
        super().__init__(_field(channel, several) for channel in channels.values())
        self._run = run

    def set(self, name: str, value: Any) -> None:
        """Set one from the loop's next sample on; InputError where it will not do, or when the run is over."""
        self._run.change(name, float(self.fields[self._known(name)].check(value)))
        super().set(name, value)


def _field(channel: Channel, several: bool) -> Number:
    """Its owner, an axis, is named where there are several."""
    words = channel.meaning.partition(",")[0]
    return Number(
        channel.name,
        f"{channel.name if several else channel.name.rpartition('.')[2]}, {words}",
        f"{channel.meaning}; holds from the next sample on, and is recorded with its time",
        channel.value,
        unit=channel.unit,
        low=channel.low,
        high=channel.high,
        above=channel.above,
        whole=channel.whole,
    )
