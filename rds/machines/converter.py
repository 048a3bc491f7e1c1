"""The computer-system interface, computer's side: what the output board makes of a command voltage."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import inf, isfinite
from numbers import Real
from typing import Any

from rds.core.errors import ContractError
from rds.core.values import is_masked
from rds.machines.encoder import counted

Limits = tuple[float, float, float]  # lowest and highest output, and step between levels, V; 0 for no levels


def as_voltage(value: Any) -> float:
    """A controller's answer as a float, V.

    Raises ContractError unless it is one finite real number (a float, an int, or a numpy scalar or array of one).
    """
    if type(value) is float and isfinite(value):  # nearly always, and ten times as fast as the rest
        return value
    number = value
    if getattr(value, "size", None) == 1 and getattr(getattr(value, "dtype", None), "kind", "") in ("f", "i", "u"):
        number = None if is_masked(value) else value.item()
    try:
        if isinstance(number, Real) and not isinstance(number, bool) and isfinite(number):
            return float(number)
    except OverflowError:  # an int of hundreds of digits
        pass
    raise ContractError(f"control() gave {value!r:.200} as the voltage; it must be one finite number in V")


def converter(
    full_scale: float, bits: int, *, saturation: bool = True, quantization: bool = True
) -> Callable[[float], float]:
    """The function from command voltage to output voltage of a bipolar converter of 2^bits levels.

    The levels are k·2·full_scale/2^bits for k from -2^(bits-1) to 2^(bits-1) - 1, so the highest is one step
    below +full_scale. Either effect can be switched off to see what it does. NaN or text raises ContractError.
    """
    step = 2.0 * full_scale / 2**bits
    low = -full_scale
    high = full_scale - step if quantization else full_scale
    coarse = step * 2.0**52  # from here on a float is a whole number of steps

    def both(u: Any) -> float:
        if type(u) is not float:
            u = as_voltage(u)
        if low <= u <= high:
            return round(u / step) * step
        if not isfinite(u):
            as_voltage(u)
        return high if u > high else low

    def saturate(u: Any) -> float:
        if type(u) is not float:
            u = as_voltage(u)
        if low <= u <= high:
            return u
        if not isfinite(u):
            as_voltage(u)
        return high if u > high else low

    def quantize(u: Any) -> float:
        u = as_voltage(u)
        return round(u / step) * step if abs(u) < coarse else u

    if saturation:
        return both if quantization else saturate
    return quantize if quantization else as_voltage


def limits(full_scale: float, bits: int, *, saturation: bool = True, quantization: bool = True) -> Limits:
    """What `converted` needs to do as `converter` does."""
    step = 2.0 * full_scale / 2**bits if quantization else 0.0
    return (-full_scale, full_scale - step, step) if saturation else (-inf, inf, step)


def converted(u: float, low: float, high: float, step: float) -> float:
    """What `converter` makes of a finite command, on plain numbers: numba compiles it as it stands."""
    u = min(max(u, low), high)
    if step > 0.0 and abs(u) < step * 2.0**52:
        u = round(u / step) * step
    return u


@lru_cache
def compiled() -> tuple[Callable[[float, float], float], Callable[[float, float, float, float], float]]:
    """Encoder and converter in machine code, for every compiled loop: `counted` and `converted`. Needs numba."""
    from numba import njit

    return njit(counted), njit(converted)
