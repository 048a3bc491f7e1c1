"""What a person types in a notebook: paths as `Path`, and arguments of the wrong kind, which end in a sentence."""

from __future__ import annotations

import importlib
import os
import pickle
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import control
import numpy as np
import pandas
import pytest
from typer.testing import CliRunner

import rds
from rds.cli.common import say_what_is_replaced
from rds.cli.main import app
from rds.interpolators import Limits, arc, blended, chain, line, plan, point_to_point, trapezoid
from rds.interpolators.acceleration import make_acceleration
from rds.machines.machine import load_machine as loaded
from rds.nc import Setup
from rds.nc.language.dialect import Dialect

LAW = """params = {"Kp": 30.0}
initial_state = []


def control(t, r, y, state, params):
    return params["Kp"] * (r.position - y), state
"""
STEPS = """params = {}


def interpolate(segment, T, params):
    k = int(abs(segment.end[0] - segment.start[0]) / (segment.feed_rate * T))
    for i in range(1, k + 1):
        at = tuple(a + (b - a) * i / k for a, b in zip(segment.start, segment.end))
        rest = (0.0,) * len(at)
        yield at, rest, rest
"""


LOOP = """axis = "X"
duration = 1.0
sample_period = 0.005
[reference]
kind = "constant"
value = 0.0
[controller]
name = "pid"
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "law.py").write_text(LAW)
    (tmp_path / "steps.py").write_text(STEPS)
    (tmp_path / "part.ngc").write_text("G21 G90\nG1 X2 F600\nM2\n")
    (tmp_path / "m.toml").write_text(Path(loaded("mini-cnc").path).read_text())
    return tmp_path


def short(**more: Any) -> rds.Experiment:
    return rds.Experiment(reference=rds.sinusoid(5.0, 2.0), controller=Path("law.py"), duration=0.5, **more)


@pytest.mark.usefixtures("here")
def test_a_path_may_name_whatever_a_text_may() -> None:
    machine = Path("m.toml")
    assert rds.load_machine(machine).axes == rds.load_machine("m.toml").axes
    assert short(machine=machine).run(out=Path("a")).length == short(machine="m.toml").run(out="b").length
    assert rds.compare(rds.open_result(Path("a")), rds.open_result("b")).identical
    with pytest.raises(rds.InputError, match=r"a is no result; rds\.open_result opens"):
        rds.compare("a", "b")  # type: ignore[arg-type]
    part = rds.PartProgram(Path("part.ngc"), machine, interpolator=Path("steps.py"), controller=Path("law.py"))
    assert part.run().meta["program"]["completed"]


def test_an_imported_module_is_the_file_that_it_was_imported_from(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(here)
    module = importlib.import_module("law")
    monkeypatch.delitem(sys.modules, "law")
    plan = rds.Experiment(reference=rds.sinusoid(5.0, 2.0), controller=module, duration=0.5)
    assert rds.compare(plan.run(), short().run()).identical
    (here / "law.py").write_text(LAW.replace("control", "steer"))
    with pytest.raises(rds.InputError, match="it defines none of"):
        rds.Experiment(reference=rds.sinusoid(5.0, 2.0), controller=module).run()


def test_the_folder_of_a_result_is_read_from_inside(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    short().run(out=here / "run")
    monkeypatch.chdir(here / "run")
    assert len(rds.read_log(".")[0].time) == 500


@pytest.mark.usefixtures("here")
def test_an_interpolator_is_named_as_everywhere() -> None:
    line = rds.LineSegment((0.0, 0.0), (2.0, 0.0), 10.0)
    named = rds.interpolate([line], 1e-3, "linear")
    assert named.methods == ("linear", "linear")
    assert (named.position == rds.interpolate(line, 1e-3, rds.interpolator("linear")).position).all()
    own = rds.interpolate(line, 1e-3, Path("steps.py"))
    assert own.position[-1] == pytest.approx([2.0, 0.0])
    with pytest.raises(rds.InputError, match=r"3 is no interpolator; give a name of the library, a \.py file"):
        rds.interpolate(line, 1e-3, 3)  # type: ignore[arg-type]


@pytest.mark.usefixtures("here")
def test_one_log_is_fitted_with_a_structure_by_its_name() -> None:
    rds.Experiment(signal=rds.chirp(3.0, 0.5, 5.0, 4.0), duration=4.0).run(out="run")
    (log,) = rds.read_log("run")
    assert rds.fit(log, "axis").values() == rds.fit([log], rds.structure("axis")).values()


@pytest.mark.parametrize("read", [rds.read_model, rds.design])
def test_a_number_is_no_file_and_closes_none(read: Any) -> None:
    """Python's open takes 1 for standard output, and closes it."""
    ours, theirs = os.pipe()
    try:
        with pytest.raises(TypeError):
            read(theirs)
        os.fstat(theirs)
    finally:
        os.close(ours)
        os.close(theirs)


