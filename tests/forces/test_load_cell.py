"""The load cell in the cutting head of a machine: from the cut over the bus into the override that keeps the limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lost_machines import unless_lost

from rds.bus.analysis.messages import messages_of
from rds.bus.modules.rds import frames
from rds.bus.modules.rds.load_cell import LoadCell, fit_load_cell
from rds.bus.modules.rds.module import AxisModule
from rds.core.errors import InputError, MachineError
from rds.machines import load_machine
from rds.machines.forces.cut_file import cut_of
from rds.modes.loop.force_guard import ForceGuard

MILL = load_machine("mrm-mill")
CUT = {"depth": 2.0, "teeth": 2, "diameter": 6.0, "speed": 500.0}
FILE = "depth = 2.0\nteeth = 2\ndiameter = 6.0\nspeed = 3000.0\nhardness = 2.0\n[limits]\nforce = 250.0\n"


def modules() -> dict[str, AxisModule]:
    return {axis.name: AxisModule(axis, MILL.slots[axis.name], 0.001, 0.0) for axis in MILL.axes.values()}


def test_the_cell_measures_the_law_at_the_speeds_of_the_axes() -> None:
    own, cut = modules(), cut_of(CUT | {"hardness": 1.5, "top": 0.0})
    cell = LoadCell(MILL, own, "spindle", cut)
    own["X"].motion.velocity, own["Y"].motion.velocity, own["spindle"].motion.velocity = 3.0, -4.0, -600.0
    own["Z"].motion.position = own["Z"].motion._carriage = 5.0
    assert cell() == 0.0, "above the work"
    own["Z"].motion.position = own["Z"].motion._carriage = -1.0
    assert cell() == pytest.approx(1.5 * cut.force(np.array([5.0]), np.array([600.0]))[0])
    own["spindle"].motion.velocity = 0.0
    assert cell() == 0.0, "a spindle that stands cuts nothing"


def test_every_tenth_tick_is_followed_by_its_frame() -> None:
    (module,) = (module for name, module in modules().items() if name == "spindle")
    module.cell = lambda: 12.5
    told = []
    for module.ticks in range(1, 31):
        told += module.force()
    assert [frames.decode_force(data) for data in told] == [12.5] * 3
    with pytest.raises(MachineError, match="has 2 bytes"):
        frames.decode_force(b"12")
    with pytest.raises(MachineError, match="force of nan N"):
        frames.decode_force(frames.encode_force(float("nan"), 1))
    (force,) = (message for message in messages_of(MILL) if message.identifier == frames.FORCE)
    assert force.period == pytest.approx(0.01)


def test_a_machine_without_a_cell_or_its_axes_is_refused(tmp_path: Path) -> None:
    (tmp_path / "cut.toml").write_text(FILE)
    with pytest.raises(InputError, match="mini-cnc has 0 load cells"):
        fit_load_cell(load_machine("mini-cnc"), {}, str(tmp_path / "cut.toml"))
    some = {name: module for name, module in modules().items() if name != "Y"}
    with pytest.raises(InputError, match="Y is not among --axes"):
        fit_load_cell(MILL, some, str(tmp_path / "cut.toml"))


def test_what_a_machine_s_cell_measures_lowers_the_rate_only() -> None:
    told: list[float | None] = [None]
    guard = ForceGuard(np.full(5000, 100.0), np.full(5000, 0.5), 0.75)
    guarding = guard.start(0.001, lambda: told[0])
    assert guarding.allowed(0, 1.0) == guard.start(0.001).allowed(0, 1.0), "a cell that is silent is simulated"
    free = guarding.allowed(1, 1.0)
    told[0] = 400.0
    for place in range(1, 1000):
        harder = guarding.allowed(place, 1.0)
    assert harder < 0.5 < free and guarding.measured == 400.0 and guarding.factor == pytest.approx(4.0, rel=0.01)
    told[0] = 0.0
    for place in range(1000, 3000):
        guarding.allowed(place, 1.0)
    assert guarding.factor == pytest.approx(1.0), "air"


@pytest.mark.realtime
@pytest.mark.usefixtures("alone")
def test_a_run_on_a_machine_keeps_the_limit_by_the_cell(tmp_path: Path) -> None:
    """The work is twice as hard as the law says: the law alone would take the feed for good."""
    from rds.bus.modules.server_process import end_server, start_server
    from rds.nc.run.run import PartProgram

    (tmp_path / "cut.toml").write_text(FILE)
    (tmp_path / "part.ngc").write_text("G21 G90 G94\nS3000 M3\nG1 X8 F1000\nM5\nM2\n")
    (tmp_path / "bus.toml").write_text('machine = "mrm-mill"\nsample_period = 0.002\n[bus]\nchannel = "cell"\n')
    server = start_server("rds", "mrm-mill", "cell", {"cut": str(tmp_path / "cut.toml")})
    try:
        program = PartProgram(tmp_path / "part.ngc", experiment=tmp_path / "bus.toml", cut=tmp_path / "cut.toml")
        result = unless_lost(lambda: program.run("implementation", out=tmp_path / "run"))
    finally:
        end_server(server)
    force, rate = result["cutting_force"], result["program_override"]
    cutting = result["program_line"] == 3
    late = cutting & (result["X_measured"] > 3.0) & (result["X_measured"] < 7.0)
    assert 225.0 < np.median(force[late]) < 255.0
    assert np.median(rate[late]) == pytest.approx((314.2 * 2.0 / 250.0) ** (-1.0 / 0.75), rel=0.1)
