"""Part programs run: the same in simulation and emulation, with an operator, in every mode."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner
from waiting import wait_for

import rds
from rds.cli.main import app
from rds.core.errors import InputError
from rds.modes.loop.execution import State
from rds.modes.loop.retimed import EXCESS
from rds.nc.run.judge import worst_lines
from rds.nc.run.prepare import prepare
from rds.nc.run.report import findings, program_report
from rds.nc.run.run import PartProgram, ProgramRun
from rds.results.html import all_notes
from rds.results.metrics import MOVING

PERIOD = 0.002  # s: with room for a busy computer
STOP_LINE = 7
CUTS = 150  # samples after which it cuts along line 5


def reaches(run: ProgramRun, state: State) -> None:
    """Wait until the run is in a state."""
    wait_for(lambda: run.done or ((status := run.status()) is not None and status.state is state))
    assert not run.done, run.wait().meta


def same(a: rds.Result, b: rds.Result) -> bool:
    """Whether all columns of a are those of b, bit for bit."""
    return len(a) == len(b) and all((a[name] == b[name]).all() for name in a.columns)


# --- simulations --------------------------------------------------------------------------------------------------


def test_the_same_program_gives_the_same_samples(part: Path) -> None:
    assert same(PartProgram(part).run(), PartProgram(part).run())


@pytest.mark.parametrize("profile", ["trapezoid", "blended"])
def test_other_profiles_run_as_they_are_planned(part: Path, profile: str) -> None:
    """The motion is another one: it breaks the jerk, which it does not promise to keep."""
    program = PartProgram(part, profile=profile)
    result = program.run(changes=[(0.0, "optional_stop", 0.0)])
    assert program.prepared.certificate is not None and program.prepared.certificate.ok
    shares = result.meta["program"]["limit_shares"]
    assert max(share["jerk"] for share in shares.values()) > 2.0
    with pytest.raises(InputError, match="plans the motion, and an interpolator makes it"):
        PartProgram(part, profile=profile, interpolator="tustin")


COUPLED = """import numpy as np
params = {"Kp": 25.0, "K": [1.764, 1.882, 1.594]}


def control(t, r, y, state, params):
    assert r.position.shape == y.shape == (3,)
    return (r.velocity + params["Kp"] * (r.position - y)) / np.array(params["K"]), state
