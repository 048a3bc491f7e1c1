"""QR decomposition of tall matrices, a block of rows after the other; only R is kept.

Compiled, it takes less time than waking the threads of a linear-algebra library would; without numba numpy does it.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from rds.core.compiling import COMPILED, kernel

_ROWS = 128  # in a block: it stays in the processor's nearest memory
_NUMPY_ROWS = 1 << 16


def triangle_of(columns: np.ndarray, last: np.ndarray) -> np.ndarray:
    """R (n + 1, n + 1), signs free, of the matrix of `columns` (N, n) and the column `last` (N)."""
    n = columns.shape[1] + 1
    R = np.zeros((n, n))
    if COMPILED:
        _fold(columns, last, R)
        return R
    for row in range(0, len(last), _NUMPY_ROWS):
        chosen = slice(row, row + _NUMPY_ROWS)
        R[:] = np.linalg.qr(np.vstack((R, np.column_stack((columns[chosen], last[chosen])))), mode="r")
    return R


@kernel
def _fold(columns, last, R):
    """Householder's reflections of [R; block] for each block of rows, so that R stays triangular."""
    n = len(R)
    block = np.empty((n, _ROWS))
    for first in range(0, len(last), _ROWS):
        rows = min(_ROWS, len(last) - first)
        for k in range(rows):
            for j in range(n - 1):
                block[j, k] = columns[first + k, j]
            block[n - 1, k] = last[first + k]
        for j in range(n):
            squares = 0.0
            for k in range(rows):
                squares += block[j, k] * block[j, k]
            if squares == 0.0:
                continue
            head = R[j, j]
            norm = sqrt(head * head + squares)
            pivot = head + norm if head > 0.0 else head - norm
            R[j, j] = -norm if head > 0.0 else norm
            factor = 2.0 / (pivot * pivot + squares)
            for i in range(j + 1, n):
                # four sums beside each other, which a processor makes at once
                one, two, three, four = R[j, i] * pivot, 0.0, 0.0, 0.0
                whole = rows - rows % 4
                for k in range(0, whole, 4):
                    one += block[i, k] * block[j, k]
                    two += block[i, k + 1] * block[j, k + 1]
                    three += block[i, k + 2] * block[j, k + 2]
                    four += block[i, k + 3] * block[j, k + 3]
                for k in range(whole, rows):
                    one += block[i, k] * block[j, k]
                dot = ((one + two) + (three + four)) * factor
                R[j, i] -= dot * pivot
                for k in range(rows):
                    block[i, k] -= dot * block[j, k]
