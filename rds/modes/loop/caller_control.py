"""The loop's end of a run that is stepped: a control() that asks another process, or thread, for each voltage."""

from __future__ import annotations

from multiprocessing.connection import Client, Connection
from struct import Struct
from typing import Any

import numpy as np

from rds.core.errors import ContractError
from rds.core.types import Reference

PATIENCE = 5.0  # s that a loop against the clock waits for an answer; its modules have cut their voltages long before


def question(n: int) -> Struct:
    """Time in s; position, velocity and acceleration of the reference and the measured position, of `n` axes each."""
    return Struct(f"<{1 + 4 * n}d")


def answer(n: int) -> Struct:
    """The command voltages of `n` axes, V."""
    return Struct(f"<{n}d")


class CallerControl:
    """`control` of such a run. It connects at its first call, wherever that is: it travels to the target's process."""

    def __init__(self, address: Any, key: bytes, n: int, patience: float | None):
        self._address, self._key, self._n, self._patience = address, key, n, patience
        self._line: Connection | None = None

    def __call__(self, t: float, r: Reference, y: Any, state: Any, params: Any) -> tuple[Any, Any]:
        """The voltage that the other side answers; ContractError where it is gone, or gives none in time."""
        parts = (t, *r, y) if self._n == 1 else (t, *np.concatenate((*r, y)))
        try:
            if self._line is None:
                self._line = Client(self._address, authkey=self._key)
            self._line.send_bytes(question(self._n).pack(*parts))
            if not self._line.poll(self._patience):
                raise ContractError(f"the for loop gave no voltage within {self._patience:g} s at t = {t:.3f} s")
            voltages = answer(self._n).unpack(self._line.recv_bytes(8 * self._n))
        except (OSError, EOFError):
            raise ContractError(f"the for loop that gives the voltages was gone at t = {t:.3f} s") from None
        return (voltages[0] if self._n == 1 else voltages), state

    def __reduce__(self) -> tuple[Any, ...]:
        return CallerControl, (self._address, self._key, self._n, self._patience)
