"""Model files: written and read back to the bit, and refused with place and remedy where something is wrong."""

from __future__ import annotations

import hashlib
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import floats, lists, text

from rds.core.errors import InputError
from rds.core.toml_text import toml_text
from rds.identification.fit.estimate import Errors, Estimate, Parameter
from rds.identification.fit.model_file import ModelFile, read_model, write_model

LOG = {"name": 'X "first"', "source": "log.csv", "sha256": "ab" * 32, "first": 0, "end": 5000, "command": (-4.0, 4.0)}


def estimate(values: tuple[float, ...] = (0.01, 1.7, 0.5, -0.2), structure: str = "axis") -> Estimate:
    names, units = ("tau", "K", "friction_plus", "friction_minus"), ("s", "(mm/s)/V", "mm/s", "mm/s")
    errors = Errors(98.5, 0.0123, 0.05, "mm")
    return Estimate(
        structure=structure,
        options=(),
        method="simulation",
        parameters={
            name: Parameter(value, 0.001, value - 0.002, value + 0.002, unit)
            for name, value, unit in zip(names, values, units, strict=True)
        },
        covariance=np.diag([1e-6] * 4) + 1e-8,
        unidentifiable=("friction_plus and friction_minus: no reversal",),
        initial_state={LOG["name"]: (0.0, 1.25)},
        free_run={LOG["name"]: errors},
        ahead={LOG["name"]: {1: errors, 10: errors}},
        logs=(LOG,),
        warnings=('a "quoted" warning\nof two lines',),
    )


def test_what_was_written_is_read_back(tmp_path: Path) -> None:
    given = estimate()
    read = read_model(write_model(tmp_path / "x.toml", given))
    assert (read.structure, read.options, read.method) == ("axis", (), "simulation")
    assert read.parameters == given.parameters
    assert np.array_equal(read.covariance, given.covariance)
    assert (read.warnings, read.unidentifiable) == (given.warnings, given.unidentifiable)
    assert read.logs[0]["ahead"] == given.ahead[LOG["name"]]
    assert read.logs[0]["free_run"] == given.free_run[LOG["name"]]
    assert read.logs[0]["initial_state"] == (0.0, 1.25) and read.logs[0]["command"] == (-4.0, 4.0)
    assert read.fitted_on() == ("ab" * 32,)
    assert read.sha256 == hashlib.sha256((tmp_path / "x.toml").read_bytes()).hexdigest()


@given(values=lists(floats(allow_nan=False, allow_infinity=False, width=64), min_size=4, max_size=4))
def test_numbers_come_back_to_the_bit(values: list[float], tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("bits") / "x.toml"
    wide = {n: Parameter(v, inf, -inf, inf, "s") for n, v in zip("abcd", values, strict=True)}
    made = Estimate("axis", (), "step", wide, np.full((4, 4), nan), (), {}, {}, {}, ())
    assert [p.value for p in read_model(write_model(path, made)).parameters.values()] == values


@given(word=text())
def test_any_text_is_written_as_toml_that_reads_back(word: str) -> None:
    import tomllib

    clean = "".join("\N{REPLACEMENT CHARACTER}" if "\ud800" <= c <= "\udfff" else c for c in word)
    assert tomllib.loads(toml_text({"a": word, "t": {clean: [word]}})) == {"a": clean, "t": {clean: [clean]}}


def test_a_student_s_structure_is_named_from_the_file_s_folder(tmp_path: Path) -> None:
    (tmp_path / "models").mkdir()
    own = tmp_path / "my_axis.py"
    own.write_text("def derivatives(t, x, u, params): return [x[1], u[0]]\n")
    path = write_model(tmp_path / "models" / "x.toml", estimate(structure=str(own)))
    assert 'structure = "../my_axis.py"' in path.read_text()
    read = read_model(path)
    assert read.structure == str(own) and read.is_student
    assert read.structure_sha256 == hashlib.sha256(own.read_bytes()).hexdigest()


def test_a_file_by_hand_needs_structure_values_and_units_only(tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    path.write_text('structure = "spindle"\n[parameters]\ntau = {value = 0.08, unit = "s"}\n')
    read = read_model(path)
    assert read.values() == {"tau": 0.08} and np.isnan(read.covariance).all() and read.units() == {"tau": "s"}


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('method = "simulation"', 'methode = "simulation"', "did you mean 'method'"),
        ('structure = "axis"', "structure = 3", "must be a text"),
        (
            "value = 0.01\n",
            'value = "0.01"\n',
            "line 12: parameters.tau.value = '0.01' must be a number, without quotes",
        ),
        ("value = 0.01\n", "value = nan\n", "must be a finite number"),
        ("value = 0.01\n", "value = 0.5\n", "must be an interval around"),
        ("std_error = 0.001", "std_error = -0.001", "must not be negative"),
        ('unit = "s"\n', "", "unit is missing"),
        ('order = ["tau", "K"', 'order = ["K", "tau"', "must be that of [parameters]"),
        ("rows = [", "rows = [[1.0],", "must be rows of numbers"),
        ("format = 1", "format = 2", "of model files that this version reads"),
        ("first = 0", "first = -1", "must be a whole number"),
        ("first = 0", "frist = 0", "unknown key 'frist' in [logs]"),
        ("command = [-4.0, 4.0]", "command = [-4.0]", "must be a list of 2 numbers"),
    ],
)
def test_what_is_wrong_is_named_with_its_place(tmp_path: Path, old: str, new: str, said: str) -> None:
    path = write_model(tmp_path / "x.toml", estimate())
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        read_model(path)
    assert said in str(caught.value) and "x.toml" in str(caught.value)


def test_other_files_are_no_model_files(tmp_path: Path) -> None:
    (tmp_path / "e.toml").write_text('axis = "X"\n')
    with pytest.raises(InputError, match="no model file"):
        read_model(tmp_path / "e.toml")
    with pytest.raises(InputError, match="cannot be read"):
        read_model(tmp_path / "none.toml")
    with pytest.raises(InputError, match=r"ends in \.toml"):
        write_model(tmp_path / "x.csv", estimate())
    assert isinstance(read_model(write_model(tmp_path / "ok.toml", estimate())), ModelFile)
