"""What the loop that jogs says, in which order."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import pytest

from rds.machines import load_machine
from rds.panels.jog.axes import jog_axes
from rds.panels.jog.jog_commands import JogCommands
from rds.panels.jog.loop import jog


class Drives:
    """One axis, whose homing makes 4 mm of the place where it stands; after that its orders end."""

    period = 1e-4  # s

    def __init__(self) -> None:
        self.axes = {"X": jog_axes(load_machine("mini-cnc"))["X"]}
        self.spindles: dict[str, Any] = {}
        self.left_out: dict[str, str] = {}
        self.orders = JogCommands(self.axes, {})
        self.at = 0.0

    def start(self) -> None:
        self.orders.hear({"home": {"X": 37}}, 0.0)

    def read(self) -> dict[str, float]:
        return {"X": self.at}

    def write(self, places: Mapping[str, float], speeds: Mapping[str, float]) -> None:
        pass

    def home(self, methods: Mapping[str, int], watch: Any) -> None:
        watch("X", self.at)
        self.at = 4.0
        self.orders.ended = True

    def close(self) -> None:
        pass


def test_who_hears_that_an_axis_is_homed_has_heard_where_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    """`rds jog X --find-home 37` told the position from before where the computer was held up just then."""
    hand = Drives()
    jog(hand, hand.orders)
    said = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    end = said.index({"homed": ["X"]})
    assert said[end - 1] == {"measured": {"X": 4.0}, "places": {"X": 4.0}, "moving": False, "homing": ""}
