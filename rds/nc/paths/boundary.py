"""The boundary cells of a region, counter-clockwise: the "blob" of three-axis-mill."""

from __future__ import annotations

import numpy as np

from rds.core.errors import InputError

# The cells around one, counter-clockwise as the drawing is seen (row, column), from "down" on.
AROUND = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))
# The source's modes, each with where its search begins: a quarter turn to the right of the way it goes.
MODES = {"right": 0, "up": 2, "left": 4, "down": 6}
# Which mode goes on from the neighbour that was found: on its way right, a cell found below has turned it down.
_NEXT = ("down", "down", "right", "right", "up", "up", "left", "left")


def boundary_cells(cells: np.ndarray) -> np.ndarray:
    """The cells on the outer boundary of a region in order, counter-clockwise, shape (n, 2) of (row, column).

    `cells` is one region without cells that are one pixel wide (see `region.single_region`), with an empty border. The
    first cell is found by scanning the field row by row. From each, the neighbours are tested counter-clockwise; the
    mode (right, up, left, down) is the way the tool is going and says where the search begins. Neighbours over a corner
    count, so that inside corners are cut: the cell in such a corner is "interior to the figure" (three-axis-mill,
    figure 38).
    """
    row, column = (int(k) for k in np.unravel_index(int(np.argmax(cells)), cells.shape))
    first = (row, column)
    filled = cells.tolist()  # cell by cell, a list is quicker than an array
    path = [first]
    mode = "left"  # above and to the left of the first cell nothing is filled
    while True:
        begin = MODES[mode]
        for step in range(8):
            found = (begin + step) % 8
            down, right = AROUND[found]
            if filled[row + down][column + right]:
                break
        else:
            raise InputError(f"row {row + 1}, column {column + 1}: a single cell has no boundary to follow; draw more")
        row, column, mode = row + down, column + right, _NEXT[found]
        if (row, column) == first:
            return np.array(path)
        path.append((row, column))
