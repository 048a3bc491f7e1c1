"""Numbers under the mask of numpy's masked arrays are no answer, whoever gives them; an empty mask masks nothing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rds.checks.rows import row_of
from rds.core.errors import ContractError
from rds.core.signals import signal_values
from rds.core.types import Controller, LineSegment
from rds.core.values import is_masked
from rds.interpolators.interpolator import as_interpolator
from rds.models.ode import advance_model, ode_model
from rds.modes.loop.laws import LiveReference, coupled

PARTLY = np.ma.array([1.0, 2.0], mask=[True, False])
OPEN = np.ma.array([1.0, 2.0])
LINE = LineSegment(start=(0.0, 0.0), end=(1.0, 2.0), feed_rate=1.0)


def _row(part: Any) -> None:
    if isinstance(found := row_of((part, part, part), 2), tuple):
        raise ContractError(found[1])


def _table(part: Any) -> None:
    if isinstance(found := row_of(np.ma.array([part, part, part]), 2), tuple):
        raise ContractError(found[1])


def _coupled(part: Any) -> None:
    law = Controller(lambda t, r, y, state, params: (part, state), coupled=True)
    references = [LiveReference(), LiveReference()]
    coupled(range(2), ["X", "Y"], law, references, 1e-3, [float, float], {})(0, [0.0, 0.0], [], [])


def _signal(part: Any) -> None:
    try:
        signal_values({"a": part}, ["a"], 2)
    except ValueError as error:
        raise ContractError(str(error)) from None


def _derivatives(part: Any) -> None:
    model = ode_model(lambda t, x, u, params: part)
    model.advance(model.initial_state, 1.0, 1e-3, {})


def _advance(part: Any) -> None:
    model = advance_model(lambda x, u, T, params: part)
    model.advance(model.initial_state, 1.0, 1e-3, {})


def _output(part: Any) -> None:
    model = ode_model(lambda t, x, u, params: [0.0, 0.0], output=lambda t, x, u, params: part[:1])
    assert model.output is not None
    model.output(model.initial_state)


def _interpolator(part: Any) -> None:
    first = next(as_interpolator(lambda segment, T, params: [(part, part, part)] * 2000).each(LINE, 1e-3))
    assert first.shape == (3, 2)


ANSWERS = (_row, _table, _coupled, _signal, _derivatives, _advance, _output, _interpolator)


@pytest.mark.parametrize("use", ANSWERS)
def test_a_masked_number_is_refused(use: Callable[[Any], None]) -> None:
    use(OPEN)
    with pytest.raises(ContractError):
        use(PARTLY)


def test_lists_of_masked_arrays_are_looked_through() -> None:
    assert is_masked([np.ma.array([5.0], mask=True), 1.0])
    assert is_masked(np.ma.masked)
    assert not is_masked([OPEN, 1.0, "text", None])
