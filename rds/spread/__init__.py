"""One function over many items, on this computer's processors or on a dask cluster, with the same outcomes."""

from rds.spread.local import worker_number
from rds.spread.outcome import Outcome
from rds.spread.spread import processors, spread

__all__ = ["Outcome", "processors", "spread", "worker_number"]
