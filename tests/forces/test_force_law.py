"""F = K d^β V^γ f^α: the law, its data, and coefficients fitted from measured forces."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from rds.cli.force_table import fit_table
from rds.cli.main import app
from rds.core.errors import InputError
from rds.machines.forces.fit import fit_force
from rds.machines.forces.force_law import coefficient_names, force_law
from rds.machines.forces.milling import cut

FEEDS = np.array([0.16, 0.25, 0.4, 0.63, 1.0, 1.6])  # mm, of the table of RN 1391
SPECIFIC = {  # kN/mm²
    "cast-iron-gg16": [1.50, 1.35, 1.20, 1.10, 1.00, 0.90],
    "cast-iron-gg25": [2.05, 1.80, 1.60, 1.45, 1.30, 1.15],
}


@pytest.mark.parametrize("name", SPECIFIC)
def test_the_shipped_coefficients_are_the_fit_of_their_source(name):
    found = fit_force(1e3 * np.array(SPECIFIC[name]) * FEEDS, {"feed": FEEDS})
    law = force_law(name)
    assert pytest.approx(found.values["K"], rel=1e-4) == law.K
    assert law.feed == pytest.approx(found.values["feed"], abs=1e-4)
    assert found.scatter < 0.01
    assert law.force(1.0, 100.0, FEEDS) == pytest.approx(1e3 * np.array(SPECIFIC[name]) * FEEDS, rel=0.02)


def test_kienzles_law_is_the_specific_force_times_the_chip():
    """F = k_c b h, with k_c of equation 5.5 at the same chip thickness."""
    law = force_law("aluminium-6061")
    made = cut(speed=2000, teeth=2, feed=0.1, depth=2, width=3, diameter=6, kc11=law.kc11, mc=law.mc, rake=14)
    h = made.chip_thickness
    assert law.force(2.0, 40.0, h) == pytest.approx(made.specific_force * 2.0 * h, rel=1e-12)


def test_every_law_has_its_source():
    for name in coefficient_names():
        assert force_law(name).source


def made_up(rng, n, noise=0.02):
    given = {"depth": rng.uniform(0.5, 4, n), "speed": rng.uniform(20, 200, n), "feed": rng.uniform(0.02, 0.4, n)}
    force = 850.0 * given["depth"] ** 0.95 * given["speed"] ** -0.08 * given["feed"] ** 0.7
    return force * np.exp(rng.normal(0.0, noise, n)), given


def test_intervals_hold_the_truth_as_often_as_they_say():
    rng, held = np.random.default_rng(5), 0
    for _ in range(300):
        force, given = made_up(rng, 12)
        low, high = fit_force(force, given).intervals["feed"]
        held += low <= 0.7 <= high
    assert 0.92 <= held / 300 <= 0.98


def test_without_noise_the_coefficients_are_exact():
    found = fit_force(*made_up(np.random.default_rng(1), 9, noise=0.0))
    expected = {"K": 850.0, "depth": 0.95, "speed": -0.08, "feed": 0.7}
    assert found.values == pytest.approx(expected, rel=1e-9)
    assert found.r_squared == pytest.approx(1.0)


@pytest.mark.parametrize(
    "given, fixed, fault",
    [
        ({"feed": [0.1, 0.1, 0.1]}, {}, "the feed is the same in all readings"),
        ({"feed": [0.4, 0.2, 0.1]}, {}, "the force falls as the feed rises .exponent -0.79.*fix its exponent"),
        ({"feed": [0.1, 0.2, 0.0]}, {}, "feed of reading 3 is 0"),
        ({"feed": [0.1, 0.2, 0.4], "depth": [1.0, 2.0, 4.0]}, {}, "change together in all readings"),
        (
            {"feed": [0.1, 0.2, 0.4], "depth": [1.0, 2.0, 3.0], "speed": [1.0, 3.0, 2.0]},
            {},
            "3 readings do not determine 4",
        ),
        ({"fed": [0.1, 0.2, 0.4]}, {}, "there is no 'fed' in the cutting force"),
    ],
)
def test_data_that_do_not_determine_a_coefficient_are_refused(given, fixed, fault):
    with pytest.raises(InputError, match=fault):
        fit_force(np.array([10.0, 17.0, 30.0]), {name: np.array(values) for name, values in given.items()}, fixed)


def test_a_table_is_fitted_written_and_used(tmp_path):
    lines = ["force [N],depth [mm],feed [mm]"]
    lines += [f"{500 * d * f**0.8:.6f},{d},{f}" for d in (1.0, 2.0) for f in (0.1, 0.2, 0.4)]
    (tmp_path / "forces.csv").write_text("\n".join(lines))
    out = tmp_path / "mine.toml"
    words = ["cutting", "fit", str(tmp_path / "forces.csv")]
    told = CliRunner().invoke(app, [*words, "--fix", "speed=0", "--fix", "speed=1"])
    assert told.exit_code == 2 and "--fix speed is given twice, 0 and 1" in told.stderr
    told = CliRunner().invoke(app, [*words, "-o", str(out), "--name", "mine"])
    assert told.exit_code == 0 and "wrote" in told.stdout
    law = force_law("mine", out)
    assert (law.K, law.depth, law.feed) == (
        pytest.approx(500, rel=1e-4),
        pytest.approx(1),
        pytest.approx(0.8, abs=1e-5),
    )


@pytest.mark.parametrize(
    "text, fault",
    [
        ("depth,feed\n1,2\n2,3\n", "no column 'force'"),
        ("force [kN],feed\n1,2\n2,3\n", "column 'force' is in kN; give it in N"),
        ("force,fed\n1,2\n2,3\n", "column 'fed' is none of a force table"),
        ("force,feed\n1,2\n2,x\n", "line 3, column 'feed': 'x' is not a number"),
    ],
)
def test_tables_that_will_not_do_are_refused(tmp_path, text, fault):
    (tmp_path / "forces.csv").write_text(text)
    with pytest.raises(InputError) as error:
        fit_table(tmp_path / "forces.csv")
    assert fault in str(error.value)


def test_a_file_of_coefficients_is_read_strictly(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        '[brass]\nmaterial = "brass"\ntool = "end mill"\nK = -4.0\ndepth = 1.0\nfeed = 0.8\nsource = "mine"\n'
    )
    with pytest.raises(InputError, match=r"line 4: brass\.K = -4\.0 must be more than 0 N"):
        force_law("brass", path)
    with pytest.raises(InputError, match=r"no cutting forces of 'bras'.*did you mean 'brass'"):
        force_law("bras", path)


def test_the_parameters_on_the_command_line(tmp_path):
    words = [
        "cutting",
        "parameters",
        "--speed",
        "2000",
        "--teeth",
        "2",
        "--feed",
        "0.59",
        "--depth",
        "6",
        "--width",
        "1",
        "--diameter",
        "6",
        "--rake",
        "14",
    ]
    words += ["--material", "aluminium-6061", "--engaged", "180", "--power", "160", "--feed-speed", "1200"]
    told = CliRunner().invoke(app, [*words, "--json"])
    assert told.exit_code == 1
    found = json.loads(told.stdout)
    assert found["power"] == pytest.approx(0.284, abs=1e-3) and len(found["warnings"]) == 2
    assert "warning: the cut takes 284 W" in CliRunner().invoke(app, words).stdout
