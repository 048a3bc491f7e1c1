"""The computer-system interface, machine's side: what the counter board reads of a position."""

from __future__ import annotations

from collections.abc import Callable

from rds.core.errors import ContractError


def encoder(resolution: float, *, quantization: bool = True) -> Callable[[float], float] | None:
    """The function from true to measured position for `resolution` units per count; None where nothing changes.

    The measured position is the nearest whole count times the resolution. A position that is no finite number
    raises ContractError: the model has diverged.
    """
    if not quantization:
        return None

    def measure(position: float) -> float:
        try:
            return round(position / resolution) * resolution
        except (ValueError, OverflowError):
            raise diverged(position) from None

    return measure


def counted(position: float, resolution: float) -> float:
    """What the encoder reads of a finite position, on plain numbers: numba compiles it. Resolution 0: as it is."""
    return round(position / resolution) * resolution if resolution > 0.0 else position


def diverged(value: float, what: str = "position") -> ContractError:
    """The error that a model's position, or another state of it, is no finite number."""
    return ContractError(
        f"the model's {what} became {value!r}; it must stay finite: check the model's derivatives() or "
        f"advance(), its time constants against the sample period, and that the loop is stable"
    )
