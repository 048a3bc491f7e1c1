"""What a mode states of itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from rds.core.clock import LatePolicy
from rds.core.contracts import Drivers
from rds.modes.loop.loop import Loop
from rds.modes.loop.plan import Plan

Drive = Literal["controller", "signal"]


@dataclass(frozen=True)
class Mode:
    """A mode: which parts make its loop, and what panels, plots and logs must know of it.

    `build(plan, drivers)` gives the loop, in virtual time and without a record; `loop.stopwatch` puts it under a
    clock. `drivers` says whether the mode needs the machine's
    drivers: not at all, as a dry run (timed, without effect on the machine) or live. A mode with drivers runs in
    real time, in the target process. `followed` names the column of what its models give besides. `drives` says
    what may drive the axes, `modelled` whether models run in it, `validates` whether a run ends with a verdict on them.

    `simulates_plant` says that the axes that are driven are models, so that their true velocity is known.

    `label` names it for people, `about` says in a few words what runs. `line` is how a plot draws its response among
    those of other modes, `layer` in which order: a higher one is drawn over a lower one.
    """

    name: str
    label: str
    about: str
    build: Callable[[Plan, Drivers | None], Loop]
    drivers: Literal["none", "dry run", "live"]
    drives: tuple[Drive, ...]
    followed: str | None = None
    late: LatePolicy = field(default_factory=LatePolicy)
    modelled: bool = True
    validates: bool = False
    simulates_plant: bool = False
    line: Mapping[str, Any] | None = None
    layer: int = 0

    @property
    def real_time(self) -> bool:
        """Whether the mode runs against the clock."""
        return self.drivers != "none"

    @property
    def moves_machine(self) -> bool:
        """Whether a machine moves in it."""
        return self.drivers == "live"

    @property
    def open_loop(self) -> bool:
        """Whether voltages alone drive the axes: no controller sees their position."""
        return "controller" not in self.drives
