"""A program carried out: as planned when nobody interferes, on its path within the limits when somebody does."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.core.shared_quantities import FREE_FEED, LOCKED_FEED, TIED_FEED
from rds.core.types import Ending
from rds.interpolators.motion.segments import BLEND, SEGMENT, arc, chain, line
from rds.machines import load_machine
from rds.modes.loop.changes import LiveChanges, plan_changes, stop_channel
from rds.modes.loop.execution import Execution, State
from rds.modes.loop.laws import LiveReference
from rds.modes.loop.program import program_channels
from rds.modes.loop.retimed import EXCESS, RetimedProgram
from rds.nc.path_block import Event, PathBlock
from rds.nc.run.contour import contour_error
from rds.nc.run.prepare import Prepared, planned

T = 0.001
MACHINE = load_machine("mini-cnc")
STOP = stop_channel()


class Ran(NamedTuple):
    """What a program asked of the axes: positions (n × 3), velocities, accelerations, and its own four columns."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    line: np.ndarray
    place: np.ndarray
    rate: np.ndarray
    state: np.ndarray
    speed: np.ndarray
    ending: Ending
    reason: str


@cache
def whole() -> Prepared:
    """The program of `PATH`, planned once."""
    return prepared(PATH)


def prepared(path: np.ndarray, *events: Event) -> Prepared:
    block = PathBlock(path, [*events, Event(len(path) - 1, "end", 0.0, 99)])
    return planned([block], MACHINE, T, Path("made.ngc"))


def execute(program: Prepared, changes: Any = (), speed: Any = lambda k, wanted: wanted) -> Ran:
    """The references of a program, sample by sample; `speed(sample, wanted)` is the spindle's measured one."""
    channels = program_channels()
    references = [LiveReference() for _ in range(4)]
    execution = Execution(
        program.program,
        T,
        RetimedProgram(program.program, T),
        references,
        3,
        1.0,
        lambda names: live_changes.expects(names),
    )
    by_name = {channel.name: channel for channel in (*channels, STOP)}
    live_changes = LiveChanges(
        [*channels, STOP], execution.actions(), plan_changes(changes, by_name, T), execution.over
    )
    rows, parts = [], []
    k = 0
    while (ending := live_changes(k)) is None:
        row: list[float] = []
        wanted = references[3].position.value
        execution.law(k, [0.0, 0.0, 0.0, speed(k, wanted)], row, [])
        rows.append([*row, references[3].position.value])
        parts.append([[r.position.value, r.velocity.value, r.acceleration.value] for r in references[:3]])
        k += 1
        assert k < 200_000
    p = np.array(parts)
    columns = np.array(rows).T
    return Ran(p[:, :, 0], p[:, :, 1], p[:, :, 2], *columns, ending, live_changes.reason)


PATH = chain(
    line((0, 0, 0), (6, 0, 0), 10.0, program_line=1),
    arc((6, 0, 0), (6, 4, 0), (6, 2), 8.0, program_line=2),
    line((6, 4, 0), (0, 4, -2), 12.0, program_line=3),
    line((0, 4, -2), (1, 1, -2), 5.0, program_line=4),
)


def check_motion(ran: Ran, path: np.ndarray = PATH) -> None:
    """Within the limits, by differences of the samples, and on the path."""
    moved = np.diff(ran.position, axis=0) / T
    padded = np.pad(ran.position, ((3, 3), (0, 0)), mode="edge")
    for order, limit in enumerate(whole().program.limits, 1):
        assert (np.abs(np.diff(padded, order, axis=0)).max(axis=0) / T**order <= limit * (1.0 + 1.1 * EXCESS)).all()
    row = np.clip(np.ceil(ran.place).astype(int), 0, len(whole().segment) - 1)
    on_path = ran.state != State.HOME
    off, _ = contour_error(ran.position[on_path], path, whole().segment[row][on_path], np.full(on_path.sum(), 0.05))
    assert off.max() < 1e-6
    assert (ran.rate[~np.isin(ran.state, (State.RUNS, State.HOME))] == 0.0).all(), "what stands has no rate"
    # and what the laws are told of velocity is that of the positions
    between = 0.5 * (ran.velocity[1:] + ran.velocity[:-1])
    assert np.abs(moved - between)[ran.state[1:] != State.HOME].max(initial=0.0) < 0.05


def test_without_anybody_s_doing_it_is_the_plan() -> None:
    ran = execute(whole())
    program = whole().program
    assert (ran.position == program.position).all()
    assert (ran.velocity == program.velocity).all()
    assert (ran.acceleration == program.acceleration).all()
    assert (ran.line == program.line).all()
    assert (ran.place == np.arange(program.samples)).all() and (ran.rate == 1.0).all()
    assert (ran.ending, ran.reason) == (Ending.DONE, "")


