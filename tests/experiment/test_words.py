"""Experiment files: whatever is wrong is refused with the file, the line, the key, the value and a remedy."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis.strategies import (
    booleans,
    characters,
    dictionaries,
    fixed_dictionaries,
    floats,
    integers,
    just,
    lists,
    none,
    one_of,
    recursive,
    sampled_from,
    text,
)

import rds
from rds.core.errors import RdsError
from rds.core.toml_table import TomlTable
from rds.modes.experiment.experiment_file import EXPERIMENT
from rds.modes.experiment.resolve import resolve
from rds.modes.loop.plan import Plan

GOOD = """\
machine = "mini-cnc"
axis = "X"
mode = "simulation"
duration = 1.0
sample_period = 0.001

[reference]
kind = "sinusoid"
amplitude = 5.0
frequency = 0.2

[controller]
name = "tracking"
gains = [1600.0, -36.6]
"""
SIGNAL = """\
axis = "X"
mode = "system-test"
duration = 1.0
[signal]
kind = "square"
amplitude = 5.0
frequency = 2.0
"""


def edit(change: str, base: str = GOOD) -> str:
    """The good file with `key = value` lines replaced ("-key" removes one).

    A new key goes to the end of the top table, and a table, with what follows it, to the end of the file.
    """
    file = base
    change, table, tables = change.partition("[") if "\n[" in change or change.startswith("[") else (change, "", "")
    for line in change.splitlines():
        key = line.lstrip("-").split("=")[0].strip()
        pattern = re.compile(rf"^{re.escape(key)} = .*\n", re.MULTILINE)
        if pattern.search(file):
            file = pattern.sub("" if line.startswith("-") else line + "\n", file, count=1)
        else:
            file = file.replace("\n\n[reference]", f"\n{line}\n\n[reference]")
    return file + table + tables + "\n"


@pytest.mark.parametrize(
    ("change", "line", "said"),
    [
        ("duratoin = 2.0", 6, "unknown key 'duratoin'; known keys: .*did you mean 'duration'"),
        ("[referenc]", 15, "unknown key 'referenc'; .*did you mean 'reference'"),
        ("[timing]\nlimit = 3", 16, "unknown key 'limit' in .timing.; known keys: .*late_limit.*did you mean"),
        ("[timing]\nlate = 'drop'", 16, "timing.late = 'drop' is unknown; known: process, discard"),
        ("[timing]\nstop_after = -1", 16, "must be a whole number from 0"),
        ("[timing]\npriority = 100", 16, "priority = 100 must be a whole number from 1 to 99"),
        ("[timing]\ncpu = 1.5", 16, "cpu = 1.5 must be a whole number"),
        ("[timing]\ncpu = 4095", 16, "cpu = 4095 is not a processor that this program may use; it may use .0"),
        ("[bus]\nchanel = 'a'", 16, "unknown key 'chanel' in .bus.; known keys: .*; did you mean 'channel'"),
        ("[bus]\ninterface = 'socketcam'", 16, "'socketcam' is unknown; known: .*socketcan"),
        ("[bus]\nchannel = 1.5", 16, "channel = 1.5 must be the name or the number"),
        ("[interface]\nquantisation = false", 16, "unknown key 'quantisation'.*did you mean 'quantization'"),
        ("[interface]\nsaturation = 'no'", 16, "saturation = 'no' must be true or false"),
        ("machine = 'mini-cnk'", 1, "there is no machine 'mini-cnk'; known machines: .*mini-cnc"),
        ("machine = 3", 1, "machine = 3 must be a text in quotes"),
        ("axis = 'W'", 2, "axis = 'W' names 'W', which machine 'mini-cnc' does not have; it has X, Y, Z, spindle"),
        ("axis = 3", 2, "axis = 3 must be the name of an axis in quotes"),
        ("-axis", None, 'axis is missing; as in `axis = "X"`'),
        ("mode = 'simulate'", 3, "mode = 'simulate' is unknown; known: simulation, .*did you mean 'simulation'"),
        ("mode = 1", 3, "mode = 1 is unknown"),
        ("mode = 'system-test'", 3, r"sends a voltage signal: give \[signal\]"),
        ("duration = 'long'", 4, "duration = 'long' must be a number in s, without quotes"),
        ("duration = true", 4, "duration = True must be a number"),
        ("duration = nan", 4, "duration = nan must be a finite number in s"),
        ("duration = inf", 4, "duration = inf must be from 0 to 1e.09 s"),
        ("duration = -1.0", 4, "duration = -1.0 must be from 0"),
        ("duration = 1" + "0" * 400, 4, "duration = 1000"),
        ("duration = 1e8", 4, "makes 100000000000 samples of 0.001 s; it takes at most"),
        ("duration = 0.0005", 4, "duration = 0.0005 s must be at least one sample period, 0.001 s"),
        ("duration = 0", 4, "at least one sample period"),
        ("-duration", None, "duration is missing; give it in s"),
        ("sample_period = 0", 5, "sample_period = 0 must be from 1e-06 to 1000 s"),
        ("sample_period = 1e-300", 5, "must be from 1e-06"),
        ("sample_period = '1 ms'", 5, "sample_period = '1 ms' must be a number in s"),
        ("kind = 'sine'", 8, "reference.kind = 'sine' is unknown; known: square, .*did you mean 'sinusoid'"),
        ("kind = ['sine']", 8, "reference.kind = .'sine'. is unknown"),
        ("-kind", 7, 'kind is missing; as in `kind = "sinusoid"`'),
        ("amplitude = 'large'", 9, "amplitude = 'large' must be a number"),
        ("amplitude = nan", 9, "amplitude = nan must be a finite number"),
        (
            "amplitude = 80.0",
            7,
            "goes from 0 to 76.05.*but axis X travels from -75 to 75 mm; bring the reference into that range",
        ),
        ("-amplitude", 7, "needs amplitude"),
        ("frequency = 600.0", 10, "frequency = 600 Hz is above half the sampling frequency .500 Hz"),
        ("frequency = -1.0", 10, "frequency = -1.0 must be more than 0"),
        ("name = 'traking'", 13, "controller.name = 'traking' is unknown; known: p, pid, .*did you mean 'tracking'"),
        ("name = 'Tracking'", 13, "controller.name = 'Tracking' is unknown; .*did you mean 'tracking'"),
        ("name = 'law.py'", 13, "controller.name = 'law.py' is a file, .*write `file = 'law.py'`"),
        ("name = 3", 13, "controller.name = 3 is unknown"),
        ("-name", 12, r"controller needs `name` \(p, pid, modified-pid, tracking, feedforward, .*\) or `file`"),
        ("gains = [1.0]", 14, "gains = .1.0. must be .g1, g2."),
        ("[model]\nname = 'linear'", 16, "model.name = 'linear' is unknown; known: linear-axis, spindle, machine-axis"),
        (
            "[model]\ntau = 0.1",
            15,
            "model needs `name` .linear-axis, spindle, .*directional-axis,.* or `file`",
        ),
        ("[model]\nname = 'linear-axis'\ntau = -1.0", 17, "tau = -1.0 must be more than 0"),
        ("[model]\nname = 'linear-axis'\nmass = 1.0", 17, "has no option 'mass'; it has tau, K"),
        ("[model]\nfile = 'gone.py'", 16, "model.file = 'gone.py' will not do: there is no such file as .*gone.py"),
        ("axes = ['X', 'Y']", 2, "axis and axes both say which axes run; give one of them"),
        ("[signal]\nkind = 'square'", 15, "drives the axes without a controller; give either"),
        ("compiled = 'yes'", 6, "compiled = 'yes' must be true or false"),
    ],
)
def test_what_is_wrong_is_named(alone: Path, change: str, line: int | None, said: str) -> None:
    refused(alone, edit(change), line, said)


@pytest.mark.parametrize(
    ("file", "line", "said"),
    [
        (GOOD.replace("frequency", "freqency"), 10, "has no option 'freqency'; .*did you mean 'frequency'"),
        (GOOD.replace("[reference]", "[refrence]"), None, r"no \[reference\]; .*is 'refrence' meant to be it"),
        (GOOD + "[axis.X.controller]\nname = 'p'\n", None, r"beside \[axis.NAME\] tables, `axes = \[...\]` takes"),
        (GOOD.replace("[controller]", "[controler]"), None, "is missing; .*is 'controler' meant to be it"),
        (GOOD.replace("gains", "gians"), 14, "has no option 'gians'; .*did you mean 'gains'"),
        (GOOD.replace("gains", "file"), 13, "name and file both say what to take; give one of them"),
        (edit("axis = ['X']"), 2, "must be the name of an axis"),
        (edit("-axis\n").replace("duration", "axes = ['X', 'Q']\nduration"), 3, "axes = .* names 'Q'"),
        (edit("-axis\n").replace("duration", "axes = ['X', 'X']\nduration"), 3, "names an axis twice"),
        (edit("-axis\n").replace("duration", "axes = []\nduration"), 3, "must be a list of axis names"),
        (edit("-axis\n").replace("duration", "axes = 'X'\nduration"), 3, "must be a list of axis names"),
        (
            edit("-axis\n").replace("duration", "axes = ['X']\nduration") + "[axis.Y.controller]\nname = 'p'\n",
            16,
            r"\[axis.Y\] is for an axis that does not run; axes = \['X'\]",
        ),
        (
            edit("-axis\n").replace("duration", "axes = ['X', 'Y']\nduration") + "[axis.Y.controler]\nname = 'p'\n",
            16,
            "unknown key 'controler' in .axis.Y.; known keys: controller, error_compensation, following_error, model, "
            "reference, signal; did you mean",
        ),
        (
            edit("-axis\n").replace("duration", "axes = ['X', 'Y']\nduration") + "[axis.Y.controller]\nname = 'pd'\n",
            17,
            "axis.Y.controller.name = 'pd' is unknown",
        ),
        (
            # the general table's own line, though axis Y found it
            edit("-axis\nfrequency = 'x'").replace("duration", "axes = ['X', 'Y']\nduration")
            + "[axis.X.reference]\nkind = 'constant'\nvalue = 1.0\n",
            10,
            "frequency = 'x' must be a number",
        ),
        (GOOD[: GOOD.index("[controller]")], None, "controller of axis X is missing; add `.controller.` with `name`"),
        (
            GOOD[: GOOD.index("[reference]")] + GOOD[GOOD.index("[controller]") :],
            None,
            r"axis X has no \[reference\]; as in",
        ),
        ("reference = 3\n" + edit("").replace("[reference]\nkind", "[ref]\nkind"), 1, "must be a table"),
        (edit("mode = 'implementation'", SIGNAL), 4, "needs .reference. and .controller., not .signal."),
        ("duration = 1.0\n[axis\n", None, "is not valid TOML"),
        ("axis = 'X'\naxis = 'Y'\n", None, "is not valid TOML"),
        ("", None, "duration is missing"),
    ],
)
def test_whole_files_that_will_not_do(alone: Path, file: str, line: int | None, said: str) -> None:
    refused(alone, file, line, said)


def test_a_key_below_the_tables_is_told_where_it_belongs(alone: Path) -> None:
    late = edit("-duration") + "duration = 1.0\n"
    refused(alone, late, None, r"line 15 belongs to \[controller\]: move it above the first \[table\]")
    title = edit("-name\n-gains") + "file = 'law.py'\ntitle = 'mine'\n"
    (alone / "law.py").write_text("def control(t, r, y, state, params):\n    return 0.0, ()\n")
    refused(alone, title, 15, r"if the file's own 'title' is meant, move it above the first \[table\]")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("params = { gain = 3.0 }", "law.py: unknown parameter 'gain'; known parameters: Gain; did you mean 'Gain'"),
        ("params = { Gain = '3' }", "law.py: parameter Gain = '3' must be a number, without quotes, as .* own 2.0 is"),
        ("Gain = 3.0", r"unknown key 'Gain' in \[controller\]; it is one of the file's own params: write `params = "),
    ],
)
def test_a_parameter_of_a_file_is_refused_where_it_is_given(alone: Path, words: str, said: str) -> None:
    (alone / "law.py").write_text("params = {'Gain': 2.0}\ndef control(t, r, y, state, params):\n    return 0.0, ()\n")
    refused(alone, edit("-name\n-gains") + f"file = 'law.py'\n{words}\n", 15, said)


def refused(folder: Path, file: str, line: int | None, said: str) -> None:
    path = folder / "experiment.toml"
    path.write_text(file)
    with pytest.raises(rds.InputError, match=said) as refusal:
        rds.Experiment.from_toml(path).run(out=folder / "out")
    message = str(refusal.value)
    assert line is None or f"experiment.toml, line {line}:" in message, message
    assert "experiment.toml" in message or "law.py" in message or "gone.py" in message, message
    assert not (folder / "out").exists()


def test_files_that_cannot_be_read(alone: Path) -> None:
    with pytest.raises(rds.InputError, match=r"gone.toml: cannot be read: .*check the path"):
        rds.Experiment.from_toml(alone / "gone.toml")
    with pytest.raises(rds.InputError, match="it is a folder; name the TOML file"):
        rds.Experiment.from_toml(alone)
    (alone / "latin.toml").write_bytes(b'title = "\xe4"\n')
    with pytest.raises(rds.InputError, match="is not UTF-8 text"):
        rds.Experiment.from_toml(alone / "latin.toml")


@pytest.mark.parametrize(
    ("code", "said"),
    [
        (None, "controller.file = 'law.py' will not do: there is no such file as .*law.py"),
        ("def control(t, r, y, state, params:\n", r"law.py:1: syntax error"),
        ("def control(t, r, y):\n    return 0.0, ()\n", r"law.py:1: control\(t, r, y\) cannot be called as"),
        ("x = 1\n", "law.py: it defines none of control"),
        ("def advance(x, u, T, params):\n    return x\n", "no controller: it defines no control"),
        ("\n1 / 0\n", r"law.py:2: it fails while it loads: .*ZeroDivisionError"),
        ("get_ipython()\n", r"law.py:1: .*a notebook that was saved as Python has such lines: remove them"),
        (
            '{"cells": [], "nbformat": 4, "x": null}\n',
            "law.py: it is a notebook with the ending .py; name it .ipynb",
        ),
        ("raise PermissionError\n", r"law.py:1: .*where files are graded there is no network, which asyncio.run\(\)"),
        ("params = {'a': 1}\ndef control(t, r, y, state, params):\n    return 0.0, ()\n", "unknown parameter 'gain'"),
    ],
)
def test_student_files_that_will_not_do(alone: Path, code: str | None, said: str) -> None:
    if code is not None:
        (alone / "law.py").write_text(code)
    file = edit("-name\n-gains") + "file = 'law.py'\nparams = { gain = 3.0 }\n"
    refused(alone, file, None, said)


@pytest.mark.parametrize("key", ["saturation", "quantization"])
@pytest.mark.parametrize("mode", ["implementation", "system-test", "model-validation"])
def test_a_real_converter_is_not_switched_off(alone: Path, mode: str, key: str) -> None:
    base = GOOD if mode == "implementation" else SIGNAL
    file = edit(f"mode = '{mode}'", base) + f"[interface]\n{key} = false\n"
    line = file.splitlines().index(f"{key} = false") + 1
    refused(alone, file, line, f"interface.{key} = False cannot be in mode {mode}: the machine has its own converter")
    (alone / "experiment.toml").write_text(file.replace(mode, "simulation"))
    experiment = rds.Experiment.from_toml(alone / "experiment.toml")
    experiment.run()
    with pytest.raises(rds.InputError, match="has its own converter"):
        experiment.plan(mode)


def test_the_mode_of_a_run_is_checked_like_the_file_s(alone: Path) -> None:
    (alone / "experiment.toml").write_text(GOOD)
    experiment = rds.Experiment.from_toml(alone / "experiment.toml")
    with pytest.raises(rds.InputError, match="unknown mode 'emulated'; known modes: simulation, emulation"):
        experiment.run("emulated")
    with pytest.raises(rds.InputError, match="sends a voltage signal"):
        experiment.run("model-validation")


def test_a_coupled_controller_is_given_once(alone: Path) -> None:
    code = "import numpy as np\ndef control(t, r, y, state, params):\n    return r.position - y, state\n"
    (alone / "law.py").write_text(code)
    general = edit("-axis\n-name\n-gains").replace("duration", "axes = ['X', 'Y']\nduration")
    general += "file = 'law.py'\ncoupled = true\n"
    (alone / "experiment.toml").write_text(general)
    result = rds.Experiment.from_toml(alone / "experiment.toml").run()
    assert result.axes == ["X", "Y"]
    refused(alone, general + "[axis.Y.controller]\nname = 'p'\n", 12, "a coupled controller drives all axes")


def test_files_are_looked_for_from_the_experiment_s_folder(
    alone: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    (alone / "law.py").write_text("def control(t, r, y, state, params):\n    return 1.0, ()\n")
    (alone / "path.csv").write_text("time,value\n0,0\n1,1\n")
    file = edit("-name\n-gains\nkind = 'user'\n-amplitude\n-frequency").replace("'user'", "'user'\nfile = 'path.csv'")
    (alone / "experiment.toml").write_text(file + "file = 'law.py'\n")
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    result = rds.Experiment.from_toml(alone / "experiment.toml").run()
    assert (result["X_command"] == 1.0).all()
    assert result["X_reference"][500] == pytest.approx(0.5)


def test_what_would_do_nothing_is_refused(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (alone / "m.py").write_text("def advance(x, u, T, params):\n    return [x[0] + T * u[0], u[0]]\n")
    good: dict[str, Any] = {"reference": rds.sinusoid(5.0, 0.2), "controller": "p"}
    with pytest.raises(rds.InputError, match=r"model.substeps = 20 is for derivatives\(\)"):
        rds.Experiment(model={"file": "m.py", "substeps": 20}, **good)
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    with pytest.raises(
        rds.InputError, match=r"timing\.cpu = 0 cannot be chosen on this system, only on Linux; remove it"
    ):
        rds.Experiment(timing={"cpu": 0}, **good)


def test_overrides_are_one_axis_s_own(alone: Path) -> None:
    general = edit("-axis\n").replace("duration", "axes = ['X', 'Y', 'Z']\nduration")
    file = general + "[axis.Y.reference]\nkind = 'constant'\nvalue = 1.0\n[axis.Z.controller]\nname = 'p'\n"
    (alone / "experiment.toml").write_text(file)
    experiment = rds.Experiment.from_toml(alone / "experiment.toml")
    for _ in range(2):  # resolving changes nothing
        result = experiment.run()
        assert (result["Y_reference"] == 1.0).all()
        assert (result["X_reference"] == result["Z_reference"]).all()
        names = {axis: result.meta["controller"][axis]["name"] for axis in "XYZ"}
        assert names == {"X": "tracking", "Y": "tracking", "Z": "p"}
        assert result.meta["period"] == {"X": 5.0, "Y": None, "Z": 5.0}


def test_the_same_in_python() -> None:
    refusals: list[tuple[dict[str, Any], str]] = [
        ({"axis": "W"}, "machine 'mini-cnc' does not have"),
        ({"axis": 3}, "must be"),
        ({"axis": ["X", 3]}, "must be a list of axis names"),
        ({"mode": "test"}, "mode = 'test' is unknown"),
        ({"duration": "1"}, "must be a number in s"),
        ({"controller": None}, "controller of axis X is missing"),
        ({"controller": 3}, "controller = 3 must be a name"),
        ({"controller": lambda t: 0.0}, "cannot be called as control.t, r, y, state, params."),
        ({"controller": "tracking.py"}, "there is no such file as .*tracking.py"),
        ({"reference": 3}, "reference = 3 must be a signal"),
        ({"reference": None}, r"has no \[reference\]"),
        ({"reference": rds.sinusoid(1.0, 600.0)}, "above half the sampling frequency"),
        ({"model": 3}, "model = 3 must be a name"),
        ({"timing": {"phase": "free"}}, "timing.phase = 'free' is unknown; known: keep, ignore"),
        ({"timing": 3}, "timing = 3 must be a table"),
        ({"bus": {"baud": 500}}, "unknown key 'baud' in .bus."),
        ({"interface": {"saturation": 0}}, "must be true or false"),
        ({"overrides": {"Y": {}}}, r"\[axis.Y\] is for an axis that does not run"),
        ({"signal": rds.square(1.0, 1.0)}, "give either"),
        ({"title": 3}, "title = 3 must be a text"),
    ]
    good = {"reference": rds.sinusoid(1.0, 1.0), "controller": "p", "duration": 0.1}
    rds.Experiment(**good)
    for bad, said in refusals:
        with pytest.raises(rds.InputError, match=said):
            rds.Experiment(**(good | bad))


# --- junk ---------------------------------------------------------------------------------------------------------

KEYS = sampled_from(
    [
        *("title", "machine", "axis", "axes", "mode", "duration", "sample_period", "reference", "signal", "controller"),
        *("model", "interface", "timing", "bus", "compiled", "name", "file", "kind", "amplitude", "frequency", "gains"),
        *("poles", "params", "late", "phase", "stop_after", "cpu", "channel", "saturation", "X", "Y", "Q"),
    ]
)
VALUES = one_of(
    none(),
    booleans(),
    integers(-(10**400), 10**400),
    integers(-3, 3),
    floats(),
    text(characters(codec="utf-8"), max_size=5),
    sampled_from(["X", "Y", "simulation", "emulation", "p", "sinusoid", "square", "mini-cnc", "linear-axis", "rds"]),
)
JUNK = recursive(VALUES, lambda inner: one_of(lists(inner, max_size=3), dictionaries(KEYS, inner, max_size=4)))
PART = one_of(JUNK, fixed_dictionaries({"name": sampled_from(["p", "pid", "linear-axis"])}, optional={"gains": JUNK}))
PLAUSIBLE = fixed_dictionaries(
    {"axis": one_of(just("X"), JUNK), "duration": one_of(just(0.01), JUNK)},
    optional={
        "reference": one_of(just({"kind": "constant", "value": 0.0}), JUNK),
        "controller": PART,
        "model": PART,
        "axes": one_of(just(["X", "Y"]), JUNK),
        "sample_period": one_of(just(0.001), JUNK),
        **dict.fromkeys(["mode", "machine", "signal", "timing", "interface", "bus", "title", "compiled"], JUNK),
    },
)


@settings(max_examples=150, deadline=None)
@given(table=one_of(dictionaries(KEYS, JUNK), PLAUSIBLE))
def test_junk_is_refused_or_planned_and_nothing_else(table: dict[str, Any]) -> None:
    table = _without_none(table)
    if isinstance(table.get("duration"), int | float) and table["duration"] == table["duration"]:
        table["duration"] = min(table["duration"], 1.0)  # a plan of some minutes is fine, but takes as long to make
    try:
        plan, _ = resolve(TomlTable(table, EXPERIMENT), Path("nowhere"))
    except RdsError as error:
        assert len(str(error)) < 2000
    else:
        assert isinstance(plan, Plan)


@settings(max_examples=100, deadline=None)
@given(noise=text(characters(codec="utf-8"), max_size=40), at=integers(0, len(GOOD)))
def test_noise_in_a_file_is_refused_or_planned(tmp_path_factory: Any, noise: str, at: int) -> None:
    path = tmp_path_factory.mktemp("noise") / "experiment.toml"
    path.write_text(GOOD[:at] + noise + GOOD[at:], encoding="utf-8")
    try:
        rds.Experiment.from_toml(path)
    except RdsError as error:
        assert str(path) in str(error)


def _without_none(value: Any) -> Any:
    """TOML knows no null."""
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return [_without_none(item) for item in value if item is not None] if isinstance(value, list) else value
