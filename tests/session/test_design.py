"""The design panel's session: what it says is what the Python functions say, and what it writes keeps the interface."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.controllers import library_controller
from rds.controllers.design import tracking_gains
from rds.core.errors import InputError
from rds.machines import load_machine
from rds.panels.design.charts import charts, key_numbers
from rds.panels.design.fields import fields
from rds.panels.design.state import Design
from rds.panels.session import Session
from tests.documents import blocks

X = load_machine("mini-cnc").axis("X").model


def design(folder: Path) -> Design:
    return Design(Session(folder))


def test_the_paper_s_poles_give_the_paper_s_gains(tmp_path: Path) -> None:
    made = design(tmp_path).now()
    assert (made.gains["g1"], made.gains["g2"]) == tracking_gains(X["tau"], [[-32, 24], [-32, -24]])
    assert made.gains["g1"] == pytest.approx(1600.0) and made.gains["g2"] == pytest.approx(-36.57, abs=0.01)
    assert made.damping == pytest.approx(0.8) and made.frequency == pytest.approx(40.0)
    by_name = library_controller("tracking", X, 0.001, 10.0)
    assert by_name.params["coefficients"] == made.controller.params["coefficients"]


@given(real=st.floats(-80.0, -5.0), imaginary=st.floats(0.0, 60.0))
def test_the_loop_has_the_poles_that_were_placed(tmp_path_factory: pytest.TempPathFactory, real, imaginary) -> None:
    chosen = design(tmp_path_factory.mktemp("d"))
    chosen.choices.set("sample_period", 1e-4)  # s: so short that the sampled loop is nearly the continuous one
    made = chosen.move("pair", complex(real, imaginary))
    found = made.closed_poles[np.isfinite(made.closed_poles)]
    size = abs(complex(real, imaginary))
    # the sum of the poles is well conditioned where they fall together; each by itself is not
    slow = sorted(found, key=abs)[:2]
    assert sum(slow).real == pytest.approx(2.0 * real, abs=2e-4 * (size**2 + size / X["tau"]))  # of the order of T
    assert abs(slow[0] * slow[1]) == pytest.approx(real**2 + imaginary**2, rel=0.02)
    assert sorted(found, key=abs)[2].real == pytest.approx(-320.0, rel=1e-6)


def test_margins_are_those_of_the_robustness_study(tmp_path: Path) -> None:
    from rds.identification.robustness.margins import law_about_rest, loop_margins
    from rds.models import library_model

    made = design(tmp_path).now()
    law = law_about_rest(library_controller("tracking", X, 0.001, 10.0))
    assert law is not None
    model = library_model("linear-axis", tau=X["tau"], K=X["K"])
    assert list(made.margins.values()) == loop_margins(law, [model], 0.001)[0].tolist()
    w, loop = made.loop()
    crossing = int(np.flatnonzero(np.abs(loop) < 1.0)[0])
    assert 180.0 + np.degrees(np.angle(loop[crossing])) == pytest.approx(made.margins["phase_margin"], abs=2.0)
    assert w[-1] == pytest.approx(np.pi / 0.001)


@pytest.mark.parametrize(
    ("name", "place", "why"),
    [
        ("pair", 5 + 10j, "less than 0"),
        ("observer", 3 + 0j, "less than 0"),
        ("pair", -100 + 1500j, "sampled loop unstable"),
        ("pair", -0.05 + 1j, "from -100000 to -0.1"),
        ("third", -1 + 0j, "no pole 'third'"),
    ],
)
def test_a_pole_that_cannot_be_there_moves_nothing(tmp_path: Path, name: str, place: complex, why: str) -> None:
    chosen = design(tmp_path)
    before = chosen.choices.values()
    with pytest.raises(InputError, match=why):
        chosen.move(name, place)
    assert chosen.choices.values() == before


def test_on_the_limit_the_sampled_loop_is_just_stable(tmp_path: Path) -> None:
    chosen = design(tmp_path)
    for real, imaginary in chosen.limit()[::15]:
        inside = chosen.with_poles((complex(real, imaginary) * 0.99, complex(real, -imaginary) * 0.99), -320.0)
        assert inside.margins["pole_radius"] < 1.0
        with pytest.raises(InputError, match="sampled loop unstable"):
            chosen.with_poles((complex(real, imaginary) * 1.01, complex(real, -imaginary) * 1.01), -320.0)


def test_step_without_friction_settles_as_the_pair_says(tmp_path: Path) -> None:
    made = design(tmp_path).now()
    frictionless, with_friction = made.step(1.0, friction=False), made.step(1.0)
    # a second-order pair of damping 0.8: overshoot exp(-π ζ/√(1-ζ²)) = 1.5 %; the observer starts right, and adds none
    assert frictionless.overshoot == pytest.approx(1.5, abs=0.4)
    assert frictionless.settling == pytest.approx(0.11, abs=0.03) and abs(frictionless.remaining) < 1e-3
    # what Coulomb friction may hold back: (F/τ)(1 + g₂/|observer pole|)/g₁
    held = 0.539 / X["tau"] / made.gains["g1"]
    assert 0.0 < with_friction.remaining < held
    assert np.abs(with_friction.voltage).max() <= 10.0


def test_cloud_is_repeatable_and_grows_with_the_delay(tmp_path: Path) -> None:
    chosen = design(tmp_path)
    clouds = []
    for delay in (0.0, 0.0, 8.0):
        chosen.choices.set("delay", delay)
        task = chosen.cloud(chosen.now())
        assert task.wait(60) and task.error is None and task.result is not None
        clouds.append(task.result)
    assert np.array_equal(clouds[0].margins, clouds[1].margins) and clouds[0].unstable == 0
    assert clouds[0].worst["phase_margin"] < chosen.now().margins["phase_margin"]
    assert clouds[2].worst["phase_margin"] < clouds[0].worst["phase_margin"] - 5.0


def test_written_file_answers_as_the_library_s_controller(tmp_path: Path) -> None:
    from rds.core.load import load_student
    from rds.core.types import Reference

    chosen = design(tmp_path)
    chosen.move("pair", -40 + 10j)
    path = chosen.write("mine.py")
    checking = chosen.check(path)
    assert checking.wait(60) and checking.result is not None and checking.result.ok, checking.result
    control = load_student(path).functions["control"]
    made, own = chosen.now().controller, load_student(path)
    state, own_state = made.initial_state, [0.0, 0.0]
    for k in range(100):
        r, y = Reference(np.sin(0.01 * k), np.cos(0.01 * k), 0.0), 0.9 * np.sin(0.01 * k)
        u, state = made.control(k * 1e-3, r, y, state, made.params)
        own_u, own_state = control(k * 1e-3, r, y, own_state, own.params)
        assert own_u == pytest.approx(u, rel=1e-9, abs=1e-12)
    with pytest.raises(InputError, match="there already"):
        chosen.write("mine.py")
    chosen.move("pair", -20 + 10j)
    before = path.read_text()
    assert chosen.write("mine.py", replace=True).read_text() != before


@pytest.mark.parametrize("name", ["", "mine.txt", "../mine.py", "/tmp/mine.py"])
def test_names_that_are_no_file_of_the_folder(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="name the controller's file"):
        design(tmp_path).write(name)


def test_an_axis_that_turns_is_shown_in_its_unit(tmp_path: Path) -> None:
    chosen = Design(Session(tmp_path, "xyzac"))
    chosen.choices.set("axis", "A")
    made = chosen.now()
    assert charts(made, 1.0)[0]["y_label"] == "position [deg]"
    assert re.search(r"left at the end</td><td.*?>[-\d.e]+ deg</td>", key_numbers(made, 1.0, None))


def test_a_machine_without_a_position_axis_is_refused_in_words(tmp_path: Path) -> None:
    machine = load_machine("mini-cnc")
    alone = replace(machine, axes={"spindle": machine.axis("spindle")})
    with pytest.raises(InputError, match="mini-cnc has no position axis"):
        list(fields(alone))


def test_from_a_fitted_model(tmp_path: Path) -> None:
    text = 'structure = "axis"\n'
    for name, value, unit in (("tau", 0.02, "s"), ("K", 2.0, "(mm/s)/V"), ("friction_plus", 0.5, "mm/s")):
        text += f'[parameters.{name}]\nvalue = {value}\nunit = "{unit}"\n'
    text += '[parameters.friction_minus]\nvalue = -0.5\nunit = "mm/s"\n'
    (tmp_path / "fitted.toml").write_text(text)
    chosen = design(tmp_path)
    chosen.choices.set("source", "file")
    with pytest.raises(InputError, match="name the model file"):
        chosen.now()
    chosen.choices.set("model_file", "fitted.toml")
    made = chosen.now()
    assert made.gains["g1"] == pytest.approx(1600.0) and made.gains["g2"] == pytest.approx(64.0 - 1.0 / 0.02)
    assert any("Coulomb" in sentence for sentence in made.axis.left_out)
    assert "fitted.toml" in chosen.write("fit.py").read_text()
    (tmp_path / "fitted.toml").write_text(text.replace("0.02", "0.04"))
    assert chosen.now().gains["g2"] == pytest.approx(64.0 - 1.0 / 0.04)


def test_try_it_chooses_the_file_in_equipment_control(tmp_path: Path) -> None:
    from rds.panels.equipment.state import Equipment

    chosen = design(tmp_path)
    chosen.choices.set("axis", "Y")
    chosen.try_it(chosen.write("mine.py"))
    table = Equipment(chosen.session, "control").table()
    assert table["axis"] == "Y" and table["controller"] == {"file": "mine.py"}


def test_the_command_line_writes_the_same_file(tmp_path: Path) -> None:
    from typer.testing import CliRunner

    from rds.cli.main import app

    chosen = design(tmp_path)
    chosen.move("pair", -40 + 10j)
    there = tmp_path / "by-command.py"
    words = ["design", "tracking", "--axis", "X", "-o", str(there), "--poles", "-40+10j,-40-10j"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert there.read_text() == chosen.write("by-panel.py").read_text()
    for bad in (["--axis", "spindle"], [], ["model.toml", "--axis", "X"], ["model.toml", "--machine", "mini-cnc"]):
        assert CliRunner().invoke(app, ["design", "tracking", "-o", str(there), *bad]).exit_code == 2


def test_the_command_takes_period_and_range_of_the_machine(tmp_path: Path) -> None:
    from typer.testing import CliRunner

    from rds.cli.main import app
    from rds.core.load import load_student

    there = tmp_path / "law.py"
    for words, period, volts in (("A mrmt-oacs", 0.001, 12.0), ("X starmill", 0.01, 10.0)):
        axis, machine = words.split()
        ran = CliRunner().invoke(app, ["design", "tracking", "--axis", axis, "--machine", machine, "-o", str(there)])
        assert ran.exit_code == 0, ran.output
        law = load_student(there)
        assert (law.sample_period, law.params["limit"]) == (period, volts)


def test_the_document_s_python_says_what_it_says(capsys: pytest.CaptureFixture[str]) -> None:
    (block,) = (each for each in blocks("docs/design.md") if each.language == "python")
    exec(compile(block.text, "docs/design.md", "exec"), {})
    gain, _, settling = map(float, capsys.readouterr().out.split())
    assert gain == pytest.approx(1700.0) and 0.05 < settling < 0.2