@pytest.mark.parametrize(
    ("do", "said"),
    [
        (lambda: rds.Experiment(durration=1.0), r"Experiment\(\) has no argument 'durration'.*mean 'duration'\?"),
        (lambda: short().run(mod="emulation"), r"Experiment.run\(\) has no argument 'mod'.*mean 'mode'\?"),
        (lambda: rds.PartProgram("a.ngc", machin="arm"), r"PartProgram\(\) has no argument .*mean 'machine'\?"),
        (lambda: rds.load_machine(nme="arm"), r"load_machine\(\) has no argument 'nme'; it has name.*mean 'name'\?"),
        (lambda: rds.sinusoid(5.0, freqency=0.2), r"sinusoid\(\) has no argument .*mean 'frequency'\?"),
    ],
)
@pytest.mark.usefixtures("here")
def test_an_unknown_argument_is_answered_with_the_near_one(do: Callable[[], Any], said: str) -> None:
    with pytest.raises(rds.InputError, match=said):
        do()


def test_a_function_of_the_face_goes_to_another_process() -> None:
    assert pickle.loads(pickle.dumps(rds.fit)) is rds.fit


@pytest.mark.parametrize("given", [(5.0, 0.2), np.ones(1000), "rows.csv", 5.0])
def test_what_is_no_reference_is_refused_with_what_is(given: Any) -> None:
    with pytest.raises(rds.InputError, match=r"reference = .* must be a signal \(rds.sinusoid") as refused:
        rds.Experiment(reference=given, controller="pid")
    assert len(str(refused.value)) < 400


@pytest.mark.usefixtures("here")
def test_a_part_program_is_read_with_a_table() -> None:
    Path("drill.ngc").write_text("G21 G90\nT4 M6\nG43\nG1 X2 F600\n/X5\nM2\n")
    Path("tools.tbl").write_text("T4 P1 D6 Z10\n")
    table = {"tools": "tools.tbl", "block_delete": True}
    part = rds.PartProgram("drill.ngc", setup=table)
    same = rds.PartProgram("drill.ngc", setup=Setup(Path("tools.tbl"), options=Dialect(block_delete=True)))
    assert (part.prepared.path == same.prepared.path).all()
    assert part.prepared.path["end"][:, 0].max() == 2.0


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"setup": {"tool": "tools.tbl"}}, "there is no 'tool'; .* did you mean 'tools'?"),
        ({"setup": {"tools": 4}}, "setup: tools = 4 must be the path of a file"),
        ({"setup": {"block_delete": 1}}, "setup: block_delete = 1 must be true or false"),
        ({"setup": {"max_jumps": 0}}, "setup: max_jumps = 0 must be a whole number of at least 1"),
        ({"setup": "tools.tbl"}, "setup = 'tools.tbl' must be a table"),
        ({"begin": "2"}, "begin = '2' must be a whole number"),
        ({"begin": -2}, "begin = -2 must be a whole number of at least 0"),
        ({"steps": 2}, "steps = 2 must be true or false"),
    ],
)
def test_what_a_part_program_is_run_with_is_checked(given: dict[str, Any], said: str) -> None:
    with pytest.raises(rds.InputError, match=said):
        rds.PartProgram("part.ngc", **given)


