"""What answers on a channel is asked before a run: another dialect than the run's is refused, with its name."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from importlib import import_module
from typing import Any
from uuid import uuid4

import pytest

from rds import Experiment
from rds.bus.modules.dialects import SERIAL_DIALECTS, dialect_names, is_served, server_module
from rds.core.errors import InputError
from rds.machines import Machine, load_machine

MACHINES = {"rds": "mini-cnc", "oacs": "mrmt-oacs", "cia402": "mini-cnc", "dcs": "starmill"}
CAN = [name for name in dialect_names() if name not in SERIAL_DIALECTS]


@pytest.fixture
def served() -> Iterator[Callable[[str], tuple[Machine, str]]]:
    """Serves a machine's modules in a dialect on a channel of python-can's virtual bus, until the test ends."""
    with ExitStack() as stack:

        def start(dialect: str) -> tuple[Machine, str]:
            machine, channel = load_machine(MACHINES[dialect]), uuid4().hex
            interface = "serial" if dialect in SERIAL_DIALECTS else "virtual"
            stop, ready = threading.Event(), threading.Event()
            serve = import_module(server_module(dialect)).serve
            thread = threading.Thread(target=lambda: serve(machine, interface, channel, ready=ready.set, stop=stop))
            thread.start()
            stack.callback(thread.join, 30.0)
            stack.callback(stop.set)
            assert ready.wait(30.0)
            return machine, channel

        yield start


@pytest.mark.parametrize("there", CAN)
def test_only_the_dialect_that_is_there_is_served(there: str, served: Callable[[str], tuple[Machine, str]]) -> None:
    machine, channel = served(there)
    assert is_served(there, machine, "virtual", channel)
    for other in set(CAN) - {there}:
        with pytest.raises(InputError) as told:
            is_served(other, machine, "virtual", channel)
        assert f'speaks {there}, not {other}: set [bus] dialect = "{there}"' in str(told.value)


def test_a_serial_line_is_asked_in_its_own_dialect(served: Callable[[str], tuple[Machine, str]]) -> None:
    machine, channel = served("dcs")
    assert is_served("dcs", machine, "serial", channel)
    assert not is_served("dcs", machine, "virtual", channel)


@pytest.mark.parametrize("dialect", dialect_names())
def test_an_empty_channel_serves_nothing(dialect: str) -> None:
    interface = "serial" if dialect in SERIAL_DIALECTS else "virtual"
    assert not is_served(dialect, load_machine("mini-cnc"), interface, uuid4().hex)


def test_a_machine_of_units_is_on_its_serial_line_where_nothing_says_so() -> None:
    """Runs of the page and of `rds run` looked for it on the built-in bus, where its motors cannot be."""
    still = {"kind": "constant", "value": 0.0}
    words: dict[str, Any] = {"axis": "X", "duration": 1.0, "controller": "pid", "reference": still}

    def bus(machine: str, **more: Any) -> dict[str, Any]:
        return dict(Experiment(machine=machine, mode="implementation", **words, **more).plan().bus)

    assert bus("starmill") == {"interface": "serial", "dialect": "dcs"}
    assert bus("starmill", bus={"baud": 230_400}) == {"interface": "serial", "dialect": "dcs", "baud": 230_400}
    assert bus("mini-cnc") == {} and bus("mini-cnc", bus={"bitrate": 500_000}) == {"bitrate": 500_000}
    with pytest.raises(InputError, match="bitrate = 500000 is no option of a serial line"):
        bus("starmill", bus={"bitrate": 500_000})
