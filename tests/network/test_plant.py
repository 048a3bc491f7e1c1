"""`rds network sweep`: shares by hand, simulation beside paper, and what breaks first."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.network.loops.plant import Plant, most_nodes, on_paper, shares, simulated, sweep


def test_the_shares_by_hand() -> None:
    """40 nodes at 1 Mbit/s: 50 frames of 135 bits in 10 ms, and each second a call of 65 bits with 40 of 160."""
    bandwidth, clocks, host = on_paper(Plant(40, 40, 1_000_000, 0.01))
    assert bandwidth == pytest.approx(50 * 135e-6 / 0.01 + (65 + 40 * 160) * 1e-6)
    assert host == pytest.approx(50 * 5e-6 / 0.01)
    assert clocks == pytest.approx(4 * ((135e-6**2 + 6.72e-6**2) / 12 / 30) ** 0.5 / 50e-6)


@pytest.mark.parametrize("nodes", [37, 400, 10_000])
def test_simulation_is_within_the_bounds_of_paper(nodes: int) -> None:
    plant = Plant(nodes, 20, 500_000, 0.05)
    paper, found = on_paper(plant), simulated(plant)
    assert 0.75 * paper[0] < found[0] <= paper[0]  # stuff bits: seldom the most
    assert 0.2 * paper[1] < found[1] < 1.3 * paper[1]
    assert found[2] == pytest.approx(paper[2], rel=0.01)


def test_each_thing_breaks_first_somewhere() -> None:
    assert shares(Plant(80, 80, 125_000, 0.01, limit=1e-3)).first == "bandwidth"
    assert shares(Plant(80, 20, 125_000, 0.1)).first == "clocks"
    host = shares(Plant(100_000, 20, 1_000_000, 0.1, backbone=1e9))
    assert host.first == "host" and not host.holds and host.simulated is None
    assert most_nodes(Plant(1, 20, 1_000_000, 0.1, backbone=1e9)) == 16_000  # 0.1 s / 5 µs, a command for four


def test_a_sweep_has_every_combination(tmp_path: Path) -> None:
    found = list(sweep([10, 20], [5], [500_000], [0.01, 0.1], jobs=1))
    assert [(each.plant.nodes, each.plant.period) for each in found] == [(10, 0.01), (10, 0.1), (20, 0.01), (20, 0.1)]
    with pytest.raises(InputError, match=r"per_segment = 96 must be a whole number from 1 to 95"):
        list(sweep([10], [96], [500_000], [0.01]))
    told = CliRunner().invoke(app, ["network", "sweep", "--nodes", "ten"])
    assert told.exit_code == 2 and "must be numbers with commas" in told.output
    picture = tmp_path / "p.png"
    words = ["--nodes", "10,100000", "--per-segment", "20", "--bitrate", "1e6", "--period", "0.1", "--jobs", "1"]
    told = CliRunner().invoke(app, ["network", "sweep", *words, "--plot", str(picture)])
    assert told.exit_code == 0 and "host" in told.output and picture.stat().st_size > 1000, told.output