@settings(max_examples=12)
@given(
    overrides=st.lists(st.tuples(st.floats(0.0, 4.0), st.floats(0.05, 2.0)), max_size=6),
    holds=st.lists(st.tuples(st.floats(0.0, 4.0), st.floats(0.01, 0.5)), max_size=3),
)
def test_override_and_hold_keep_to_path_and_limits(
    overrides: list[tuple[float, float]], holds: list[tuple[float, float]]
) -> None:
    changes = [(at, "override", share) for at, share in overrides]
    changes += [change for at, long in holds for change in ((at, "hold", 1), (at + long, "hold", 0))]
    ran = execute(whole(), [*changes, (30.0, "hold", 0)])
    check_motion(ran)
    assert ran.ending is Ending.DONE
    assert (ran.position[-1] == whole().program.position[-1]).all()
    assert (np.diff(ran.place) >= 0.0).all()


@pytest.mark.parametrize("share", [0.25, 0.5, 2.0])
def test_the_feed_follows_the_override(share: float) -> None:
    long = prepared(line((0, 0, 0), (30, 0, 0), 4.0, program_line=1))
    ran = execute(long, [(0.0, "override", share)])
    assert ran.velocity[:, 0].max() == pytest.approx(4.0 * share, rel=1e-3)
    assert len(ran.position) == pytest.approx(long.program.samples / share, rel=0.08)


def test_rapids_are_not_made_faster_than_the_axes() -> None:
    rapid = prepared(line((0, 0, 0), (30, 0, 0), 0.0, rapid=True, program_line=1))
    ran = execute(rapid, [(0.0, "override", 2.0)])
    assert ran.velocity[:, 0].max() <= rapid.program.limits[0, 0] * 1.0001


@given(at=st.floats(0.0, 2.4))
@settings(max_examples=20)
def test_a_stop_comes_to_rest_on_the_path(at: float) -> None:
    ran = execute(whole(), [(at, "stop", 1)])
    check_motion(ran)
    assert ran.ending is Ending.STOPPED
    assert ran.reason == f"stopped in line {int(ran.line[-1])}"
    assert np.abs(ran.velocity[-1]).max() == 0.0
    assert len(ran.position) * T < at + 1.0


@given(at=st.floats(0.0, 2.4))
@settings(max_examples=20)
def test_the_way_home_is_up_then_straight_within_the_limits(at: float) -> None:
    ran = execute(whole(), [(at, "home", 1)])
    check_motion(ran)
    assert (ran.position[-1] == 0.0).all()
    assert (np.abs(ran.acceleration).max(axis=0) <= whole().program.limits[1] * (1.0 + 2.0 * EXCESS)).all()
    assert ran.reason.startswith("went home from line ")
    way = ran.position[ran.state == State.HOME]
    low = way[:, 2] < -1e-9
    assert (way[low][:, :2] == way[:1, :2]).all()  # X and Y stand while Z is down


@given(at=st.floats(0.0, 0.6), until=st.floats(0.05, 1.0))
@settings(max_examples=20)
def test_a_hold_on_the_way_home_keeps_the_limits(at: float, until: float) -> None:
    ran = execute(whole(), [(1.6, "home", 1), (1.7 + at, "hold", 1), (1.7 + at + until, "hold", 0)])
    check_motion(ran)
    assert (ran.position[-1] == 0.0).all()


def test_time_stands_still_while_it_is_held_on_the_way_home() -> None:
    program = whole().program
    execution = Execution(
        program, T, RetimedProgram(program, T), [LiveReference() for _ in range(4)], 3, 1.0, lambda names: True
    )
    change = execution.actions()
    waited = []
    for k in range(1500):
        for sample, name, value in ((600, "home", 1.0), (800, "hold", 1.0), (1400, "hold", 0.0)):
            if k == sample:
                change[name](value)
        waited.append(execution.waits())
        execution.law(k, [0.0] * 4, [], [])
    held = np.flatnonzero(waited)
    assert 800 < held[0] < 1200 and (np.diff(held) == 1).all() and held[-1] == 1399


def test_a_hold_that_nobody_can_end_ends_the_run() -> None:
    ran = execute(whole(), [(0.5, "hold", 1)])
    assert ran.ending is Ending.STOPPED
    assert "held in line 1, and nobody is there to let it go on" in ran.reason


