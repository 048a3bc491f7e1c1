"""The [network] table of an experiment: what it may hold, and the network that it describes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import Choice, Declaration, Flag, Parts, Quantity, Table, Text
from rds.core.toml_table import TomlTable
from rds.network.delays import Delay, LinkModel, Network
from rds.network.distributions import DISTRIBUTIONS, checked_params
from rds.network.trace import COLUMNS, read_trace

_TRACE = Table(
    "delays that were recorded, in order, from the beginning again after the end",
    {
        "file": Text("CSV file of delays, as `rds network measure --out` writes it"),
        "column": Choice("its column; by default the one of this part's name", COLUMNS),
    },
    needed=("file",),
)


def _delay_table(kind: str) -> Table:
    if kind == "trace":
        return _TRACE
    known = DISTRIBUTIONS[kind]
    return Table(known.meaning, known.parameters, needed=known.needed)


_KINDS = Parts(lambda: [*DISTRIBUTIONS, "trace"], _delay_table)
_LOSS: dict[str, Declaration] = {
    "loss": Quantity("share of the messages that is lost", "", 0.0, 0.99, default=0.0),
    "loss_burst": Quantity("messages that are lost in a row, in the mean; without it each by itself", "", 1.0, 1e6),
    "order": Choice("what a message does that a later one has overtaken", ("drop", "take", "keep"), "drop"),
}


def _link(meaning: str) -> Table:
    return Table(meaning, _LOSS, chosen_by="kind", parts=_KINDS)


NETWORK = Table(
    "delay and loss between sensor, controller and actuator",
    {
        "sensor": _link("from the sensor to the controller"),
        "computing": Table("what the controller takes to compute", chosen_by="kind", parts=_KINDS),
        "actuator": _link("from the controller to the actuator"),
        "seed": Quantity(
            "of the random delays: the same seed, the same delays", "", 0, 2**63 - 1, default=0, whole=True
        ),
        "event": Flag("the law runs when its measurement arrives, instead of at the sampling instants", False),
        "actuator_buffer": Quantity(
            "every voltage waits until it is so old (Δ₁ of equation 2.2)", "samples", 0, 1000, default=0, whole=True
        ),
        "controller_buffer": Quantity(
            "every measurement waits until it is so old (Δ₂ of equation 2.4)", "samples", 0, 1000, default=0, whole=True
        ),
    },
)


def read_network(words: TomlTable, folder: Path) -> Network | None:
    """The network of an experiment's words; None where there is no [network]. Files are looked for from `folder`.

    InputError with file, line, key, value and remedy for anything that will not do.
    """
    table = words.inner("network")
    if table is None:
        return None
    if "axis" in table:
        raise table.fault(
            "axis",
            "cannot be had: all axes of a run have one network, each with delays of its own; put it in [network]",
        )
    computing = table.inner("computing")
    delay = Delay()
    if computing is not None:
        delay = _delay(computing, "computing", folder)
        if delay.lost_share:
            raise InputError(
                "the trace has lost messages; computing always ends: choose another column", computing.place()
            )
        computing.done()
    made = Network(
        _link_model(table.inner("sensor"), "sensor", folder),
        delay,
        _link_model(table.inner("actuator"), "actuator", folder),
        **{key: table.read(key) for key in ("seed", "event", "actuator_buffer", "controller_buffer")},
    )
    table.done()
    return made


def _link_model(table: TomlTable | None, name: str, folder: Path) -> LinkModel:
    if table is None:
        return LinkModel()
    delay = _delay(table, name, folder) if "kind" in table else Delay()
    loss, burst, order = (table.read(key) for key in ("loss", "loss_burst", "order"))
    if burst is not None and loss > burst / (burst + 1.0):
        raise table.fault(
            "loss", f"cannot be so large with bursts of {burst:g} messages: at most {burst / (burst + 1):.3g}"
        )
    if burst is not None and not loss:
        raise table.fault("loss_burst", "says how losses bunch, and there is no loss: give `loss`, or remove it")
    table.done()
    return LinkModel(delay, loss, burst, order)


def _delay(table: TomlTable, name: str, folder: Path) -> Delay:
    if "kind" not in table:
        raise InputError(f'kind is missing; as in `kind = "uniform"` ({", ".join(_KINDS.names())})', table.place())
    kind = table.read("kind")
    own = Table(_delay_table(kind).meaning, {**_LOSS, **_delay_table(kind).keys}, needed=_delay_table(kind).needed)
    table.declared = own
    if kind == "trace":
        return Delay.recorded(_column(table, name, folder))
    given = {key: table.read(key) for key in DISTRIBUTIONS[kind].parameters}
    try:
        return Delay(kind, checked_params(kind, given))
    except InputError as error:
        raise InputError(str(error), table.place()) from error


def _column(table: TomlTable, name: str, folder: Path) -> np.ndarray:
    path = folder / table.read("file")
    column = table.read("column", name)
    columns = read_trace(path)
    if column not in columns:
        raise table.fault("file", f"has no column {column!r}; it has {', '.join(columns)}")
    if not np.isfinite(columns[column]).any():
        raise table.fault("file", f"has only lost messages in column {column!r}; record a trace in which some arrive")
    return columns[column]
