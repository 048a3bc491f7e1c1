"""What a mode states of itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from rds.core.clock import LatePolicy
from rds.core.contracts import Drivers
from rds.modes.loop.loop import Loop
from rds.modes.loop.plan import Plan


@dataclass(frozen=True)
class Mode:
    """A mode: which parts make its loop.

    `build(plan, drivers)` gives the loop, in virtual time and without a record; `runtime.stopwatch` puts it under a
    clock. `drivers` says whether the mode needs the machine's
    drivers: not at all, as a dry run (timed, without effect on the machine) or live. A mode with drivers runs in
    real time, in the target process. `followed` names the column of what its models give besides. `drives` says
    what may drive the axes, `validates` whether a run ends with a verdict on the models.
    """

    name: str
    build: Callable[[Plan, Drivers | None], Loop]
    drivers: Literal["none", "dry run", "live"]
    drives: tuple[Literal["controller", "signal"], ...]
    followed: str | None = None
    late: LatePolicy = field(default_factory=LatePolicy)
    validates: bool = False

    @property
    def real_time(self) -> bool:
        """Whether the mode runs against the clock."""
        return self.drivers != "none"
