"""`rds network clocks`: clocks of modules in processes of their own, wrong by numbers that the test sets."""

from __future__ import annotations

import time
from pathlib import Path
from types import SimpleNamespace

import can
import pytest
from typer.testing import CliRunner

from rds.bus.modules.rds import frames
from rds.cli.main import app
from rds.core.errors import InputError
from rds.network.loops.bus_clocks import _answers, measure_clocks


@pytest.mark.realtime
def test_drifts_that_were_set_are_found_and_synchronized_modules_keep_the_circle(alone: Path) -> None:
    found = measure_clocks("mini-cnc", seconds=1.0, period=0.02, drift="X=80,Y=-20", radius=20.0, feed=20.0)
    x, y, z = (found.estimates[found.axes.index(name)] for name in "XYZ")
    assert x.drift - z.drift == pytest.approx(80.0, abs=0.5)  # ppm
    assert y.drift - z.drift == pytest.approx(-20.0, abs=0.5)
    without, with_ = found.circles()
    assert without == pytest.approx(0.5 * 20.0 * 100e-6 * 60.0, rel=0.02)  # v·Δt/2 = 0.06 mm
    assert with_ < 1e-5  # mm
    assert "clocks synchronized" in str(found) and found.to_json()["clocks"]["X"]["answers"] > 10


def test_the_codec_of_a_clock() -> None:
    identifier, data = frames.encode_clock(3, 12.000000345)
    assert frames.decode_clock(identifier, data) == (3, pytest.approx(12.000000345, abs=1e-9))
    assert frames.decode_clock(identifier, data[:7]) is None
    assert frames.decode_clock(frames.IDENTITY, data) is None


def test_the_clock_of_a_strangers_module_is_not_taken_for_one_of_the_machines() -> None:
    told = [frames.encode_clock(node, 1.0) for node in (9, 2)]
    heard = [None, *(can.Message(arbitration_id=identifier, data=data) for identifier, data in told)]
    bus = SimpleNamespace(recv=lambda timeout: heard.pop(0) if heard else time.sleep(timeout), send=lambda *_: None)
    clocks, _, _ = _answers(bus, can.Message(arbitration_id=frames.CALL), [2, 3])  # type: ignore[arg-type]
    assert clocks == {2: pytest.approx(1.0)}


@pytest.mark.parametrize(
    ("drift", "message"),
    [("X=fast", "must be ppm by axis"), ("Q=1", "Q"), ("X=1e6", "from -10000 to 10000 ppm"), ("X=1,X=2", "twice")],
)
def test_drifts_that_no_clock_has_are_refused(drift: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        measure_clocks("mini-cnc", drift=drift)
    told = CliRunner().invoke(app, ["network", "clocks", "--seconds", "0.5"])
    assert told.exit_code == 2 and "seconds = 0.5 are too few" in told.output


def test_units_on_a_serial_line_tell_no_clocks() -> None:
    """It was said that they did not start on the built-in bus, and to name a dialect, which this command does not."""
    with pytest.raises(InputError, match="units on a serial line, which tell no clocks"):
        measure_clocks("starmill")
