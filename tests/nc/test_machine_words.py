"""What a machine's file says of part programs: outputs, feeds that are limited; a lathe; and programs step by step."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.interpolators.motion.limiting import explained
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.planner import plan
from rds.interpolators.motion.segments import chain, line
from rds.machines import load_machine
from rds.machines.machine import Machine
from rds.nc import ProgramError, steps
from rds.nc.check import check_program, motion
from rds.nc.path_block import PathBlock
from rds.nc.run.prepare import prepare
from rds.nc.run.report import certificate_picture
from rds.nc.setup import Setup

SHIPPED = Path(load_machine("mini-cnc").path)


def machine_with(folder: Path, top: str, end: str = "") -> Machine:
    path = folder / "own.toml"
    path.write_text(f"{top}\n{SHIPPED.read_text()}\n{end}")
    return load_machine(str(path))


def program(folder: Path, text: str) -> Path:
    path = folder / "part.ngc"
    path.write_text(text)
    return path


def test_outputs_that_a_machine_names_are_switched_where_the_program_says(tmp_path: Path) -> None:
    machine = machine_with(tmp_path, "", '[outputs]\ndigital = ["air", "clamp"]\nanalog = ["laser"]\n')
    part = program(
        tmp_path, "G21 G90 G94 F300\nM64 P1\nG1 X5\nM62 P0\nG1 X10\nM68 E0 Q0.25\nM63 P0\nM65 P1\nG1 X0\nM2\n"
    )
    result, _ = check_program(part, machine, Setup())
    assert result.ok, result.faults
    prepared = prepare(part, machine)
    switched = [(row["output"], row["value"], row["line"]) for row in prepared.outputs]
    assert switched == [("clamp", 1, 2), ("air", 1, 4), ("laser", 0.25, 6), ("air", 0, 7), ("clamp", 0, 8)]
    at = [row["sample"] for row in prepared.outputs]
    assert at == sorted(at) and at[0] < at[1] < at[2]
    x = prepared.program.position[at[1], 0]
    assert x == pytest.approx(5.0, abs=0.1)  # where the first move ends


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("G88 X5 Y5 Z-2 R1 P.1", "G88 leaves the tool in the hole"),
        ("M19 Q1", "the spindle here cannot stop at an angle"),
        ("G73 U1.5 R5", r"U1.5: U goes with the form .* that Fanuc's lathes have.*G71 Q100 I1.5 D0.2 R0.5"),
        ("G18 G71 P10 Q20 D0.2", r"P10: P goes with the form .* that Fanuc's lathes have"),
    ],
)
def test_what_no_machine_here_does_is_refused_with_what_to_write(tmp_path: Path, words: str, says: str) -> None:
    part = program(tmp_path, f"G21 G90 F300 S500 M3\n{words}\nM5\nM2\n")
    result, _ = check_program(part, load_machine("mini-cnc"), Setup())
    assert [fault.line for fault in result.faults] == [2]
    assert re.search(says, str(result.faults[0]))


def test_an_output_without_a_name_is_refused_by_line(tmp_path: Path) -> None:
    part = program(tmp_path, "G21 G90 F300\nG1 X1\nM64 P3\nM2\n")
    result, _ = check_program(part, load_machine("mini-cnc"), Setup())
    assert [fault.line for fault in result.faults] == [3]
    assert "names no digital output 3 (it has none)" in str(result.faults[0])
    (fault,) = check_program(program(tmp_path, "M68 E0 Q1\nM2\n"), load_machine("mini-cnc"), Setup())[0].faults
    assert "names no analog output 0 (it has none)" in str(fault)


def test_a_feed_above_an_axis_is_limited_with_a_note_where_the_machine_says_so(tmp_path: Path) -> None:
    part = program(tmp_path, "G21 G90 G94\nG1 X20 F5000\nM2\n")
    refused, _ = check_program(part, load_machine("mini-cnc"), Setup())
    assert not refused.ok
    machine = machine_with(tmp_path, "limit_feed = true")
    result, _ = check_program(part, machine, Setup())
    assert result.ok
    assert any("is limited to it" in warning.reason and warning.line == 2 for warning in result.warnings)
    limits = machine.axes["X"].limits
    assert limits is not None
    speed = abs(prepare(part, machine).program.velocity[:, 0]).max()
    assert speed == pytest.approx(limits.velocity, rel=0.002)
    (tools := tmp_path / "tools.tbl").write_text("T1 P1 Z10 ;max F400\n")  # what a tool bears is no speed of an axis
    part = program(tmp_path, "G21 G90 F401\nT1 M6\nG1 X1\nM2\n")
    (fault,) = check_program(part, machine, Setup(tools=tools))[0].faults
    assert "401 mm/min is more than the tool table allows tool 1 (400); lower it" in str(fault)


@pytest.mark.parametrize(
    ("moves", "remedy"),
    [("G0 Z1\nG33 Z-10 K1", "; lower S"), ("G0 Z1\nG84 Z-20 R1 F1000", "; lower F and S by the same factor")],
)
def test_a_thread_or_tap_is_never_limited_to_another_pitch(tmp_path: Path, moves: str, remedy: str) -> None:
    part = program(tmp_path, f"G21 F900\nM3 S1000\n{moves}\nG80 G1 X1 F900\nM5\nM2\n")
    result, _ = check_program(part, machine_with(tmp_path, "limit_feed = true"), Setup())
    assert [fault.line for fault in result.faults] == [4] and remedy in result.faults[0].reason
    assert [warning.line for warning in result.warnings if "is limited to it" in warning.reason] == [5]


def test_a_thread_is_cut_on_the_lathe_by_the_turns_of_its_spindle(tmp_path: Path) -> None:
    part = program(
        tmp_path,
        "G18 G21 G90 G7 G94\nS600 M3\nG0 X12 Z4\nG76 P1.5 Z-15 I-1 J0.2 K1.84 R1.5 Q29.5 H1 E0\nG0 X20 Z10\nM5\nM2\n",
    )
    machine = load_machine("lathe")
    result, _ = check_program(part, machine, Setup())
    assert result.ok, result.faults
    planned = prepare(part, machine).program
    z, x = (planned.velocity[:, planned.axes.index("Z")], planned.position[:, planned.axes.index("X")])
    threads = np.abs(z + 1.5 * 600 / 60) < 0.01  # mm/s: the pitch in each turn
    assert threads.sum() * 0.001 > 5.0
    assert x.max() <= 10.0 + 1e-9  # radii of the diameters programmed


def test_steps_tell_the_words_in_force_after_each_line() -> None:
    text = (
        "G21 G90 F300\n#1=3\no1 sub\nG1 X[#1]\no1 endsub\no2 if [#1 EQ 3]\no1 call [4]\no2 else\nG0 X9\no2 endif\nM2\n"
    )
    found = list(steps(text))
    assert [step.line for step in found] == [1, 2, 3, 4, 5, 6, 7, 3, 4, 5, 8, 9, 10, 11]
    assert [step.line for step in found if step.skipped] == [4, 9]
    moved = found[8]
    assert moved.position[0] == 4.0 and moved.depth == 1 and "G1" in moved.modes.words
    assert found[1].changed == {"#1": 3.0}
    with pytest.raises(ProgramError, match="G12"):
        list(steps("G21\nG12 X1\nM2\n"))


def test_steps_tell_each_change_of_a_parameter_once() -> None:
    text = "#1=5\n#1=0\n#<_g>=1\n#<a>=2\no1 sub\n#<_g>=3\no1 endsub\no1 call [4]\n#<a>=0\nM2\n"
    found = [(step.line, dict(step.changed)) for step in steps(text, parameters={33: 2.0}) if step.changed]
    assert found == [
        *((1, {"#1": 5.0}), (2, {"#1": 0.0}), (3, {"#<_g>": 1.0}), (4, {"#<a>": 2.0})),
        *((8, {"#1": 4.0}), (6, {"#<_g>": 3.0}), (7, {"#1": 0.0}), (9, {"#<a>": 0.0})),
    ]
    seen = []
    with pytest.raises(ProgramError, match="G12"):
        for step in steps("#1=1\n#2=2\nG12 X1\nM2\n"):
            seen += [step.line]
    assert seen == [1, 2]


def test_what_holds_a_motion_back_adds_up_and_a_raised_limit_saves_a_second(tmp_path: Path) -> None:
    part = program(tmp_path, "G21 G90 G94\nG0 X60\nX-60\nX60\nX-60\nG1 X-50 F600\nM2\n")
    machine = load_machine("mini-cnc")
    blocks = list(motion(part, machine, Setup()))
    limits = Limits.of(machine)
    found, rows = explained(blocks, limits, 0.001)
    assert sum(found.seconds.values()) == pytest.approx(len(found.time) * 0.001)
    assert rows[0]["cause"] == "velocity of X"
    assert found.seconds["programmed feed"] == pytest.approx(1.0, abs=0.1)  # 10 mm at 600 mm/min
    raised = limits.velocity.copy()
    raised[0] = rows[0]["to_save_a_second"]
    faster = sum(map(len, plan(blocks, replace(limits, velocity=raised), 0.001, start=np.zeros(6))))
    assert 1.0 <= (len(found.time) - faster) * 0.001 < 1.2


def test_a_rotary_axis_alone_is_held_back_by_its_feed_or_its_limits() -> None:
    limits = Limits.from_axes({"X": (50.0, 500.0, 5000.0), "A": (90.0, 900.0, 9000.0)})
    there, back = line([0.0] * 6, [0.0] * 3 + [45.0, 0.0, 0.0], 30.0), line([0.0] * 3 + [45.0], [0.0], 1.0, rapid=True)
    found = explained([PathBlock(chain(there, back))], limits, 0.01, 1)
    assert found.limiting.seconds["programmed feed"] == pytest.approx(1.5, abs=0.1)
    assert found.limiting.seconds["at rest"] < 0.05
    assert {row["unit"] for row in found.rows if "unit" in row} <= {"degrees/s", "degrees/s²", "degrees/s³"}
    assert any("degrees/s" in said for said in found.savings())


def test_what_holds_nothing_back_is_refused() -> None:
    with pytest.raises(InputError, match="nothing in it moves"):
        explained([], Limits.of(load_machine("mini-cnc")), 0.001)
    with pytest.raises(InputError, match="nothing in it moves"):
        explained([PathBlock(chain())], Limits.of(load_machine("mini-cnc")), 0.001)


def test_a_program_that_only_dwells_has_a_certificate(tmp_path: Path) -> None:
    prepared = prepare(program(tmp_path, "G21\nG4 P1\nM2\n"), load_machine("mini-cnc"))
    assert len(certificate_picture(prepared).axes) == 4


def test_the_certificate_of_a_run_shows_what_holds_it_back(tmp_path: Path) -> None:
    """Speeds along the path and their causes above the shares of the limits; as the cycle time's picture does."""
    part = program(tmp_path, "G21 G90 G94\nG0 X25\nX-25\nM8\nG4 P0.5\nX25\nX-25\nG1 X-15 F600\nM2\n")
    machine = load_machine("mini-cnc")
    prepared = prepare(part, machine)
    figure = certificate_picture(prepared)
    top, below, *shares = figure.axes
    assert [line.get_label() for line in top.lines][1:] == ["programmed", "planned"]
    assert figure.get_suptitle().startswith("velocity of X is 13 mm/s: a second less takes ")
    assert top.lines[2].get_ydata().max() == pytest.approx(Limits.of(machine).velocity[0], rel=2e-3)
    assert {"velocity of X", "programmed feed", "at rest"} <= {text.get_text() for text in below.get_yticklabels()}
    assert [axes.get_ylabel() for axes in shares][:1] == ["velocity [% of limit]"]
    found = explained([PathBlock(prepared.path, list(prepared.events))], Limits.of(machine), prepared.T, 0)
    assert len(found.limiting.time) == prepared.program.samples
    assert found.limiting.seconds["at rest"] == pytest.approx(0.5, abs=0.02)


