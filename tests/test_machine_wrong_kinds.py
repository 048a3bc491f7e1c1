"""A machine's file in which a value will not do is refused in a sentence, by Python and by the command."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rds import Experiment
from rds.cli.main import app
from rds.core.errors import InputError
from rds.machines import load_machine


def run_command(*arguments: str) -> subprocess.CompletedProcess[str]:
    """`rds` in a process of its own."""
    command = [sys.executable, "-m", "rds", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


FILE = """
sample_period = {period}
{top}
[axis.X]
node = {node}
travel = {travel}
resolution = 0.01
{more}
"""


@pytest.mark.parametrize(
    "changed, line, said",
    [
        ({"travel": "5"}, 6, r"axis.X.travel = 5 must be \[lowest, highest\]"),
        ({"travel": '["a", "b"]'}, 6, r"must be \[lowest, highest\]"),
        ({"travel": "[0.0, inf]"}, 6, r"must be \[lowest, highest\]"),
        ({"travel": "[true, 5.0]"}, 6, r"must be \[lowest, highest\]"),
        ({"node": "nan"}, 5, "node = nan must be a whole number from 1 to 127"),
        ({"node": "2.7"}, 5, "node = 2.7 must be a whole number"),
        ({"node": "300"}, 5, r"axis.X.node = 300 must be a whole number from 1 to 127 \(CAN node of the axis"),
        ({"node": "true"}, 5, "node = True must be a whole number"),
        ({"more": "unit = 5"}, 8, "axis.X.unit = 5 is unknown; known: mm, deg, rev/min"),
        ({"more": 'unit = "rpm"'}, 8, "axis.X.unit = 'rpm' is unknown; known: mm, deg, rev/min"),
        ({"travel": "[-0.002, 0.003]"}, 7, "resolution = 0.01 mm per count is more than all of its travel"),
        (
            {"more": "resolutoin = 5"},
            8,
            "unknown key 'resolutoin' in .axis.X.; known keys: .*did you mean 'resolution'",
        ),
        ({"more": "model = 5"}, 8, r"axis.X.model = 5 must be a table; write \[axis.X.model\]"),
        ({"more": "[axis.X.model]\ntau = 1.0"}, 8, "name is missing"),
        ({"more": "[axis.X.machine]\ntau = 'fast'"}, 9, "machine.tau = 'fast' must be a number, without quotes"),
        ({"more": "[axis.X.limits]\nvelocity = 1.0"}, 8, "acceleration is missing; give it in axis unit/s²"),
        ({"top": "converter = 5"}, 3, r"converter = 5 must be a table; write \[converter\]"),
        ({"top": "axis.Y = 5"}, 3, r"axis.Y = 5 must be a table; write \[axis.Y\]"),
        *[
            ({"top": f"[converter]\nbits = {bits}"}, 4, f"converter.bits = {shown} must be a whole number from 1 to 32")
            for bits, shown in (('"12"', "'12'"), ("2000", "2000"), ("0", "0"), ("2.5", "2.5"), ("true", "True"))
        ],
        ({"top": "[converter]\nrange = -10.0"}, 4, "converter.range = -10.0 must be more than 0 and at most 1000 V"),
        ({"period": "-1.0"}, 2, r"sample_period = -1.0 must be from 1e-06 to 1000 s \(time from one sample"),
        ({"period": "nan"}, 2, "sample_period = nan must be a finite number in s"),
        ({"period": "1" + "0" * 5000}, 2, r"has a number or date that cannot be read \(Exceeds the limit"),
    ],
)
def test_what_a_machine_cannot_be_is_refused_with_file_line_value_and_remedy(
    changed: dict[str, str], line: int | None, said: str, tmp_path: Path
) -> None:
    values = {"period": "0.001", "top": "", "node": "1", "travel": "[0.0, 9.0]", "more": ""}
    file = tmp_path / "own.toml"
    file.write_text(FILE.format(**values))
    assert load_machine(str(file)).axes["X"].node == 1
    file.write_text(FILE.format(**values | changed))
    with pytest.raises(InputError, match=said) as refusal:
        load_machine(str(file))
    assert f"own.toml, line {line}: " in str(refusal.value) or line is None
    with pytest.raises(InputError) as again:  # by the experiment that names it, with the same words
        Experiment(str(file), duration=0.1, reference=lambda t: t, controller="p")
    assert str(again.value) == str(refusal.value)


def test_the_command_says_the_same(tmp_path: Path) -> None:
    file = tmp_path / "own.toml"
    file.write_text(FILE.format(period="0.001", top="[converter]\nbits = 2000", node="1", travel="[0, 9]", more=""))
    (tmp_path / "experiment.toml").write_text(
        'machine = "own.toml"\naxis = "X"\nduration = 1.0\n[reference]\nkind = "constant"\nvalue = 1.0\n'
        '[controller]\nname = "p"\n'
    )
    done = run_command("run", str(tmp_path / "experiment.toml"))
    said = " ".join(done.stderr.split())
    assert done.returncode == 2 and "Traceback" not in said
    assert "own.toml, line 4: converter.bits = 2000 must be a whole number from 1 to 32" in said


def test_an_experiment_in_a_machine_s_place_is_told_as_one() -> None:
    file = Path(__file__).parents[1] / "examples" / "experiment.toml"
    with pytest.raises(InputError, match=r"describes an experiment, not a machine.*Experiment\.from_toml"):
        Experiment(file)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("[axis.X.model]\nname = 'linear_axis'", "did you mean 'linear-axis'"),
        ("[axis.X.model]\nname = 'linear-axis'\ntau = 0.01\nk = 1.8", "no option 'k'"),
        ("[axis.X.machine]\ntau = 0.01\nK = 1.8\nbacklash = -0.003", "backlash = -0.003 must be at least 0 mm"),
    ],
)
def test_a_check_looks_at_the_models_too(more: str, said: str, tmp_path: Path) -> None:
    file = tmp_path / "own.toml"
    file.write_text(FILE.format(period="0.001", top="", node="1", travel="[0.0, 9.0]", more=more))
    done = CliRunner().invoke(app, ["check", str(file)])
    assert done.exit_code == 2 and said in done.stderr and "own.toml, [axis.X.m" in done.stderr
    if "machine]" not in more:
        with pytest.raises(InputError, match=r"^\[axis.X.model\] of the machine's file: .*" + said):
            Experiment(str(file), axis="X", duration=0.1, reference=lambda t: t, controller="p")
