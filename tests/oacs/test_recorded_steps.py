"""A recorded step ends when the axis has settled, says so, and shows how far it has come."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import can
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.bus.modules.oacs import Module, messages
from rds.bus.modules.oacs.codes import MessageToHost
from rds.bus.modules.oacs.messaging import ReceivedMessage
from rds.bus.modules.oacs.module_data import read_modules
from rds.bus.modules.oacs.recording import PositionRecorder
from rds.cli.modules import folder_for
from rds.core.errors import InputError
from rds.machines import load_machine
from rds.panels.design.step_plot import plot
from rds.results import Result

X = read_modules(load_machine("mrmt-oacs"))["X"].describe(1)  # 169 counts per mm
PERIOD = 0.01


def recorded(positions: Sequence[int], by: float = 1.0, lost: Sequence[int] = ()) -> PositionRecorder:
    """A recorder that has heard these counts, one each period, but for the samples that were lost."""
    recorder = PositionRecorder(X, PERIOD, by)
    for number, counts in enumerate(positions):
        if number in lost:
            continue
        frame = messages.encode(
            "Reply",
            Code=MessageToHost.POSITION,
            BoardID=4,
            Item=1,
            PositionAxis=ord("X"),
            Position=counts,
            Sequence=number % 256,
        )
        recorder.take(ReceivedMessage(messages.decode(frame.identifier, frame.data), number * PERIOD, 0.0))
    return recorder


def test_standing_still_counts_from_the_last_move_on() -> None:
    recorder = recorded([0, 50, 100, 150, *[160] * 101])
    assert recorder.still == pytest.approx(1.0)
    assert recorder.way == (160, 169)
    assert recorded([0, 50, 100, 150, *[160] * 101], lost=range(30, 60)).still == pytest.approx(1.0)


def test_an_axis_that_has_not_moved_has_not_settled() -> None:
    assert recorded([7] * 300).still == 0.0
    assert recorded([7, 8, 9, 8] * 100).still == 0.0


@given(creep=st.integers(3, 20), amplitude=st.integers(4, 50), samples=st.integers(20, 400))
def test_neither_creeping_nor_oscillation_is_settled(creep: int, amplitude: int, samples: int) -> None:
    """3 counts in 10 samples are more than the band of 2; so are 4 from crest to crest."""
    assert recorded([k * creep // 10 for k in range(samples)]).still <= 0.11
    assert recorded([100 + amplitude * (k // 10 % 2) for k in range(samples)]).still <= 0.1


@given(st.integers(0, 2), st.integers(0, 200))
def test_an_encoder_between_two_counts_is_settled(jitter: int, samples: int) -> None:
    assert recorded([0, 160, *[160 + jitter * (k % 2) for k in range(samples)]]).still == pytest.approx(
        samples * PERIOD
    )


@pytest.mark.realtime
def test_a_step_that_settles_short_of_its_point_ends_early_and_says_so(
    serve: Callable[..., subprocess.Popen[str]], bus: can.BusABC
) -> None:
    serve("X")
    x = Module(bus, 4, "X")
    x.tune("PI", Kp=2.0, Ki=0.0, sample_time=0.02, kick=0.0)
    ways: list[tuple[int, int]] = []
    result = x.step(1.0, settled=0.4, progress=lambda done, of: ways.append((done, of)))
    moved = np.flatnonzero(np.abs(result["X_measured"] - result["X_measured"][-1]) > 0.012)[-1]  # 2 counts
    assert 0.4 <= result["time"][-1] - result["time"][moved] < 1.5, "not after the 3 s of the module's own end"
    (note,) = result.meta["notes"]
    left = 1.0 - (result["X_measured"][-1] - result["X_measured"][0])
    assert note.startswith(f"stopped after it had stood still for 0.4 s, {left:.3g} mm short of the point")
    assert ways[-1][1] == 169 and ways[-1][0] == pytest.approx(169 * (1 - left), abs=1)
    assert all(a[0] <= b[0] + 2 for a, b in pairwise(ways))
    waited = x.step(0.5, settled=0.0)
    assert "did not move for 3 s" in waited.meta["notes"][0]
    for wrong in (-1.0, float("nan")):
        with pytest.raises(InputError, match=r"settled = .* must be at least 0"):
            x.step(0.5, settled=wrong)


def response(measured: np.ndarray) -> Result:
    time = np.arange(len(measured)) * PERIOD
    columns = {"time": time, "X_reference": np.full(len(time), measured[-1]), "X_measured": measured}
    return Result(columns, {"X_reference": "mm", "X_measured": "mm"}, {"axes": ["X"], "sample_period": PERIOD})


def legend_of(result: Result) -> str:
    legend = plot(result).axes[0].get_legend()
    assert legend is not None
    return " ".join(text.get_text() for text in legend.get_texts())


def test_the_plot_shows_delay_and_time_constant() -> None:
    ramp = np.clip((np.arange(200) * PERIOD - 0.2) / 0.5, 0.0, 1.0)  # its tangent is the ramp itself
    assert "delay 200 ms, time constant 500 ms" in legend_of(response(ramp))
    assert "mean" not in legend_of(response(ramp))


def test_the_plot_says_why_there_is_no_tangent() -> None:
    assert "no delay and time constant: the response overshoots by 30 %" in legend_of(
        response(np.array([0.0, 0.5, 1.3, *[1.0] * 100]))
    )


def test_a_record_never_replaces_another_unasked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert folder_for(None, False) == Path("step-1")
    Path("step-1").mkdir()
    assert folder_for(None, False) == Path("step-2")
    assert folder_for(Path("step-1"), False) == Path("step-1"), "nothing is in it"
    Path("step-1/step.png").touch()
    with pytest.raises(InputError, match=r"step-1: something is there already.*--force"):
        folder_for(Path("step-1"), False)
    assert folder_for(Path("step-1"), True) == Path("step-1")
    with pytest.raises(InputError, match="--force replaces"):
        folder_for(None, True)


@pytest.mark.realtime
def test_a_motion_tells_where_it_is(serve: Callable[..., subprocess.Popen[str]], bus: can.BusABC) -> None:
    serve("X")
    told: list[float] = []
    reached = Module(bus, 4).move(by=2.0, progress=told.append)
    assert len(told) >= 5 and told == sorted(told)
    assert 0.0 <= told[0] < 1.5 and told[-1] == pytest.approx(reached, abs=0.3)