def test_step_and_probe_surface_on_the_command_line(tmp_path: Path) -> None:
    part = program(tmp_path, "G21 G90 G94\nG38.2 Z-10 F60\n#1 = #5063\nM2\n")
    words = ["nc", "step", str(part), "--with", "probe-surface=-3.5", "--json"]
    found = json.loads(CliRunner().invoke(app, words).stdout)["steps"]
    assert found[1]["position"][2] == pytest.approx(-3.5)
    assert found[2]["changed"]["#1"] == pytest.approx(-3.5)
    refused = CliRunner().invoke(app, ["nc", "step", str(part), "--with", "probe-surface=low"])
    assert refused.exit_code == 2 and "height in mm" in refused.output


@pytest.mark.parametrize("command", ["canon", "step"])
def test_a_reader_that_has_seen_enough_ends_the_printing_without_a_word(tmp_path: Path, command: str) -> None:
    """As `rds nc step part.ngc | head` does."""
    part = program(tmp_path, "G21 G90 G94\nM2\n")
    reads, writes = os.pipe()
    os.close(reads)
    try:
        done = subprocess.run(
            [sys.executable, "-m", "rds", "nc", command, str(part)], stdout=writes, stderr=subprocess.PIPE, text=True
        )
    finally:
        os.close(writes)
    assert (done.returncode, done.stderr) == (0, "")


def test_an_out_that_is_named_like_a_file_means_its_folder(tmp_path: Path) -> None:
    from rds.cli.common import results_folder

    assert results_folder(tmp_path / "fast.csv") == tmp_path / "fast"
    assert results_folder(tmp_path / "fast.v2") == tmp_path / "fast.v2"
    (tmp_path / "kept.csv").mkdir()
    assert results_folder(tmp_path / "kept.csv") == tmp_path / "kept.csv"
    assert results_folder(None) is None


def test_outputs_need_names_that_are_texts(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="digital"):
        machine_with(tmp_path, "", "[outputs]\ndigital = [1]\n")
