"""The same run once more: with the references and the changes of live values that were recorded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rds.modes.loop.laws import ReferenceSamples
from rds.modes.loop.plan import Plan
from rds.modes.process.host import Rows


def as_recorded(plan: Plan, rows: Rows) -> Plan:
    """The plan of a run as it turned out: what somebody changed while it ran is changed at the same samples.

    A program becomes the references that it gave, and lasts for as long as it did; between samples that were discarded
    they run straight.
    """
    if plan.program is None:
        return plan.with_changes(rows.changes)
    of = dict(zip(rows.columns, rows.values.T, strict=True))
    sample = of["sample"]
    every = np.arange(int(sample[-1]) + 1)
    axes = []
    for axis in plan.axes:
        names = (f"{axis.axis.name}_reference{part}" for part in ("", "_velocity", "_acceleration"))
        axes.append(replace(axis, reference=ReferenceSamples(*(np.interp(every, sample, of[name]) for name in names))))
    same = replace(plan, program=None, axes=tuple(axes), samples=len(every), changes=())
    known = {channel.name for channel in same.channels()} - {"stop"}  # which ends a program later, on its path
    return same.with_changes(change for change in rows.changes if change.name in known)