def test_stops_wait_for_whoever_is_to_come_and_for_nobody_else() -> None:
    events = (Event(0, "stop", 0.0, 7), Event(1, "stop", 1.0, 8), Event(2, "tool", 3.0, 9))
    program = prepared(PATH, *events)
    alone = execute(program)
    assert len(alone.position) == program.program.samples + 3  # one sample each, and on
    first = program.program.happenings[0].sample * T
    changes = [(first + 0.5, "resume", 1), (first + 20.0, "optional_stop", 0), (first + 30.0, "resume", 2)]
    waited = execute(program, changes)
    assert (waited.state == State.STOP).sum() == pytest.approx(30.0 / T, rel=0.2)
    assert waited.line[waited.state == State.STOP][0] == 7
    assert (np.diff(waited.position[waited.state == State.STOP], axis=0) != 0.0).any(axis=1).sum() == 1
    skipped = execute(program, [(0.0, "optional_stop", 0)])
    assert len(skipped.position) == program.program.samples + 2


def test_a_dwell_lasts_as_long_whatever_the_override() -> None:
    program = prepared(PATH, Event(1, "dwell", 0.25, 5))
    assert len(execute(program).position) == program.program.samples
    for share in (0.5, 2.0):
        ran = execute(program, [(0.0, "override", share)])
        assert (ran.state == State.DWELL).sum() == 250
    dwelt = np.flatnonzero(execute(program).state == State.DWELL)
    ran = execute(program, [(T * dwelt[100], "override", 0.5)])
    assert ran.rate[dwelt[-1] + 1] == 0.5, "at rest a rate is taken at once"


def test_cutting_begins_when_the_spindle_turns_as_fast_as_it_should() -> None:
    program = prepared(PATH, Event(-1, "spindle", 2000.0, 5))
    ran = execute(program, speed=lambda k, wanted: min(10.0 * k, wanted))
    waits = ran.state == State.SPINDLE
    assert waits.sum() == pytest.approx(196 + 9, abs=2)  # 2 % below 2000, ten samples of it
    assert len(ran.position) == program.program.samples + waits.sum()
    assert (ran.position[: waits.sum()] == 0.0).all()
    assert (ran.speed[2:] == 2000.0).all()


def test_the_first_sample_is_of_the_line_that_it_waits_for() -> None:
    assert execute(prepared(PATH, Event(-1, "spindle", 2000.0, 5))).line[0] == 5
    assert execute(prepared(PATH)).line[0] == 1


def test_a_tool_is_changed_when_the_spindle_stands() -> None:
    events = (Event(-1, "spindle", 2000.0, 5), Event(0, "tool", 3.0, 9))
    turns = [0.0]

    def coasting(k: int, wanted: float) -> float:
        turns[0] += 0.02 * (wanted - turns[0])
        return turns[0]

    ran = execute(prepared(PATH, *events), speed=coasting)
    change = np.flatnonzero(ran.state == State.TOOL)[0]
    stops = np.flatnonzero((ran.state == State.SPINDLE) & (ran.line == 9))
    assert len(stops) > 250 and stops[-1] == change - 1  # 2000 to 2 rev/min at 2 % a sample
    assert (ran.speed[stops[0] + 1 :] == 0.0).all()
    assert (np.diff(ran.position[stops], axis=0) == 0.0).all()


def test_the_last_sample_tells_the_spindle_to_stop() -> None:
    """The end of a record, and the page, said 2000 rev/min of a program that ends with M5."""
    ran = execute(prepared(PATH, Event(-1, "spindle", 2000.0, 5), Event(len(PATH) - 1, "spindle", 0.0, 98)))
    assert ran.ending is Ending.DONE and ran.speed[-1] == 0.0
    assert (ran.speed[2:-1] == 2000.0).all()


def test_a_spindle_that_never_gets_there_is_told() -> None:
    program = prepared(PATH, Event(-1, "spindle", -2000.0, 5))
    ran = execute(program, speed=lambda k, wanted: 0.5 * wanted)
    assert ran.ending is Ending.STOPPED
    assert "the spindle turns at -1000 rev/min 10 s after line 5 asked for -2000" in ran.reason
    assert (ran.position == 0.0).all()


