"""The computer-system interface, machine's side: what the counter board reads of a position."""

from __future__ import annotations

from collections.abc import Callable


def encoder(resolution: float, *, quantization: bool = True) -> Callable[[float], float] | None:
    """The function from true to measured position for `resolution` units per count; None where nothing changes.

    The measured position is the nearest whole count times the resolution.
    """
    if not quantization:
        return None

    def measure(position: float) -> float:
        return round(position / resolution) * resolution

    return measure
