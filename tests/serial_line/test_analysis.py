"""Load and time left: the thesis's two numbers, formulas against measurement, and the command."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rds.bus.analysis import can_curves, serial_line
from rds.cli.main import app
from rds.core.errors import InputError
from rds.machines import load_machine


def test_the_numbers_of_the_thesis() -> None:
    assert serial_line.frame_time(6, 38_400) == pytest.approx(3.39e-3, abs=5e-6)
    assert serial_line.filling_time(1, 38_400) == pytest.approx(0.39, abs=2.5e-3)


@pytest.mark.parametrize("baud", [9_600, 38_400, 115_200])
def test_measured_is_what_the_formulas_say(baud: int) -> None:
    one = serial_line.measure(load_machine("starmill"), baud)
    assert one.frame == pytest.approx(serial_line.frame_time(6, baud))
    assert one.cycle == pytest.approx(serial_line.cycle_time(4, baud), rel=0.01)
    assert one.filling == pytest.approx(serial_line.filling_time(4, baud), rel=0.01)
    # the firmware's byte and answer are two; the thesis counts three
    assert one.synchronization == pytest.approx(serial_line.synchronization_time(baud) * 2 / 3, rel=0.05)


def test_fifteen_units_fit_where_the_baud_rate_is_high() -> None:
    assert serial_line.most_units(1, 1_000_000, 0.01) == 15
    assert serial_line.most_units(1, 19_200, 0.01) == 0
    with pytest.raises(InputError, match="16 units; a serial line has 1 to 15"):
        serial_line.fits(16, 38_400, 0.01)


def test_what_fits_is_what_a_run_takes(tmp_path: Path) -> None:
    """A loop takes 80 % of its period at most, method A a whole step."""
    runner, dcs = CliRunner(), ["bus", "analyse", "starmill", "--dialect", "dcs", "--baud"]
    told = runner.invoke(app, [*dcs, "38400", "--period", "0.0145"])  # 11.94 ms are 82 %
    assert told.exit_code == 1 and "a loop, which may take 80% of the period, does not fit." in told.output
    assert runner.invoke(app, [*dcs, "38400", "--period", "0.015"]).exit_code == 0
    assert [serial_line.most_units(1, 38_400, period) for period in (0.0145, 0.015)] == [3, 4]
    part = tmp_path / "part.ngc"
    part.write_text("G21 G90 F600\nG1 X1\nM2\n")
    told = runner.invoke(app, ["nc", "run", str(part), "--machine", "starmill", "--method", "A", "--baud", "38400"])
    assert told.exit_code == 2
    assert "method A and its answers take 11.94 ms at 38400 bit/s, more than a step of 10 ms" in told.output


def test_the_command_says_what_fits(tmp_path: Path) -> None:
    runner = CliRunner()
    picture = tmp_path / "load.png"
    told = runner.invoke(app, ["bus", "analyse", "starmill", "--dialect", "dcs", "--plot", str(picture)])
    assert told.exit_code == 0 and "leaves 5.35 ms" in told.output
    assert picture.read_bytes().startswith(b"\x89PNG")
    words = ["bus", "analyse", "starmill", "--dialect", "dcs", "--plot", str(tmp_path / "load.xyz")]
    odd = runner.invoke(app, words)
    assert odd.exit_code == 2 and "what kind of picture is that" in odd.output
    slow = runner.invoke(app, ["bus", "analyse", "starmill", "--dialect", "dcs", "--baud", "38400", "--json"])
    assert slow.exit_code == 1 and json.loads(slow.stdout)["fits"] is False
    can = runner.invoke(app, ["bus", "analyse", "mini-cnc", "--fits", "--json"])
    assert [row[-1] for row in json.loads(can.stdout)["fits"]] == ["no", "no", "no", "yes"]


def test_the_command_says_what_fits_on_can_by_method() -> None:
    """Frames of 8 bytes have 135 bits at worst: method C needs a third of one for each module and period."""
    words = ["bus", "analyse", "mini-cnc", "--period", "0.001", "--bitrate", "500000", "--units", "3"]
    told = CliRunner().invoke(app, [*words, "--json"])
    rows = {row[0][0]: row[2:] for row in json.loads(told.stdout)["methods"]}
    assert rows["A"] == pytest.approx([1.08, 108.0, -0.08, 2])
    assert rows["B"] == pytest.approx([3.24, 324.0, -2.24, 0])
    assert rows["C"] == pytest.approx([0.27, 27.0, 0.73, 11])
    assert "A part program by methods" in CliRunner().invoke(app, words).stdout
    words[-1] = "16"
    assert "16 modules; the methods are reckoned for 1 to 15" in CliRunner().invoke(app, words).stderr
    refused = CliRunner().invoke(app, ["bus", "analyse", "mini-cnc", "--units", "3"])
    assert refused.exit_code == 2 and "add --fits or --period" in refused.stderr


@pytest.mark.parametrize("units", [1, 3])
def test_can_measured_lies_between_the_formulas(units: int) -> None:
    """The least has no stuff bit, the most all that can be; what the modules' frames take lies between."""
    least, most = (can_curves.by_formula(units, 500_000, most) for most in (False, True))
    one = can_curves.measure(load_machine("mini-cnc"), units, 500_000)
    for name in ("cycle", "filling", "clocks"):
        assert getattr(least, name) < getattr(one, name) < getattr(most, name)
    assert most.cycle == pytest.approx((1 + units) * 135 / 500_000)


def test_the_curves_of_can_are_one_picture(tmp_path: Path) -> None:
    picture = tmp_path / "can.png"
    words = ["bus", "analyse", "mini-cnc", "--fits", "--plot", str(picture)]
    assert CliRunner().invoke(app, words).exit_code == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    refused = CliRunner().invoke(app, [*words, "--dialect", "oacs"])
    assert refused.exit_code == 2 and "leave --fits or --plot out" in refused.stderr
