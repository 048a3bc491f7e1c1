"""What runs on a worker of a cluster."""

from __future__ import annotations

import pickle
from typing import Any

from rds.spread.worker import reason_of


def run_remotely(function: bytes, item: bytes) -> tuple[bool, Any]:
    """(False, value), or (True, why there is none): as a local worker answers."""
    try:
        return False, pickle.loads(function)(pickle.loads(item))
    except Exception as error:
        return True, reason_of(error)
