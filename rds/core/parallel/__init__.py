"""One function over many items, on this computer's processors or on a dask cluster, with the same outcomes."""

from rds.core.parallel.local import worker_count, worker_number
from rds.core.parallel.outcome import Outcome
from rds.core.parallel.scheduler import Scheduler
from rds.core.parallel.spread import processors, spread

__all__ = ["Outcome", "Scheduler", "processors", "spread", "worker_count", "worker_number"]