"""


def test_a_coupled_controller_drives_the_axes_beside_the_spindles_own(part: Path) -> None:
    """What it does is what three single ones do; its parameters are live once."""
    (part.parent / "coupled.py").write_text(COUPLED)
    program = PartProgram(part, controller={"file": str(part.parent / "coupled.py"), "coupled": True})
    names = {channel.name for channel in program.plan().channels()}
    assert "controller.Kp" in names and "X.Kp" not in names and any(name.startswith("spindle.") for name in names)
    result = program.run()

    def alone(t: float, r: Any, y: float, state: Any, params: Any) -> Any:
        return (r.velocity + 25.0 * (r.position - y)) / 1.764, state

    one = PartProgram(part, controller=alone).run()
    assert np.array_equal(result["X_measured"], one["X_measured"])
    assert np.array_equal(result["spindle_measured"], one["spindle_measured"])


def test_a_comparison_has_the_contour_errors(part: Path) -> None:
    one, other = PartProgram(part).run(), PartProgram(part, controller="p").run()
    compared = rds.compare(one, other)
    largest, rms = (compared.contour[f"{kind} contour error"] for kind in ("largest", "RMS"))
    assert largest[0] == pytest.approx(one.meta["program"]["contour_error"]["max"])
    assert rms[1] == pytest.approx(other.meta["program"]["contour_error"]["rms"])
    assert "largest contour error [mm]" in str(compared) and "Contour" in compared._repr_html_()
    assert compared.to_json()["contour"]["RMS contour error"] == list(rms)


def test_the_predicted_time_is_the_executed_one(part: Path) -> None:
    program = PartProgram(part)
    about = program.run().meta["program"]
    assert about["completed"]
    assert about["moving_samples"] == about["predicted_samples"] == program.prepared.program.samples
    assert about["executed_s"] == pytest.approx(about["predicted_s"] + about["spindle_s"] + about["stops_s"])
    slower = program.run(changes=[(0.0, "override", 0.5)]).meta["program"]
    assert slower["moving_samples"] > 1.5 * about["moving_samples"]
    assert "the override was not 100 % throughout" in " ".join(findings(slower))


def test_all_axes_and_the_spindle_run_under_their_controllers(part: Path, tmp_path: Path) -> None:
    result = PartProgram(part).run()
    assert result.axes == ["X", "Y", "Z", "spindle"]
    names = {name: law["name"] for name, law in result.meta["controller"].items()}
    assert names == {"X": "tracking", "Y": "tracking", "Z": "tracking", "spindle": "pid"}
    assert result["spindle_reference"].max() == 2000.0
    cuts = result["program_sample"] > 0.0
    assert np.abs(result["spindle_measured"][cuts] - 2000.0).max() <= 0.02 * 2000.0
    (tmp_path / "laws.toml").write_text(
        '[controller]\nname = "p"\n[axis.Y.controller]\nname = "pid"\n'
        '[axis.spindle.controller]\nname = "p"\nPgain = 0.1\n'
    )
    mixed = PartProgram(part, experiment=tmp_path / "laws.toml").run()
    names = {name: law["name"] for name, law in mixed.meta["controller"].items()}
    assert names == {"X": "p", "Y": "pid", "Z": "p", "spindle": "p"}


def test_the_contour_error_is_the_distance_to_the_path(part: Path) -> None:
    """Line 5 runs along X at Y = 0, Z = −0.5; line 6 is the circle of radius 2 about (2, −2)."""
    result = PartProgram(part).run()
    x, y, z = (result[f"{name}_measured"] for name in "XYZ")
    straight = np.flatnonzero((result["program_line"] == 5) & (x > 0.2) & (x < 1.9))
    expected = np.hypot(y, z + 0.5)[straight]
    assert result["contour_error"][straight] == pytest.approx(expected, abs=1e-12)
    curved = np.flatnonzero((result["program_line"] == 6) & (x > 2.2) & (x < 3.8))
    expected = np.hypot(np.hypot(x - 2.0, y + 2.0) - 2.0, z + 0.5)[curved]
    assert result["contour_error"][curved] == pytest.approx(expected, abs=1e-12)
    worst = result.meta["program"]["contour_error"]
    assert worst["max"] == result["contour_error"].max()
    assert 4 <= worst["line"] <= 9
    following = result.meta["program"]["following_error"]["X"]
    assert following["max"] == np.abs(result["X_reference"] - x).max()


def test_the_line_of_the_largest_contour_error_is_the_one_that_the_list_of_lines_names(tmp_path: Path) -> None:
    """At the corner it has begun line 4 and is still nearest to line 3, which it overshoots."""
    (tmp_path / "corner.ngc").write_text("G21 G90 G94\nG1 X5 F700\nX0\nZ-5\nM30\n")
    result = PartProgram(tmp_path / "corner.ngc", "lathe").run()
    worst = result.meta["program"]["contour_error"]
    assert (worst["line"], worst["max"], worst["time_s"]) == worst_lines(result, result["contour_error"], 1)[0]


def test_metrics_are_of_motion_alone(part: Path) -> None:
    """A program that is held for two seconds has the metrics of one that is not, but for the halt itself."""
    program = PartProgram(part)
    plain, held = program.run(), program.run(changes=[(0.3, "hold", 1), (2.3, "hold", 0)])
    assert MOVING == (State.RUNS, State.HOME)
    used = np.isin(held["program_state"], MOVING)
    error = (held["X_reference"] - held["X_measured"])[used]
    assert held.metrics["X"]["rms_error"] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-12)
    assert held.meta["program"]["waiting_samples"] == len(held) - used.sum() > 1800
    following = held.meta["program"]["following_error"]["X"]
    assert following["rms"] == pytest.approx(held.metrics["X"]["rms_error"], rel=1e-12)
    assert following["rms"] > 0.8 * plain.metrics["X"]["rms_error"]
    said = f"The metrics leave out {len(held) - used.sum()} of {len(held)} samples"
    assert held.notes[0].startswith(said)
    assert any(note.startswith(said) for note in held.compare(plain).notes)
    assert any(note.startswith(said) for note in all_notes(held))  # those of report.html


def test_what_is_sent_keeps_the_limits_by_its_own_account(part: Path) -> None:
    program = PartProgram(part)
    result = program.run(changes=[(0.2, "override", 1.7), (0.4, "hold", 1), (0.9, "hold", 0)])
    shares = result.meta["program"]["limit_shares"]
    assert set(shares) == {"X", "Y", "Z"}
    assert 0.9 < shares["X"]["jerk"] <= 1.0 + 1.1 * EXCESS
    jerk = np.abs(np.diff(result["X_reference"], 3)).max() / 0.001**3
    assert shares["X"]["jerk"] == pytest.approx(jerk / program.prepared.program.limits[2, 0], rel=1e-12)


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ("G1 X500 F600\nM2\n", r"p\.ngc:1:.*X"),
        ("G1 X5 A3 F600\nM2\n", r"p\.ngc:1:.*A"),
        ("G1 X5\nM2\n", r"p\.ngc:1:.*feed"),
    ],
)
def test_what_cannot_run_is_refused(program: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "p.ngc").write_text(program)
    with pytest.raises(rds.InputError, match=said):
        PartProgram(tmp_path / "p.ngc")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ('[reference]\nkind = "sinusoid"\n', "the part program says what the axes do: remove reference"),
        ('axis = "X"\n', "names an axis; the part program drives all of them"),
        ('[axis.Y.reference]\nkind = "sinusoid"\n', "the part program says what the axes do: remove reference"),
        ('[axis.A.controller]\nname = "p"\n', "the program drives X, Y, Z, spindle, and no axis 'A'"),
        ('mode = "system-test"\n', "mode system-test has no controllers"),
        ("duration = 3.0\n", "remove duration"),
    ],
)
def test_words_that_do_not_go_with_a_program_are_refused(part: Path, tmp_path: Path, words: str, said: str) -> None:
    (tmp_path / "e.toml").write_text(words)
    with pytest.raises(rds.InputError, match=said):
        PartProgram(part, experiment=tmp_path / "e.toml")


def test_what_is_too_long_is_told_before_it_is_planned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "slow.ngc"
    file.write_text("G21 G94\nG1 X50 F0.01\nM2\n")
    monkeypatch.setattr("rds.nc.run.prepare.motion_of", lambda *_, **__: pytest.fail("it was planned"))
    with pytest.raises(rds.InputError, match=r"at least 300000 s \(83\.3 h\), .* about 2\.9e\+02 GB of memory"):
        PartProgram(file)
    file.write_text("G21 G94\nG1 X50 F1\nM2\n")
    monkeypatch.setattr("rds.nc.run.prepare._free_memory", lambda: 1e9)
    with pytest.raises(rds.InputError, match=r"at least 3000 s .* about 2\.9 GB of memory \(1 are free\)"):
        PartProgram(file)


def test_a_dwell_of_ages_is_a_fault_of_its_word(tmp_path: Path) -> None:
    (tmp_path / "p.ngc").write_text("G21\nG4 P1000000000\nM2\n")
    with pytest.raises(rds.InputError, match=r"p\.ngc:2:4: P1000000000: a dwell of 1e\+09 s is longer than 3600"):
        PartProgram(tmp_path / "p.ngc")


def test_a_current_compiled_program_is_used(part: Path) -> None:
    machine = rds.load_machine("mini-cnc")
    first = prepare(part, machine)
    stamp = part.with_suffix(".dat").stat().st_mtime_ns
    again = prepare(part, machine)
    assert part.with_suffix(".dat").stat().st_mtime_ns == stamp
    assert (again.program.position == first.program.position).all()


def test_a_machine_without_coolant_says_so(part: Path) -> None:
    part.write_text(part.read_text().replace("M3", "M3\nM8"))
    assert "mini-cnc has no coolant to switch" in PartProgram(part).run().meta["notes"][0]


def test_the_report_tells_what_was_changed_and_the_run_is_kept(part: Path, tmp_path: Path) -> None:
    program = PartProgram(part)
    result = program.run(changes=[(0.5, "hold", 1), (1.0, "hold", 0)], out=tmp_path / "out")
    saved = rds.open_result(tmp_path / "out")
    assert same(saved, result)
    assert saved.meta["program"] == result.meta["program"]
    report = program_report(result, program.prepared)
    times = dict(map(tuple, report.table("Cycle time").rows))
    assert times["held"] == result.meta["program"]["held_s"] > 0.05
    assert report.table("Changed while it ran").rows[0] == [0.5, "hold", 0.0, 1.0]


def test_a_simulation_with_an_operator_waits_for_him(part: Path) -> None:
    run = PartProgram(part).start()
    reaches(run, State.STOP)
    time.sleep(0.1)
    taken = run.progress[0]
    time.sleep(0.1)
    assert run.progress[0] == taken  # time stands still, and no memory fills
    run.resume()
    result = run.wait()
    assert result.meta["ending"] == "done"
    assert same(result, PartProgram(part).run(changes=result.meta["changes"]))


# --- real time ----------------------------------------------------------------------------------------------------


@pytest.mark.realtime
def test_an_operated_emulation_is_repeated_by_a_simulation(slow_part: Path, alone: Path) -> None:
    program = PartProgram(slow_part, sample_period=PERIOD)
    run = program.start("emulation", out=alone / "run")
    wait_for(lambda: run.progress[0] > CUTS)
    run.hold()
    reaches(run, State.HELD)
    held = run.status()
    assert held is not None and held.feed == 0.0
    run.override(1.6)
    run.resume()
    reaches(run, State.STOP)
    stopped = run.status()
    assert stopped is not None and stopped.line == STOP_LINE
    run.live_values.set("X.g1", 1500.0)
    run.resume()
    emulated = run.wait()
    assert emulated.meta["ending"] == "done"
    assert {name for _, name, _, _ in emulated.meta["changes"]} == {"hold", "resume", "override", "X.g1"}
    simulated = PartProgram(slow_part, sample_period=PERIOD).run(changes=emulated.meta["changes"])
    assert same(simulated, emulated)


@pytest.mark.realtime
def test_an_implementation_is_held_on_its_path_and_goes_home(slow_part: Path, alone: Path) -> None:
    run = PartProgram(slow_part, sample_period=PERIOD).start("implementation", out=alone / "run")
    wait_for(lambda: run.progress[0] > CUTS)
    run.hold()
    reaches(run, State.HELD)
    run.resume()
    reaches(run, State.STOP)
    run.home()
    result = run.wait()
    assert result.meta["ending"] == "stopped"
    assert result.meta["ending_reason"] == f"went home from line {STOP_LINE}"
    assert not result.meta["program"]["completed"]
    assert result.meta["program"]["last_line"] == STOP_LINE
    assert result["contour_error"].max() < 0.3
    for name in "XYZ":
        assert result[f"{name}_reference"][-1] == 0.0
        assert abs(result[f"{name}_measured"][-1]) < 0.1
    assert result["spindle_reference"][-1] == 0.0
    assert "X_simulated" in result
    assert np.abs(result["X_simulated"] - result["X_measured"]).max() < 0.5


OPERATOR = """
import sys, time
from rds.nc.run.run import PartProgram
run = PartProgram(sys.argv[1], sample_period=0.002).start("implementation", out=sys.argv[2])
run.ready()
while run.progress[0] < 300:
    time.sleep(0.01)