MOVE = line((0, 0), (20, 0), 10.0)
LIMITS = Limits.of(loaded("mini-cnc"))
ROWS = ((50, 50), (400, 400), (12000, 12000))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda: line(10.0, (0, 0), (20, 0)), "a move has a start, an end and"),
        (lambda: line((0, 0), (20, 0), 10.0, mode="G64"), "a mode that is a number, such as BLEND"),
        (lambda: line((0, 0), (20, 0), 10.0, mode=2, tolerance=-0.02), "tolerance = -0.02"),
        (lambda: line((0, 0), (20, 0), 10.0, tolerance=None), "tolerance = None"),
        (lambda: next(plan(None, LIMITS, 0.001)), "blocks = None is no path"),
        (lambda: rds.learn(None), "learn takes an Experiment, or the name of its file, and not None"),
        (lambda: arc((20, 0), (20, 5), (20, 10), 10.0), "given by start, end and centre, in this order"),
        (lambda: chain([MOVE, MOVE]), "one by one"),
        (lambda: next(plan(MOVE, LIMITS, 0.001)), r"as plan\(\[path\]"),
        (lambda: next(plan([MOVE], loaded("mini-cnc"), 0.001)), "must be Limits"),
        (lambda: next(plan([MOVE], LIMITS, "1ms")), "sample period T = '1ms'"),
        (lambda: Limits.of("mini-cnc"), "is no machine"),
        (lambda: trapezoid("10", 5, 10, 0.001), "distance = '10' must be a number"),
        (lambda: point_to_point(0, 30, *ROWS, 0.001), "start = 0 must be a list of numbers"),
        (lambda: point_to_point((0, 0), (30, 10), *ROWS, 0.001, end_velocity=40), "end_velocity = 40 must be a list"),
        (lambda: blended([(0, 0), (10,)], 5, 0.001), "points must be rows"),
        (lambda: rds.interpolate([rds.ArcSegment((1, 0), (1, 0), (0, 0), 10.0, "G3")], 0.001), "True or False"),
    ],
)
def test_what_is_no_motion_is_refused_in_a_sentence(wrong: Callable[[], Any], said: str) -> None:
    with pytest.raises(rds.InputError, match=said):
        wrong()


def test_a_part_program_is_a_file_and_no_device() -> None:
    with pytest.raises(rds.InputError, match="a table names no part program"):
        rds.PartProgram.from_table({"machine": "mini-cnc"})
    with pytest.raises(rds.InputError, match="/dev/zero: is a pipe or a device"):
        rds.PartProgram("/dev/zero")


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> tuple[rds.Log, Any]:
    folder = tmp_path_factory.mktemp("fitted")
    rds.Experiment(signal=rds.chirp(3.0, 0.5, 5.0, 2.0), duration=2.0).run(out=folder / "run")
    (log,) = rds.read_log(folder / "run")
    return log, rds.fit(log, "axis")


def test_a_law_is_designed_for_what_a_fit_found(fitted: tuple[rds.Log, Any], tmp_path: Path) -> None:
    _, estimate = fitted
    rds.write_model(tmp_path / "fitted.toml", estimate)
    assert rds.design(estimate).params == rds.design(tmp_path / "fitted.toml").params


STEP = rds.LineSegment((0.0, 0.0), (2.0, 1.0), 10.0)


