"""Rows written many at a time are the text that Python writes, character for character."""

from __future__ import annotations

import math
from contextlib import suppress
from random import Random

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rds.nc import ProgramError
from rds.nc.language import canon, canon_text
from rds.nc.language.fast_lane import kernel
from rds.nc.language.interpreter import Interpreter

from .random_programs import plain_program

pytest.importorskip("numba", reason="without numba (extra fast) rows are written by Python")

halves = st.tuples(st.integers(-(10**9), 10**9), st.integers(0, 5)).map(lambda pair: pair[0] * 0.5 ** pair[1])  # ties
near = st.tuples(halves, st.integers(-3, 3)).map(lambda pair: pair[0] + pair[1] * math.ulp(pair[0]))
decimals = st.integers(-(10**15), 10**15).map(lambda whole: whole / 100_000)  # nearly ties
values = st.one_of(halves, near, decimals, st.floats(-1e12, 1e12), st.floats(), st.sampled_from([-0.0, -4e-5, 5e-5]))


@st.composite
def rows(draw: st.DrawFn) -> np.ndarray:
    count = draw(st.integers(1, 8))
    found = np.zeros(count, canon.MOTION)
    for row in found:
        row["kind"] = draw(st.integers(0, 3))
        row["digits"] = digits = draw(st.integers(0, 9))
        row["n"] = draw(st.integers(0, 10**digits - 1))
        row["values"] = draw(st.lists(values, min_size=9, max_size=9))
        if row["kind"] == canon.ARC:
            row["values"][4] = draw(st.integers(-300, 300).filter(bool))
    return found


@given(rows(), st.sampled_from([1, 98, 99_995, 12_345_678]))
@example(np.array([(3, 0, 0, 1, (0.03125, *[0] * 8)), (3, 0, 0, 1, (0.09375, *[0] * 8))], canon.MOTION), 1)
@example(np.array([(0, 0, 0, 1, (99999999999.99998, -1e11, 1e11, 0, 0, 0, 0, 0, 0))], canon.MOTION), 1)
def test_the_same_text(rows: np.ndarray, number: int) -> None:
    compiled = kernel()
    assert compiled is not None
    usual = list(canon_text.text([canon.MotionBlock(rows)]))
    assert len(rows) < canon_text.MANY  # written by Python
    usual = [f"{number + k:5d} {line[6:]}" for k, line in enumerate(usual)]
    at = 0
    for count, lines in compiled.written(canon.MotionBlock(rows).columns, number):
        if lines:
            assert lines.splitlines() == usual[at : at + count]
        else:
            assert not np.abs(rows["values"][at]).max() < 1e11  # left to Python for a reason
        at += count
    assert at == len(rows)


def test_batches_are_written_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel()
    for seed in range(100):
        program = plain_program(Random(seed)).decode()
        texts = []
        for compiled in (True, False):
            interpreter = Interpreter(program)
            items = interpreter.run_in_batches() if compiled else interpreter.run()
            lines: list[str] = []
            with monkeypatch.context() as patch, suppress(ProgramError):
                patch.setattr("rds.nc.language.stream.FEW_OF_BATCH", 0)
                if not compiled:
                    patch.setattr(canon_text, "_compiled", lambda number, item: None)
                lines.extend(canon_text.text(items))
            texts.append(lines)
        assert texts[0] == texts[1]


def test_large_blocks_are_written_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    rows = np.zeros(20_000, canon.MOTION)
    rows["kind"] = rng.integers(0, 4, len(rows))
    rows["digits"], rows["n"] = 5, np.arange(len(rows))
    rows["values"] = rng.normal(0, 1000, (len(rows), 9))
    rows["values"][:, 4] = np.copysign(1, rows["values"][:, 4])
    rows["values"][::5000, 0] = 1e15  # by Python, in between
    monkeypatch.setattr(canon_text, "LONG_TEXT", 0)
    items = [canon.Call("SELECT_PLANE", ("XY",)), canon.MotionBlock(rows), canon.Call("PROGRAM_END")]
    kernel()
    fast = list(canon_text.text(items))
    monkeypatch.setattr(canon_text, "_compiled", lambda number, item: None)
    assert fast == list(canon_text.text(items))
    assert len(fast) == len(rows) + 2
