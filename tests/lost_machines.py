"""A real-time run whose machine was lost because the computer held a process up is void, and is made again."""

from __future__ import annotations

from collections.abc import Callable

import rds

TRIES = 3


def unless_lost(run: Callable[[], rds.Result]) -> rds.Result:
    """The result of `run()`, of `TRIES` at most, in which no module was silent for 0.1 s; else that of the last.

    Only for tests in which nothing is done to the machine: a loss is the computer's doing there. What else `run`
    raises comes out of here.
    """
    for _ in range(TRIES - 1):
        try:
            result = run()
        except rds.MachineError as error:
            if "no answer from" not in str(error):
                raise
        else:
            if "no answer from" not in (result.meta.get("ending_reason") or ""):
                return result
    return run()