@pytest.mark.usefixtures("here")
def test_a_filter_and_a_voltage_may_be_given_as_elsewhere() -> None:
    named = rds.interpolate(STEP, 1e-3, acceleration="linear")
    assert (named.position == rds.interpolate(STEP, 1e-3, acceleration=make_acceleration("linear")).position).all()

    def law(t: float, r: rds.Reference, y: float, state: Any, params: Any) -> tuple[Any, Any]:
        return pandas.Series([30.0 * (r.position - y)]), state

    plan = rds.Experiment(reference=rds.sinusoid(5.0, 2.0), controller=law, duration=0.5)
    assert rds.compare(plan.run(), short().run()).identical


def test_a_signal_that_fails_names_its_line() -> None:
    def steep(t: float) -> float:
        return 1.0 / t

    with pytest.raises(
        rds.ContractError, match=r"fails at t = 0 s: test_python_arguments.py, line \d+, in steep: Zero"
    ):
        rds.Experiment(reference=steep, controller="pid", duration=0.1).run()


class Framed:
    """As a table of pandas, which has axes, too."""

    axes = ()


def test_points_of_arrays_and_lists_are_points() -> None:
    there, back = np.array([0.0, 0.0]), np.array([3.0, 4.0])
    path = rds.interpolate([rds.LineSegment(there, back, 5.0), rds.LineSegment(back, [0.0, 0.0], 5.0)], 1e-3)
    assert np.abs(path.position).max(axis=0) == pytest.approx([3.0, 4.0], abs=0.01)
    circle = rds.interpolate(rds.ArcSegment([1.0, 0.0], np.array([1.0, 0.0]), (0.0, 0.0), 5.0), 1e-3)
    assert len(circle.position) == pytest.approx(2.0 * np.pi / 5.0 * 1000, abs=3)


def test_what_is_not_what_it_should_be_is_named(fitted: tuple[rds.Log, Any]) -> None:
    log, estimate = fitted
    for said, do in {
        "'run' is no log; rds.read_log": lambda: rds.validate(estimate, "run"),
        "'run.csv' is no log": lambda: rds.fit("run.csv", "axis"),
        r"a list is no file; save it, .*to_parquet\('log.parquet'\)": lambda: rds.read_log([[0.0, 1.0]]),
        "3 is no log": lambda: rds.frequency_response(3),
        "2 logs are given, and one is wanted": lambda: rds.compare_models([estimate, estimate], [log, log]),
        "Framed'> is no result; rds.open_result": lambda: rds.compare(Framed, Framed),
        "None is no result; rds.open_result": lambda: rds.open_result(log.source).compare(None),  # type: ignore
        "<Log run: .* is no result; rds.open_result": lambda: rds.compare(log, log),
        "poles = -30 must be a list": lambda: rds.design(estimate, poles=-30),
        "<Result: .* is no log; rds.read_log": lambda: rds.fit(rds.open_result(log.source), "axis"),
        r"options = \['viscous'\] must be a dict": lambda: rds.fit(log, "axis", options=["viscous"]),  # type: ignore
        "a TransferFunction of python-control is no fitted axis": lambda: rds.design(control.tf([1.0], [1.0, 0.0])),
        r"control\(t, r, y\) cannot be called as control\(t, r, y, state, params\)": lambda: rds.Experiment(
            reference=rds.constant(1.0), controller=lambda t, r, y: (r.position - y, ())
        ).run(),
        "dict: it defines none of control": lambda: rds.Experiment(reference=rds.constant(1.0), controller=dict).run(),
        r"interpolate\(\) returned None, and no rows": lambda: rds.interpolate(STEP, 1e-3, lambda s, T, p: None),
        "there is no model 'linear_axis'; .*did you mean 'linear-axis'": lambda: rds.library_model("linear_axis"),
        "is no structure; give its name": lambda: rds.fit(log, 3),
        "structure axis has no option 'viscus'": lambda: rds.structure("axis", "viscus"),
        "'part.ngc' is no LineSegment": lambda: rds.interpolate("part.ngc", 1e-3),
        "must be numbers: 'int' object is not iterable": lambda: rds.interpolate(rds.LineSegment(0, 1, 5.0), 1e-3),
        "must be numbers: must be real number, not str": lambda: rds.interpolate(
            rds.LineSegment((0,), (1,), "5"), 1e-3
        ),
        "period = nan s": lambda: rds.frequency_response(log, period=float("nan")),
        "is what a fit found, and a run wants a file; rds.write_model": lambda: rds.Experiment(model=estimate),
        "there is no machine 'xxx": lambda: rds.verdict("x" * 5000),
    }.items():
        with pytest.raises(rds.InputError, match=said):
            do()
    assert rds.verdict("xyzac").ok
    assert rds.structure("axis", "viscous").options == ("viscous",)


