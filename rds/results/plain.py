"""Values in the types that JSON knows, so that what is saved equals what is reopened."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import PurePath
from typing import Any

import numpy as np

from rds.core.errors import InputError


def plain(value: Any, where: str) -> Any:
    """`value` in dict, list, str, int, float, bool and None; `where` names it in an error.

    JSON has no NaN or infinity: such a number becomes None, "not known". Raises InputError for any other type.
    """
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        return str.__str__(value)  # the text of a StrEnum
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, PurePath):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): plain(item, f"{where}[{str(key)!r}]") for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        items = sorted(value) if isinstance(value, set | frozenset) else value
        return [plain(item, f"{where}[{index}]") for index, item in enumerate(items)]
    raise InputError(f"{where} is a {type(value).__name__}; give numbers, text, lists or dicts, which JSON can hold")