def test_a_thread_is_cut_at_the_feed_of_its_spindle() -> None:
    """An override or a rest in it would spoil its pitch; M49 leaves the feed to the program, but not the hold."""
    events = (
        Event(0, "override", TIED_FEED, 2),
        Event(1, "override", LOCKED_FEED, 3),
        Event(2, "override", FREE_FEED, 4),
    )
    program = prepared(PATH, *events)
    begins = next(each.sample for each in program.program.happenings if each.kind == "override")
    for changes in ([(0.0, "override", 0.5)], [(0.0, "override", 2.0)], [(begins * T + 0.3, "hold", 1)]):
        ran = execute(program, changes)
        moves = ran.state == State.RUNS
        inner = [moves & (ran.line == k) & (ran.place != np.roll(ran.place, 1)) for k in (1, 2, 3, 4)]
        assert (ran.rate[inner[1]][:-1] == 1.0).all()
        if changes[0][1] == "override":
            assert (ran.rate[inner[2]][:-1] == 1.0).all()
            assert (ran.rate[inner[0]][:-1] != 1.0).any()
            assert (ran.rate[inner[3]][:-1] != 1.0).any()
        else:
            assert ran.position[-1].tolist() == [6.0, 4.0, 0.0]  # where the thread ends
            assert "held in line" in ran.reason
    home = execute(program, [(begins * T + 0.3, "home", 1)])
    assert home.position[home.state != State.HOME][-1].tolist() == [6.0, 4.0, 0.0]
    last = prepared(PATH, Event(0, "override", TIED_FEED, 2), Event(3, "override", FREE_FEED, 4))
    assert execute(last, [(begins * T + 0.3, "home", 1)]).reason == "went home from line 4"
    stop = execute(program, [(begins * T + 0.3, "stop", 1)])
    assert stop.reason == "stopped in line 2"
    step = prepared(
        PATH, Event(0, "override", TIED_FEED, 2), Event(1, "stop", 0, 3), Event(3, "override", FREE_FEED, 4)
    )
    assert execute(step, [(begins * T + 0.3, "home", 1)]).reason == "went home from line 3"


@pytest.mark.parametrize("changes", [[("hold", 1), ("hold", 0)], [("override", 0.0), ("override", 1.0)]])
def test_a_hold_before_a_thread_keeps_it_from_beginning(changes: list[tuple[str, float]]) -> None:
    """It was pressed in a dwell, or where the axes rested anyhow, and the thread was cut all the same."""
    program = prepared(
        PATH, Event(0, "dwell", 0.5, 2), Event(0, "override", TIED_FEED, 2), Event(1, "override", 0.0, 3)
    )
    begins = next(each.sample for each in program.program.happenings if each.kind == "dwell") * T + 0.1
    held = execute(program, [(begins, *changes[0])])
    assert "nobody is there" in held.reason and held.state[-1] == State.HELD
    assert held.position[-1].tolist() == PATH["end"][0, :3].tolist()
    ran = execute(program, [(begins, *changes[0]), (begins + 2.0, *changes[1])])
    assert ran.position[-1].tolist() == PATH["end"][-1, :3].tolist()
    assert execute(program, [(begins, *changes[0]), (begins + 2.0, "stop", 1)]).reason.startswith("stopped in line")


def test_discarded_samples_are_not_lost_time() -> None:
    """A machine does not wait: where the loop was late, the path goes on."""
    program = whole().program
    references = [LiveReference() for _ in range(4)]
    execution = Execution(program, T, RetimedProgram(program, T), references, 3, 1.0, lambda names: False)
    for k in (0, 1, 2, 50, 51, 300):
        row: list[float] = []
        execution.law(k, [0.0] * 4, row, [])
        assert row[1] == k
        assert [r.position.value for r in references[:3]] == program.position[k].tolist()


def test_blends_are_followed_too() -> None:
    corners = [(0, 0, 0), (5, 0, 0), (5, 5, 0), (0, 5, 0)]
    square = chain(*(line(a, b, 10.0, mode=BLEND, tolerance=0.1, program_line=1) for a, b in pairwise(corners)))
    ran = execute(prepared(square), [(0.2, "override", 1.7), (0.4, "hold", 1), (0.9, "hold", 0)])
    acceleration = np.abs(np.diff(ran.position, 2, axis=0)).max(axis=0) / T**2
    assert (acceleration[:2] <= whole().program.limits[1, :2] * 1.01).all()
    assert (ran.position[-1] == (0.0, 5.0, 0.0)).all()


def test_nothing_to_run_is_refused() -> None:
    with pytest.raises(InputError, match="nothing in it moves or waits"):
        planned([PathBlock(np.zeros(0, SEGMENT))], MACHINE, T, Path("empty.ngc"))


def test_the_certificate_of_the_planned_samples_goes_with_them() -> None:
    corner = chain(line((0, 0, 0), (5, 0, 0), 10.0, program_line=1), line((5, 0, 0), (5, 5, 0), 10.0, program_line=2))
    found = prepared(corner)
    assert found.certificate is not None and found.certificate.ok
    assert found.certificate.samples == found.program.samples
    assert found.certificate.worst["velocity", "Y"].line == 2
