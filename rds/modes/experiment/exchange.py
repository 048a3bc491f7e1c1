"""A run that goes on after modules were exchanged, without a restart of the program that runs it.

A module that is unplugged ends the run ("machine lost"), and the watchdogs of all modules cut their voltage. What is
on the bus then is offered as a machine; once that is accepted and written to its file, the same experiment is begun
anew on it. Nothing of the run before is continued: its record is kept, and the new run begins at its own first sample.
"""

from __future__ import annotations

import contextlib
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rds.core.errors import InputError, MachineError
from rds.core.types import Ending
from rds.modes import load_mode
from rds.modes.experiment.experiment import Experiment
from rds.modes.experiment.run import Run
from rds.modes.loop.plan import Plan
from rds.modes.process.machine import BUILTIN
from rds.results import Result

if TYPE_CHECKING:
    from rds.bus.modules.oacs.events import ModuleEvent
    from rds.bus.modules.oacs.offers import Offer, Offers
    from rds.machines import Machine

SETTLES = 3.0  # s after the end of a run in which a change of the modules shows, if there is one
_INTERVAL = 0.1  # s between two looks
_LOOK = 0.005  # s


@dataclass(frozen=True)
class ExchangeCalls:
    """What somebody does and hears: `accept(offer)` says yes or no to a machine that the run can go on with.

    `refuse(offer, why)` hears of one that it cannot, `tell` of everything that happens, each with its time.
    """

    accept: Callable[[Offer], bool]
    refuse: Callable[[Offer, str], None] = lambda offer, why: None
    tell: Callable[[ModuleEvent], None] = lambda happened: None


def run_through_exchanges(
    experiment: Experiment,
    file: str | Path,
    hands: ExchangeCalls,
    mode: str | None = None,
    out: str | Path | None = None,
    go: Callable[[Any, Any], Result] = lambda experiment, run: run.wait(),
    changes: Iterable[Any] = (),
) -> list[Result]:
    """Run, and after each exchange of modules that is accepted run again on the new machine; the result of each run.

    The machine is written to `file`, the results to `out`, `out`-2, ...; `go(experiment, run)` waits for the result of
    a run that has begun; `changes` of live values are made in each. The last run is the one that nobody disturbed, or
    after which no machine was accepted.

    InputError for a mode without a machine, modules that do not say what they are (only those of the dialect oacs do),
    or a file that is there already; MachineError where a module of the experiment does not answer at the beginning.
    """
    from rds.bus.modules.oacs.offers import Offers

    file, plan = Path(file), experiment.plan(mode)
    _check(plan, file)
    with _bus(plan) as bus:
        offers = Offers(bus, plan.machine)
        for happened in offers.look()[0]:
            hands.tell(happened)
        there = offers.numbers
    if missing := [name for name in plan.names if plan.machine.axes[name].node not in there]:
        raise MachineError(
            f"no answer from {', '.join(missing)} on bus {_name(plan)}; an exchange needs modules that stay when the "
            "run ends: serve them (rds machine serve --dialect oacs), or switch yours on"
        )
    channel = _channel(plan)
    results: list[Result] = []
    while True:
        number = len(results) + 1
        folder = None if out is None else Path(out) if number == 1 else Path(f"{out}-{number}")
        run = experiment.start(mode, out=folder, changes=changes)
        if results:
            threading.Thread(target=_tell_motion, args=(run, offers, hands), daemon=True).start()
        results.append(go(experiment, run))
        if results[-1].meta.get("ending") != Ending.MACHINE_LOST:
            return results
        with _bus(plan) as bus:
            offers.go_on(bus)
            accepted = _accepted(offers, experiment, file, channel, mode, hands)
        if accepted is None:
            return results
        experiment = accepted


def _accepted(
    offers: Offers, experiment: Experiment, file: Path, channel: str | None, mode: str | None, hands: ExchangeCalls
) -> Experiment | None:
    """The experiment on the machine that was accepted; None where the modules have not changed, or nobody wants it."""
    ends: float | None = time.monotonic() + SETTLES
    while ends is None or time.monotonic() < ends:
        happened, offer = offers.look()
        for each in happened:
            hands.tell(each)
        ends = None if _changed(happened) else ends
        if offer is None:
            time.sleep(_INTERVAL)
            continue
        if (why := _obstacle(offers, offer, experiment, file.name, channel, mode)) is not None:
            hands.refuse(offer, why)
            continue
        if not hands.accept(offer):
            return None
        meanwhile, _ = offers.look()
        for each in meanwhile:
            hands.tell(each)
        if _changed(meanwhile):
            hands.refuse(offer, "the modules have changed meanwhile")
            continue
        machine, ready = offers.accept(offer, file)
        hands.tell(ready)
        return experiment.with_machine(machine.path, channel)
    return None


def _changed(happened: list[ModuleEvent]) -> bool:
    return any(each.event in ("added", "removed") for each in happened)


def _obstacle(
    offers: Offers, offer: Offer, experiment: Experiment, name: str, channel: str | None, mode: str | None
) -> str | None:
    """Why the experiment cannot go on with what is offered; None where it can."""
    if not offer.verdict.ok:
        return str(offer.verdict)
    with tempfile.TemporaryDirectory() as folder:
        try:
            machine: Machine = offers.write(offer, Path(folder) / name)
            experiment.with_machine(machine.path, channel).plan(mode)
        except InputError as error:
            return f"it is a machine, but this run cannot go on with it: {str(error).replace(f'{folder}/', '')}"
    return None


def _tell_motion(run: Run, offers: Offers, hands: ExchangeCalls) -> None:
    """Tell of the first sample of a run, at which the axes are driven again."""
    while not run.done:
        if run.progress[0]:
            hands.tell(offers.now("moving", ", ".join(run.plan.names)))
            return
        time.sleep(_LOOK)


def _check(plan: Plan, file: Path) -> None:
    mode, dialect = load_mode(plan.mode), plan.bus.get("dialect", "rds")
    if mode.drivers != "live":
        raise InputError(f"modules are exchanged on a machine, and in mode {plan.mode} there is none")
    if dialect != "oacs":
        raise InputError(
            f"modules of dialect {dialect} do not say what they are, and no machine can be offered; "
            'those of [bus] dialect = "oacs" do'
        )
    if not file.name.endswith(".toml"):
        raise InputError(f"the machine's file {str(file)!r} must end with .toml")
    if file.exists():
        raise InputError("there is such a file already; choose another name for the new machine", str(file))


def _channel(plan: Plan) -> Any:
    from rds.bus.tools.link import default_channel

    return default_channel(plan.machine, plan.bus.get("interface", BUILTIN), plan.bus.get("channel"))


def _name(plan: Plan) -> str:
    from rds.bus.tools.link import bus_name

    return bus_name(plan.bus.get("interface", BUILTIN), _channel(plan))


@contextlib.contextmanager
def _bus(plan: Plan) -> Iterator[Any]:
    from rds.bus.tools.link import bus_options, open_bus

    bus = open_bus(plan.bus.get("interface", BUILTIN), _channel(plan), **bus_options(plan.bus))
    try:
        yield bus
    finally:
        bus.shutdown()
