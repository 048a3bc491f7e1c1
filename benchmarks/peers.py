"""Other simulators on the same axis, each in a process of its own.

    python -m benchmarks.peers NAME

simulates 10 s and prints JSON: version, seconds, measured positions. The axis's functions are our own: what differs
is what the simulator adds to them.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.axis import experiment, parts
from rds.modes.loop.plan import Plan


def run_control(plan: Plan) -> tuple[float, list[float]]:
    """python-control: the closed loop as one discrete nlsys."""
    import control

    measure, drive, move = parts(plan)

    def update(t: float, state: np.ndarray, reference: np.ndarray, params: Any) -> tuple[float, ...]:
        x, w, z, started = state.tolist()
        u, z, started = drive(z, started, measure(x), *reference.tolist())
        return (*move(x, w, u), z, started)

    system = control.nlsys(
        update, lambda t, state, u, params: measure(float(state[0])), inputs=3, outputs=1, states=4, dt=plan.T
    )
    return _respond(system, plan)


def run_interconnected(plan: Plan) -> tuple[float, list[float]]:
    """python-control: controller and axis, each a discrete nlsys, interconnected."""
    import control

    measure, drive, move = parts(plan)
    axis = control.nlsys(
        lambda t, state, u, params: move(*state.tolist(), float(u[0])),
        lambda t, state, u, params: measure(float(state[0])),
        inputs=["u"],
        outputs=["y"],
        states=2,
        dt=plan.T,
        name="axis",
    )
    controller = control.nlsys(
        lambda t, state, u, params: drive(*state.tolist(), *u.tolist())[1:],
        lambda t, state, u, params: drive(*state.tolist(), *u.tolist())[0],
        inputs=["y", "r", "dr", "ddr"],
        outputs=["u"],
        states=2,
        dt=plan.T,
        name="controller",
    )
    system = control.interconnect([controller, axis], inputs=["r", "dr", "ddr"], outputs=["y"])
    return _respond(system, plan)


def run_bdsim(plan: Plan) -> tuple[float, list[float]]:
    """bdsim: a function block around a hold that is clocked with the sample period."""
    import bdsim

    measure, drive, move = parts(plan)
    reference = _reference(plan).tolist()
    simulation = bdsim.BDSim(options={"graphics": False, "progress": False})
    diagram = simulation.blockdiagram()
    hold = diagram.ZOH(diagram.clock(plan.T, unit="s"), x0=np.zeros(5))

    def loop(state: np.ndarray) -> np.ndarray:
        k, x, w, z, started = state.tolist()
        u, z, started = drive(z, started, measure(x), *reference[min(int(k), plan.samples - 1)])
        return np.array((k + 1.0, *move(x, w, u), z, started))

    function = diagram.FUNCTION(loop)
    diagram.connect(function, hold)
    diagram.connect(hold, function)
    diagram.compile()
    started = time.perf_counter()
    out = simulation.run(diagram, T=plan.samples * plan.T, dt=plan.T)
    seconds = time.perf_counter() - started
    positions = [0.0, *out.clock0.X[:-1, 1].tolist()]  # bdsim logs what a tick made of the state
    return seconds, [measure(x) for x in positions]


PEERS = {
    "control, one nlsys": ("control", run_control),
    "control, two nlsys interconnected": ("control", run_interconnected),
    "bdsim, one block": ("bdsim", run_bdsim),
}


def call(name: str, python: str = sys.executable) -> dict[str, Any] | str:
    """A peer's answer from a fresh process of the interpreter `python`, or why there is none."""
    root = Path(__file__).parents[1]
    done = subprocess.run([python, "-m", "benchmarks.peers", name], cwd=root, capture_output=True, text=True)
    if done.returncode:
        return f"skipped: {(done.stderr.strip().splitlines() or ['ended without a word'])[-1]}"
    answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return answer


def _respond(system: Any, plan: Plan) -> tuple[float, list[float]]:
    import control

    times, reference = np.arange(plan.samples) * plan.T, _reference(plan)
    started = time.perf_counter()
    response = control.input_output_response(system, times, reference.T, np.zeros(4))
    return time.perf_counter() - started, response.outputs.reshape(-1).tolist()


def _reference(plan: Plan) -> np.ndarray:
    reference = plan.axes[0].reference
    assert reference is not None
    return np.array((reference.position, reference.velocity, reference.acceleration)).T


if __name__ == "__main__":
    name = sys.argv[1]
    package, simulate = PEERS[name]
    seconds, measured = simulate(experiment().plan())
    print()
    print(json.dumps({"version": f"{package} {version(package)}", "seconds": seconds, "measured": measured}))
