"""The load cell in the cutting head of a served machine: what the cut of a tool in motion makes it measure."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from rds.core.errors import InputError
from rds.machines.machine import Machine

if TYPE_CHECKING:
    from rds.bus.modules.rds.module import AxisModule
    from rds.machines.forces.cut_file import CutFile


class LoadCell:
    """The force (N) of a cut, times its `hardness`, at the speeds that the axes of `modules` have now.

    The tool cuts while the spindle turns and its tip is below the cut's `top`, wherever the axes go.
    """

    def __init__(self, machine: Machine, modules: Mapping[str, AxisModule], head: str, cut: CutFile):
        import numpy as np

        self._kinematics, self._cut = machine.kinematics, cut
        self._motions = [modules[name].motion for name in self._kinematics.joints]
        self._scale = np.where(self._kinematics.turns, np.pi / 180.0, 1.0)
        self._spindle = modules[head].motion

    def __call__(self) -> float:
        import numpy as np

        speed = abs(self._spindle.velocity)
        q = np.array([[motion.output() for motion in self._motions]])
        top = self._cut.top
        if speed < _STANDS or (top is not None and self._kinematics.forward(q)[0, 2, 3] >= top):
            return 0.0
        rates = np.array([motion.velocity for motion in self._motions]) * self._scale
        feed = float(np.linalg.norm(self._kinematics.jacobian(q)[0, :3] @ rates))
        return float(self._cut.hardness * self._cut.force(np.array([feed]), np.array([speed]))[0])


_STANDS = 1.0  # rev/min


def fit_load_cell(machine: Machine, modules: Mapping[str, AxisModule], cut: str) -> None:
    """Give the module of the cutting head a load cell that measures the cut of a file. InputError where it has none."""
    from rds.machines.forces.cut_file import read_cut

    heads = [axis.name for axis in machine.axes.values() if axis.is_spindle and axis.module.get("load_cell")]
    if len(heads) != 1:
        raise InputError(
            f"{machine.name} has {len(heads)} load cells; --cut needs one: load_cell = true in the [axis.NAME.module] "
            "of its spindle",
            machine.path,
        )
    if missing := [name for name in (*machine.kinematics.joints, heads[0]) if name not in modules]:
        raise InputError(f"--cut needs all axes in this process, and {missing[0]} is not among --axes")
    modules[heads[0]].cell = LoadCell(machine, modules, heads[0], read_cut(Path(cut)))
