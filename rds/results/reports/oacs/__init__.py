"""The readings in the appendices of oacs-thesis, a CSV file for each table: `oacs:O32` where a report takes a file.

A file `TABLE.toml` beside one has what the report on accuracy must know of its moves.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from rds.core.errors import InputError
from rds.core.quantities import near

PREFIX = "oacs:"
TITLES = {
    "M28": "reconfiguration by a familiar user, 3 and 4 modules, s",
    "M29": "reconfiguration by a new user, 3 and 4 modules, s",
    "O32": "encoder counts of X after 80 mm",
    "O33": "encoder counts of Z after 50 mm",
    "O34": "encoder counts of A after 345°, at half the resolution",
    "O35": "times of moves, s",
    "P36": "accelerometer: axes move, the drill turns",
    "P37": "accelerometer: drilling 20 mm",
    "P38": "accelerometer: drilling 40 mm",
    "Q39": "current of A, A",
    "Q40": "current of X, A",
    "Q41": "current of Z, A",
    "Q42": "current of the drill without load, A",
    "Q43": "current of the drill, drilling 40 mm, A",
}


def data_file(name: str | Path) -> Path:
    """The file that a user means: a path, or one of these tables as `oacs:O32`. InputError names them all."""
    text = str(name)
    if not text.startswith(PREFIX):
        return Path(name)
    table = text.removeprefix(PREFIX)
    if table not in TITLES:
        known = [f"{PREFIX}{each}" for each in TITLES]
        raise InputError(
            f"{text} is no table of the thesis's readings; there are {', '.join(known)}{near(text, known)}"
        )
    return Path(str(files(__name__))) / f"{table}.csv"
