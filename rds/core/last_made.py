"""What takes long to make, kept until it would be made of something else."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

Made = TypeVar("Made")


class LastMade:
    """Keeps the last thing that was made, with what it was made of."""

    def __init__(self) -> None:
        self._of: Any = None
        self._made: Any = None

    def get(self, of: Any, make: Callable[[], Made]) -> Made:
        """What `make()` returns; the same as last time where `of` is equal. It is not None."""
        if self._made is None or self._of != of:
            self._made = None  # free its memory first: it may be large
            self._made, self._of = make(), of
        made: Made = self._made
        return made