print("cuts", flush=True)
time.sleep(60)
"""


@pytest.mark.realtime
def test_a_program_whose_operator_is_killed_comes_to_rest_on_its_path(part: Path, alone: Path) -> None:
    part.write_text(part.read_text().replace("G1 X2 F600", "G1 X2 F60"))
    host = subprocess.Popen([sys.executable, "-c", OPERATOR, str(part), "run"], stdout=subprocess.PIPE, text=True)
    assert host.stdout is not None
    assert host.stdout.readline() == "cuts\n"
    host.kill()
    host.wait()
    host.stdout.close()
    wait_for(lambda: (alone / "run" / "ending.json").is_file())
    left = json.loads((alone / "run" / "ending.json").read_text())
    assert left["ending"] == "stopped"
    assert left["reason"].startswith("stopped in line ")
    record = rds.open_result(alone / "run")
    moved = [np.abs(np.diff(record[f"{name}_reference"][-3:])).max() for name in "XYZ"]
    assert max(moved) < 1e-4
    assert record.meta["changes"][-1][1] == "stop"


@pytest.mark.realtime
def test_a_program_is_operated_from_another_terminal(one_axis: list[str], alone: Path) -> None:
    host = subprocess.Popen(
        [sys.executable, "-m", "rds.cli.main", "nc", "run", *one_axis, "--mode", "emulation", "--out", "run", "--json"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
    )
    assert host.stderr is not None
    try:
        said = host.stderr.readline()
        assert said == f"rds: line {STOP_LINE}: stops; `rds nc operate run --resume` in another terminal goes on\n"
        shown = CliRunner().invoke(app, ["nc", "operate", "run", "--json"])
        assert json.loads(shown.stdout)["override"] == 1.0
        wrong = CliRunner().invoke(app, ["nc", "operate", "run", "--set", "A.g1=3"])
        assert wrong.exit_code == 2
        assert "there is no live value 'A.g1'; this run has X.g1, X.g2" in wrong.stderr
        faster = CliRunner().invoke(app, ["nc", "operate", "run", "--override", "150", "--resume"])
        assert faster.exit_code == 0, faster.stderr
        out, errors = host.communicate(timeout=120)
    finally:
        host.kill()
        host.communicate()
    found = json.loads(out)
    assert found["ending"] == "done", errors
    assert found["program"]["completed"]
    assert [change[1:] for change in found["changes"]] == [["override", 1.0, 1.5], ["resume", 0.0, 1.0]]
    gone = CliRunner().invoke(app, ["nc", "operate", "run", "--hold"])
    assert gone.exit_code == 2
    assert "no run goes on there" in gone.stderr
