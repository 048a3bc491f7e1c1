"""The tables of a map's file (FILE.map.toml): what each key means, its unit, its range, its default."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf

from rds.core.quantities import AnyValue, Choice, Declaration, Flag, Items, Quantity, Table, Text
from rds.identification.logs.csv_cells import DELIMITERS
from rds.identification.logs.log import QUANTITIES

JITTER_LIMIT = 0.1  # of the sample period: how far a step of the time may be from it
_SCALE = Quantity("the column's unit per number of the column; not 0", "", -1e15, 1e15, default=1.0)
_OFFSET = Quantity("what is added, in the column's unit", "", -1e15, 1e15, default=0.0)
_WRAP = Quantity("number at which the column's counter begins again", "", 1e-9, 1e15)
FORCE_GAIN = Quantity("force (N) or torque (Nm) that the command makes", "per unit of the command", -1e9, 1e9)
_LAYOUT: Mapping[str, Declaration] = {
    "delimiter": Choice("what stands between two cells", ("find", *DELIMITERS), "find"),
    "decimal": Choice("decimal mark", ("find", "point", "comma"), "find"),
}
_TIME = Table(
    "the column of time",
    {
        "column": Text("its heading"),
        "unit": Text("its unit"),
        "scale": _SCALE,
        "offset": _OFFSET,
        "wrap": _WRAP,
        "rate": Quantity("sampling frequency, where no column tells the time", "Hz", 1e-6, 1e9),
        "source": Text("where the time stamps come from", ""),
        "uncertainty": Quantity("standard deviation of a time stamp", "s", 0.0, 1e3),
    },
)
_COLUMN = Table(
    "a column of numbers",
    {
        "column": Text("its heading"),
        "unit": Text("its unit"),
        "scale": _SCALE,
        "offset": _OFFSET,
        "wrap": _WRAP,
        "sign": AnyValue("1 or -1", default=1),
        "second": Flag("it is in the second file", False),
    },
)
_AXIS = Table(
    "an axis of the log",
    {
        **{name: AnyValue(f"column of the {name}", (Text("its heading"), _COLUMN)) for name in QUANTITIES},
        "machine_axis": Text("the machine's axis that it is"),
        "resolution": Quantity("of the encoder", "mm (or the axis's unit) per count", 1e-12, 1e9),
        "counts_per_unit": Quantity("of the encoder", "counts per mm (or the axis's unit)", 1e-9, 1e12),
        "closed_loop": Flag("a controller was at work"),
        **{
            key: AnyValue(
                f"{what} that the command makes, per unit of it; a text names a constant of the file",
                (FORCE_GAIN, Text("a constant of the file")),
            )
            for key, what in (("force_gain", "force, N,"), ("torque_gain", "torque, Nm,"))
        },
        "voltage_range": AnyValue(
            "range of the command, V: one number for both directions, or two",
            (
                Quantity("to both sides of 0", "V", above=0.0),
                Items("range of the command", Quantity("end", "V"), "[lowest, highest] in V", 2, rising=True),
            ),
        ),
    },
    needed=("command",),
)
_SECOND = Table(
    "a second recorder's file of the same motion",
    {
        "file": Text("the second recorder's file"),
        **_LAYOUT,
        "time": _TIME,
        "same": Table(
            "columns of the two files that saw the same motion",
            {"first": Text("column of the first file"), "second": Text("column of the second file")},
        ),
        "relation": Choice("how the two columns belong together", ("same", "rate"), "same"),
        "offset": Quantity("of the second clock", "s", -1e9, 1e9),
        "drift": Quantity("of the second clock", "s per s", -0.1, 0.1),
        "window": Quantity("largest offset that is looked for", "s", 1e-9, default=inf, infinite=True),
    },
    needed=("file",),
)
MAP = Table(
    "A map: what the columns of a file of logged data mean.",
    {
        "machine": Text("a machine of the package, or the path of a machine file"),
        "table": Table("how the file is laid out", _LAYOUT),
        "bus": Table(
            "of a bus log",
            {"dbc": AnyValue("DBC files", (Text("file"), Items("files", Text("file"), "names of files")))},
        ),
        "time": _TIME,
        "axis": Table("axes by name", others=_AXIS),
        "second": _SECOND,
        "samples": Quantity("how many there should be", "", 2, 10**9, whole=True),
        "jitter_limit": Quantity(
            "how far a step of the time may be off", "parts of the sample period", 0.0, 1.0, default=JITTER_LIMIT
        ),
        "duplicates": Choice("what is done with repeated times", ("refuse", "drop"), "refuse"),
        "gaps": Choice("what is done with gaps", ("refuse", "split", "keep"), "refuse"),
        "blanks": Choice("what is done with rows that have an empty cell", ("refuse", "drop", "hold"), "refuse"),
    },
    needed=("axis",),
)