@pytest.mark.parametrize(
    ("command", "name", "theirs"),
    [
        ("fit run --structure axis -o", "x.toml", 'axis = "X"\n'),
        ("design tracking fitted.toml --out", "law.py", LAW),
        ("design lqg loop.toml --delay 0.004 --out", "loop.toml", LOOP),
        ("machine from fitted.toml --axis X --out", "m.toml", "[axis.X]\nnode = 2\n"),
        ("excite mini-cnc -o", "test.toml", 'axis = "X"\n'),
        ("nc make line --start 0,0 --end 2,1 -f 100 -o", "part.ngc", "G21 G90\nM2\n"),
    ],
)
def test_a_command_takes_the_place_of_its_own_file_only(
    command: str, name: str, theirs: str, fitted: tuple[rds.Log, Any], here: Path
) -> None:
    log, estimate = fitted
    rds.write_model("fitted.toml", estimate)
    (here / "loop.toml").write_text(LOOP)
    shutil.copytree(log.source, "run")
    words = [*command.split(), name]
    (here / name).write_text(theirs)
    refused = CliRunner().invoke(app, words)
    assert refused.exit_code == 2 and f"{name}: is there already, and is no" in refused.stderr
    assert (here / name).read_text() == theirs
    if "loop.toml" in words[:-1]:
        words[-1] = "other.toml"
    (here / words[-1]).unlink(missing_ok=True)
    for _ in range(2):
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 0, done.output


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("report accuracy nope.csv", "nope.csv: there is no such file; check the name of the file"),
        ("report accuracy .", ".: is a folder; check the name of the file"),
        ("forces mini-cnc part.ngc", "the cut (options such as --depth 1.0, or a file by --cut): depth is missing"),
        ("jobs send {} --socket jobs.sock", "jobs.sock; start one by `rds jobs serve FOLDER` in another terminal"),
    ],
)
@pytest.mark.usefixtures("here")
def test_what_a_command_lacks_is_named(command: str, said: str) -> None:
    refused = CliRunner().invoke(app, command.split())
    assert refused.exit_code == 2 and said in refused.stderr, refused.output


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("result.csv", "time,position\n0,0\n"),
        ("result.csv", "time [s],voltage [V],position [mm]\n0,0,0\n"),
        ("result.mat", "MATLAB 5.0 MAT-file"),
        ("result.json", "{}"),
    ],
)
def test_a_table_of_somebody_else_s_is_not_replaced_by_a_run_s(
    here: Path, capsys: pytest.CaptureFixture[str], name: str, text: str
) -> None:
    (here / "mine").mkdir()
    (here / "mine" / name).write_text(text)
    with pytest.raises(rds.InputError, match=rf"mine/{name}: is there already, and is no result of a run; name anothe"):
        short().run(out="mine")
    assert (here / "mine" / name).read_text() == text
    say_what_is_replaced(Path("mine"))
    assert not capsys.readouterr().err  # nothing is


@pytest.mark.parametrize("left", ["result.csv", "result.json"])
def test_what_is_left_of_a_run_is_replaced_by_the_next(here: Path, left: str) -> None:
    short().run(out="ours")
    for path in (here / "ours").glob("result.*"):
        if path.name != left:
            path.unlink()
    assert short().run(out="ours").length == 0.5
