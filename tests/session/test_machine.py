"""Modules in a session: started, scanned, configured to a machine, tuned, stepped; the monitor's filter."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.bus.modules.oacs.module_data import read_modules
from rds.core.errors import InputError, MachineError
from rds.machines import load_machine
from rds.machines.assembly import first_order, judged
from rds.panels.machine.configuration import directions, moved, write_machine
from rds.panels.machine.monitor import BusMonitor, parse_filter
from rds.panels.machine.state import MachineState
from rds.panels.session import Session
from rds.panels.session.task import Stopped, Task

PATIENCE = 60.0  # s, on a busy computer


def described() -> dict[int, dict[str, Any]]:
    """What the modules of the thesis say of themselves, without a bus."""
    from dataclasses import asdict

    found = {}
    for data in read_modules(load_machine("mrmt-oacs")).values():
        told = data.describe(1)
        more = {"number": data.node, "kind": told.kind.name.lower(), "unit": told.unit}
        found[data.node] = asdict(told) | more
    return found


def done(task: Task[Any]) -> Any:
    assert task.wait(PATIENCE)
    if task.error is not None:
        raise task.error
    return task.result


@pytest.fixture
def state(alone: Path) -> Iterator[MachineState]:
    made = MachineState(Session(alone, "mrmt-oacs"))
    made.choices.set("dialect", "oacs")
    yield made
    made.end()


def test_units_on_a_serial_line_are_started_and_found(alone: Path) -> None:
    made = MachineState(Session(alone, "mini-cnc"))
    assert made.bus[0] == "rds"
    made.choices.set("machine", "starmill")
    assert made.choices["dialect"] == "dcs" and made.bus == ("serial", "starmill")
    with pytest.raises(MachineError, match="no module answers on serial:starmill; start the simulated modules"):
        done(made.scan())
    done(made.start())
    try:
        assert [row["id"] for row in done(made.scan())] == [2, 3, 4, 5]
    finally:
        made.end()
    made.choices.set("machine", "mini-cnc")
    assert made.choices["dialect"] == "rds" and made.bus == ("rds", "mini-cnc")


# configuration


def test_the_thesis_s_machine_is_viable_from_its_tool_on_and_can_be_read_again(tmp_path: Path) -> None:
    data = described()
    order = [5, "oacs-range-arm", 2, 4, 3]
    assert first_order(data) == order, "Z says which accessory it carries"
    assert judged(order, data).ok
    shifts = {name: direction.round(9).tolist() for name, (_, direction) in directions(order, data).items()}
    assert shifts == {"Z": [0, 0, 1], "A": [0, 0, 1], "X": [1, 0, 0]}
    machine = load_machine(str(write_machine(tmp_path, "mine.toml", order, data)))
    own = load_machine("mrmt-oacs")
    assert {axis.node: axis.travel for axis in machine.axes.values()} == {a.node: a.travel for a in own.axes.values()}
    assert machine.axis("X").resolution == pytest.approx(1 / 169)
    q = own.kinematics.random(10)
    by_name = [machine.kinematics.joints.index(name) for name in own.kinematics.joints]
    again = np.empty_like(q)
    again[:, by_name] = q
    np.testing.assert_allclose(machine.kinematics.forward(again), own.kinematics.forward(q), atol=1e-9)
    with pytest.raises(InputError, match="there is such a file already"):
        write_machine(tmp_path, "mine.toml", order, data)
    with pytest.raises(InputError, match="plain name"):
        write_machine(tmp_path, "../mine.toml", order, data)


def test_what_makes_no_machine_is_said(tmp_path: Path) -> None:
    data = described()

    def faults(order: list[int | str], data: dict[int, dict[str, Any]]) -> list[str]:
        return [fault.text for fault in judged(order, data).faults]

    assert "must be the first" in faults([2, 5, 3, 4], data)[0]
    assert "one tool; there are 0" in faults([2, 3, 4], data)[0]
    assert "one axis at least" in faults([5], data)[0]
    assert "scan" in faults([], data)[0]
    assert "module 9 is not on the bus" in faults([5, 9], data)[0]
    twice = data | {6: data[4] | {"number": 6}}
    assert [fault.split(";")[0] for fault in faults([5, 2, 3, 4, 6], twice)] == ["2 modules are called X"]
    unknown = {number: each | {"type_text": f"Own{number}"} for number, each in data.items()}
    assert judged([5, "oacs-range-arm", 2, 4, 3], unknown).ok, "what the library does not know it does not refuse"
    other = unknown[2] | {"carries_on": {"kind": "bolted", "size": 120.0, "gender": "male"}}
    assert (
        "does not fit on 'Z' (male bolted 120 mm (carries_on))"
        in (faults([5, "oacs-range-arm", 2, 4, 3], data | {2: other})[0])
    )
    assert "'A' (oacs-a: male work table 200 mm (table)) does not fit on 'X'" in faults([5, 2, 3, 4], data)[0]
    assert "does not fit on 'X'" in faults([5, 2, "oacs-range-arm", 4, 3], data)[0]
    with pytest.raises(InputError, match="must be the first"):
        write_machine(tmp_path, "mine.toml", [2, 5, 3, 4], data)
    assert not (tmp_path / "mine.toml").exists()


@given(order=st.permutations([2, 3, 4, 5]), place=st.integers(0, 3), by=st.integers(-5, 5))
def test_a_module_that_is_moved_leaves_the_order_of_the_others(order: list[int], place: int, by: int) -> None:
    number = order[place]
    after = moved(order, number, by)
    assert [each for each in after if each != number] == [each for each in order if each != number]
    assert after.index(number) == min(max(place + by, 0), 3)


# the monitor's filter


@pytest.mark.parametrize(
    "text, keeps", [("", 4), ("0x020", 1), ("0x020-0x022", 2), ("reply", 1), ("0x7F, reply", 2), ("32", 1)]
)
def test_filters(text: str, keeps: int) -> None:
    keep = parse_filter(text)
    frames = [(0x020, ""), (0x021, ""), (0x000, "Reply"), (0x07F, "")]
    assert sum(keep(*each) for each in frames) == keeps


@pytest.mark.parametrize("text", ["0x", "1-", "0x30-0x20", "12-x"])
def test_filters_that_cannot_be(text: str) -> None:
    with pytest.raises(InputError, match="filter"):
        parse_filter(text)


# modules on a bus


@pytest.mark.realtime
def test_modules_are_scanned_tuned_and_stepped(state: MachineState) -> None:
    with pytest.raises(MachineError, match="no module answers on rds:mrmt-oacs; start the simulated modules"):
        done(state.scan())
    done(state.start())
    with pytest.raises(InputError, match="already"):
        state.start()
    rows = done(state.scan())
    assert [row["id"] for row in rows] == [2, 3, 4, 5] == sorted(state.data)
    state.load_tuning(4)
    state.tuning.set("controller", "P")
    state.tuning.set("Kp", 2.5)
    in_force = done(state.tune(4))
    assert (in_force["controller"], in_force["Kp"], in_force["Ki"]) == ("PI", 2.5, 0.0)
    saved = state.save_tuning(4, "four.toml")
    state.tuning.set("Kp", 9.0)
    state.read_tuning(saved.name)
    assert state.tuning["Kp"] == 2.5
    with pytest.raises(InputError, match="Step first"):
        state.suggest(4)
    with pytest.raises(InputError, match="is a tool"):
        state.step(5)
    result = done(state.step(4))
    with pytest.raises(InputError, match="no response of module 3 yet"):
        state.suggest(3)
    assert 3.0 < result["X_measured"][-1] - result["X_measured"][0] < 8.0
    stopped = state.step(4)
    assert "4 modules are at zero volts" in state.session.emergency_stop()
    assert stopped.wait(PATIENCE)
    assert isinstance(stopped.error, Stopped | MachineError)  # whichever comes first
    state.session.release_emergency_stop()


@pytest.mark.realtime
def test_a_monitor_listens_until_it_is_ended(state: MachineState) -> None:
    done(state.start())
    monitor = BusMonitor()
    task = state.session.work("bus monitor", monitor.watch(*state.bus), monitor.end)
    done(state.scan())
    while not monitor.lines("reply")[0]:
        assert not task.wait(0.1)
    assert "kbit/s" in monitor.headline
    task.stop()
    assert done(task).snapshot.frames > 10


def test_the_dialect_is_the_one_that_the_bus_of_the_session_says(tmp_path: Path) -> None:
    """Modules that were started, and the load that was analysed, spoke another one than the runs of the page did."""
    assert MachineState(Session(tmp_path)).choices["dialect"] == "rds"  # which is kept
    state = MachineState(Session(tmp_path, bus={"dialect": "cia402"}))
    assert state.choices["dialect"] == "cia402"
    state.choices.set("machine", "mrmt-oacs")
    assert state.choices["dialect"] == "cia402"
    assert MachineState(Session(tmp_path / "new", "mrmt-oacs")).choices["dialect"] == "oacs"


def test_a_machine_of_modules_that_describe_themselves_speaks_their_dialect(tmp_path: Path) -> None:
    state = MachineState(Session(tmp_path))
    before = state.choices["dialect"]
    state.choices.set("machine", "mrmt-oacs")
    assert state.choices["dialect"] == "oacs"
    state.choices.set("machine", "mini-cnc")
    assert state.choices["dialect"] == before
