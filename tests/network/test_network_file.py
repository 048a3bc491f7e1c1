"""The [network] table: every wrong word is refused with its place, and the distributions are what they say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import floats, sampled_from

import rds
from rds.network.delays import Delay
from rds.network.distributions import DISTRIBUTIONS
from rds.network.trace import read_trace, write_trace

GOOD = """\
axis = "X"
duration = 0.01
[reference]
kind = "constant"
value = 0.0
[controller]
name = "p"
"""


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("[network]\nseeed = 1", r"line 9: unknown key 'seeed' in \[network\].*did you mean 'seed'"),
        ("[network.sensor]\nloss = 1.5", "network.sensor.loss = 1.5 must be from 0 to 0.99"),
        ("[network.sensor]\nkind = 'unifrom'\nhigh = 1", "kind = 'unifrom' is unknown.*did you mean 'uniform'"),
        ("[network.sensor]\nkind = 'uniform'", "high is missing; give it in s"),
        ("[network.sensor]\nkind = 'uniform'\nlow = 0.2\nhigh = 0.1", "high = 0.1 s must be at least low = 0.2 s"),
        ("[network.sensor]\nkind = 'uniform'\nhigh = 0.1\nmean = 1", "unknown key 'mean'"),
        ("[network.sensor]\nhigh = 0.1", "unknown key 'high'"),
        ("[network.sensor]\nloss = 0.1\norder = 'any'", "order = 'any' is unknown; known: drop, take, keep"),
        ("[network.sensor]\nloss = 0.9\nloss_burst = 2", "loss = 0.9 cannot be so large with bursts of 2"),
        ("[network.sensor]\nloss_burst = 2", "there is no loss"),
        ("[network.computing]\nkind = 'constant'\ndelay = 0\nloss = 0.1", "unknown key 'loss'"),
        ("[network.computing]\ndelay = 0.1", "kind is missing"),
        ("[network.actuator]\nkind = 'exponential'\nmean = 0.001\nlow = 0.002", "mean = 0.001 s must be more than low"),
        ("[network.actuator]\nkind = 'trace'\nfile = 'none.csv'", "none.csv: cannot be read"),
        ("[network.actuator]\nkind = 'trace'\nfile = 'sensor.csv'", "has no column 'actuator'; it has sensor"),
        ("[network.sensor]\nkind = 'trace'\nfile = 'bad.csv'", r"bad.csv:3: sensor = 'x' must be a delay in s"),
        ("[network.sensor]\nkind = 'trace'\nfile = 'lost.csv'", "has only lost messages"),
        ("[network]\nactuator_buffer = -1", "actuator_buffer = -1 must be a whole number from 0 to 1000 samples"),
        ("[network]\nevent = 1", "event = 1 must be true or false"),
        (
            "[network.axis.X.sensor]\nkind = 'constant'\ndelay = 0.01",
            "cannot be had: all axes of a run have one network",
        ),
    ],
)
def test_what_will_not_do_is_refused_with_its_place(table: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "sensor.csv").write_text("sensor\n0.001\n")
    (tmp_path / "bad.csv").write_text("sensor\n0.001\nx\n")
    (tmp_path / "lost.csv").write_text("sensor\n\n\n")
    file = tmp_path / "experiment.toml"
    file.write_text(f"{GOOD}{table}\n")
    with pytest.raises(rds.InputError, match=said):
        rds.Experiment.from_toml(file)


def test_a_trace_is_written_and_read(tmp_path: Path) -> None:
    columns = {"sensor": np.array([0.001, np.nan, 0.0023456789]), "computing": np.array([1e-5, 2e-5, 3e-5])}
    write_trace(tmp_path / "a.csv", columns, ("made by hand",))
    read = read_trace(tmp_path / "a.csv")
    assert list(read) == list(columns)
    assert all(np.array_equal(read[name], columns[name], equal_nan=True) for name in columns)


def test_a_trace_drives_the_run_in_its_order(tmp_path: Path) -> None:
    trace = np.array([0.0, 0.0004, np.nan, 0.0002])
    write_trace(tmp_path / "a.csv", {"actuator": trace})
    (tmp_path / "e.toml").write_text(f'{GOOD}[network.actuator]\nkind = "trace"\nfile = "a.csv"\n')
    result = rds.Experiment.from_toml(tmp_path / "e.toml").run()
    told = result["X_delay_ca"]
    assert told[:8] == pytest.approx([0.0, 0.0004, -1.0, 0.0002] * 2)


@given(mean=floats(1e-4, 0.01), share=floats(0.05, 0.9), kind=sampled_from(["exponential", "gamma", "normal"]))
def test_distributions_keep_their_mean_and_their_least_delay(mean: float, share: float, kind: str) -> None:
    deviation = {} if kind == "exponential" else {"deviation": 0.1 * mean}
    low = 0.0 if kind == "normal" else share * mean
    delay = Delay.named(kind, mean=mean, low=low, **deviation)
    values, probabilities = delay.histogram(2000)
    assert probabilities.sum() == pytest.approx(1.0)
    assert values @ probabilities == pytest.approx(mean, rel=0.01)
    assert values.min() >= low
    if deviation:
        assert np.sqrt((values - mean) ** 2 @ probabilities) == pytest.approx(0.1 * mean, rel=0.05)


@pytest.mark.parametrize("kind", DISTRIBUTIONS)
def test_what_is_drawn_has_the_histogram_of_the_analysis(kind: str) -> None:
    given = {"delay": 0.001, "low": 0.0002, "high": 0.002, "mean": 0.001, "deviation": 0.0002}
    delay = Delay.named(kind, **{name: given[name] for name in DISTRIBUTIONS[kind].parameters})
    drawn = delay.drawn(np.random.default_rng(0), 0, 40_000)
    values, probabilities = delay.histogram(400)
    assert drawn.mean() == pytest.approx(values @ probabilities, rel=0.02)
