"""What a run says of its bus: nothing if all went well, else each thing with its number."""

from __future__ import annotations

from dataclasses import asdict

from rds.bus.modules.rds.drivers import Counters
from rds.modes.experiment.outcome import bus_note

SOUND = {"frames": 30000, "error_frames": 0, "struck": 0}


def test_a_sound_bus_is_not_talked_of() -> None:
    assert bus_note({}, {}) is None
    assert bus_note(asdict(Counters(ticks=6000, foreign=3)), SOUND) is None


def test_everything_is_told_with_its_number() -> None:
    counters = Counters(ticks=6000, missing=181, late=75, lost_ticks=4, cut=41)
    note = bus_note(asdict(counters), SOUND | {"error_frames": 1, "struck": 263})
    assert note == (
        "on the bus: 181 answers of modules did not come within the period, 75 of them came later (the position before "
        "stood in for each); modules missed 4 commands; zero volts for 41 periods, because a module was silent; "
        "1 error frame, after which the frames were sent again; 263 frames struck by injected faults"
    )


def test_one_is_one_and_drives_tell_of_emergencies() -> None:
    note = bus_note({"ticks": 5, "missing": 1, "late": 0, "emergencies": 2, "foreign": 0}, {})
    assert note == (
        "on the bus: 1 answer of modules did not come within the period (the position before stood in for it); "
        "2 emergency messages"
    )
