"""Readings from the appendices of the thesis on the open architecture control system, as it prints them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

# tables O32 to O34: encoder counts
COUNTS_X = {
    "cw_counts": [13521, 13483, 13591, 13560, 13527, 13510],
    "ccw_counts": [13552, 13519, 13534, 13566, 13521, 13524],
}
COUNTS_Z = {"cw_counts": [8605, 8454, 8259, 8516, 8359], "ccw_counts": [8529, 8455, 8399, 8526, 8375]}
COUNTS_A = {"cw_counts": [11362, 11433, 11398, 11428, 11426], "ccw_counts": [11424, 11359, 11428, 11375, 11381]}

# table O35: seconds
MOVE_TIMES = {
    "a_360deg_cw_s": [69.1229, 69.0258, 68.6396, 68.3864, 68.2104],
    "a_360deg_ccw_s": [56.9146, 55.7145, 55.3225, 55.3446, 54.8826],
    "x_80mm_cw_s": [36.937, 36.6825, 37.1531, 36.7625, 36.4346],
    "x_80mm_ccw_s": [30.1213, 29.3837, 30.4588, 31.0331, 29.4507],
    "z_50mm_cw_s": [27.7659, 26.9468, 26.6028, 27.2334, 26.9866],
    "z_50mm_ccw_s": [21.907, 22.1929, 22.1069, 21.8355, 22.3045],
}

# tables M28 and M29: seconds
RECONFIGURATION = {
    "familiar_3_modules_s": [210, 231, 194, 187, 175],
    "familiar_4_modules_s": [223, 225, 210, 307, 238],
    "new_3_modules_s": [302, 307, 371, 462, 388],
    "new_4_modules_s": [354, 425, 537, 394, 489],
}

# table P38: its first five readings and those that hold its extremes (52, 108, 110, 154, 156, 160)
VIBRATION = {
    "x_adc": [402, 400, 402, 402, 405, 378, 391, 419, 397, 440, 481],
    "y_adc": [520, 521, 521, 521, 520, 501, 498, 537, 566, 426, 497],
    "z_adc": [502, 505, 502, 503, 502, 507, 558, 422, 481, 506, 482],
}
# table P36: the reading at rest, five times
AT_REST = {"x_adc": [404] * 5, "y_adc": [522] * 5, "z_adc": [499] * 5}


def _amperes(text: str) -> list[float]:
    return [float(word) for word in text.split()]


# tables Q39 to Q43: amperes
CURRENT_A = {
    "cw_A": _amperes(
        "3.22 1.95 1.67 1.86 1.88 1.86 1.78 1.81 1.76 1.78 1.77 1.76 1.77 1.74 1.77 1.8 1.79 1.75 1.77 1.81"
    ),
    "ccw_A": _amperes(
        "3.9 2.3 2.1 2.02 1.99 1.96 1.95 1.91 1.8 1.81 1.75 1.78 1.77 1.76 1.77 1.82 1.78 1.76 1.79 1.82"
    ),
}
CURRENT_X = {
    "cw_A": _amperes(
        "4.39 2.89 2.13 2.98 2.47 1.89 2.52 2.83 2.43 1.95 2.54 2.77 2.24 1.98 2.66 2.88 2.27 2.15 2.58 2.95 1.97 2.42 "
        "2.63 2.98 2.67 1.94 2.63 2.84 2.67 1.98"
    ),
    "ccw_A": _amperes(
        "5.11 2.35 3.07 3.04 2.62 2.54 3.18 3.0 2.49 2.59 2.74 3.22 2.7 2.98 2.33 3.05 2.51 3.02 2.39 2.73 3.08 2.69 "
        "2.34 2.78 3.0 2.35 2.67 3.04 2.48 2.33"
    ),
}
CURRENT_Z = {
    "cw_A": _amperes(
        "6.2 4.85 4.47 3.7 3.36 3.48 3.66 4.78 4.56 3.63 3.46 3.92 4.86 4.34 3.92 3.49 3.42 4.15 4.89 4.87 4.16 3.39 "
        "3.52 3.44 4.82 3.98 3.35 3.99 3.51 3.55 4.65 4.77"
    ),
    "ccw_A": _amperes(
        "4.96 4.35 3.04 4.83 4.9 3.88 3.07 3.0 4.09 3.49 3.55 3.12 3.11 4.51 4.07 3.18 3.07 3.64 4.54 3.75 3.15 3.02 "
        "4.17 4.37 3.49 3.16 3.12 4.44 4.11 3.24 3.09 3.45"
    ),
}
DRILL_IDLE = {
    "cw_A": _amperes("1.48 1.44 1.42 1.4 1.38 1.37 1.39 1.37 1.39"),
    "ccw_A": _amperes("1.4 1.37 1.36 1.38 1.36 1.35 1.36 1.35 1.38"),
}
DRILLING = {
    "current_A": _amperes(
        "1.48 1.44 1.42 1.4 1.38 1.37 1.39 1.37 1.39 2.21 1.57 1.5 1.53 1.53 1.6 1.65 1.72 1.81 1.82 1.88 2.01 2.04 "
        "2.09 2.21 2.38 2.36 2.52 2.69 2.88 2.66 2.75 3.24 3.21 3.25 3.29 3.31 3.4 3.37 3.43 3.9 3.48 3.54 3.42 3.45 "
        "3.48 3.22 3.3 3.28 3.33 3.3 3.21 3.34 3.36 3.41 3.29 3.11 3.16 3.07 2.92 2.88 2.98 3.02 3.05 3.01 3.2 3.17 "
        "3.16 3.14 3.1 3.09 3.13 3.08 3.05 3.02 2.92 2.88 2.85 2.4 2.34 2.38 2.23 2.11 2.05 1.96 1.84 1.76 1.74 1.72 "
        "1.67 1.6 1.59 1.57 1.55 1.52 1.5 1.47 1.44 1.4 1.41 1.4"
    )
}


def save(path: Path, table: Mapping[str, Sequence[float]]) -> Path:
    """The table as a CSV file whose first column numbers the rows."""
    lines = [",".join(["reading", *table])]
    lines += [",".join(map(str, (at, *row))) for at, row in enumerate(zip(*table.values(), strict=True), 1)]
    path.write_text("\n".join(lines) + "\n")
    return path
