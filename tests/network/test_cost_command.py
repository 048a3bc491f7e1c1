"""What a network costs the loop of an experiment: the law read from its function, and the command."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import rds
from rds.cli.main import app
from rds.controllers import library_controller
from rds.controllers.design import tracking_controller_system
from rds.core.linear_law import linear_law
from rds.network.delays import Delay
from rds.network.loops.experiment_cost import network_cost
from rds.network.trace import write_trace

MODEL, T = {"tau": 0.01, "K": 2.0}, 0.002


def experiment(**options: Any) -> rds.Experiment:
    settings: dict[str, Any] = {
        "axis": "X",
        "duration": 0.1,
        "sample_period": T,
        "reference": {"kind": "constant", "value": 0.0},
        "controller": "tracking",
    }
    return rds.Experiment(**(settings | options))


def test_the_law_of_a_function_is_that_of_its_design() -> None:
    law = linear_law(library_controller("tracking", MODEL, T, np.inf))
    system = tracking_controller_system(MODEL["tau"], MODEL["K"], [-32 + 24j, -32 - 24j], -320.0, T)
    for z in np.exp(1j * np.array([0.01, 0.3, 1.0, 3.0])):
        mine = law.H @ np.linalg.solve(z * np.eye(len(law.F)) - law.F, law.G) + law.D
        assert mine.item() == pytest.approx(complex(system(z)[0, 3]), rel=1e-6)


@pytest.mark.parametrize(
    ("controller", "said"),
    [
        ({"name": "pid", "deadband": 0.01}, "does not answer small deviations about rest"),
        ({"name": "pid", "maxerror": 1e-4}, "does not answer in proportion about rest"),
        (rds.Controller(lambda t, r, y, state, params: (0.0, state), {"a": 1.0}), "holds a dict; the analysis needs"),
    ],
)
def test_what_has_no_linear_part_is_refused(controller: Any, said: str) -> None:
    with pytest.raises(rds.InputError, match=said):
        network_cost(experiment(controller=controller), Delay())


def test_mean_jitter_and_losses_add_up_to_the_whole() -> None:
    found = network_cost(experiment(), Delay.named("exponential", mean=0.002), loss=0.1, bins=12)
    assert sum(found.parts.values()) == pytest.approx(found.lossy.cost - found.none.cost)
    assert found.parts["mean_delay"] > 0.0 and found.parts["loss"] > 0.0
    assert found.mean_delay == pytest.approx(0.002, rel=0.05)


def test_the_command_takes_a_measured_trace(tmp_path: Path) -> None:
    file, trace = tmp_path / "loop.toml", tmp_path / "bus.csv"
    file.write_text(
        'axis = "X"\nduration = 1.0\n[reference]\nkind = "constant"\nvalue = 0.0\n[controller]\nname = "pid"\n'
    )
    rng = np.random.default_rng(0)
    write_trace(trace, {"sensor": rng.uniform(0, 5e-4, 500), "actuator": rng.uniform(0, 4e-4, 500)})
    ran = CliRunner().invoke(app, ["network", "cost", str(file), "--delays", str(trace), "--json"])
    assert ran.exit_code == 0, ran.output
    told = json.loads(ran.stdout)
    assert told["mean_delay_s"] == pytest.approx(0.00045, rel=0.05)
    assert told["costs"]["mean_delay"] > abs(told["costs"]["jitter"])
    assert told["loops"]["with_losses"]["cost"] == told["loops"]["distribution"]["cost"]  # none was lost
    again = CliRunner().invoke(app, ["network", "cost", str(file), "--delay", "constant:delay=0.03"])
    assert again.exit_code == 1
    assert "not stable" in again.stdout


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "give one of --delays TRACE.csv and --delay"),
        (["--delay", "uniform:high"], "must be KIND:NAME=VALUE"),
        (["--delay", "gauss:mean=1"], "delay 'gauss' is unknown"),
        (["--delay", "uniform:high=0.01", "--bins", "0"], "bins = 0 must be"),
        (["--delay", "constant:delay=0.5"], "500 samples make"),
        (["--delay", "uniform:high=0.01", "--axis", "Q"], "axis 'Q' does not run"),
    ],
)
def test_wrong_words_are_refused(words: list[str], said: str, tmp_path: Path) -> None:
    file = tmp_path / "loop.toml"
    file.write_text(
        'axis = "X"\nduration = 1.0\n[reference]\nkind = "constant"\nvalue = 0.0\n[controller]\nname = "pid"\n'
    )
    ran = CliRunner().invoke(app, ["network", "cost", str(file), *words])
    assert ran.exit_code == 2
    assert said in ran.stderr
