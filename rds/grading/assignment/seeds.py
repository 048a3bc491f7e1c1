"""A student's own seed: from the assignment's secret and the student's name, the same on every computer."""

from __future__ import annotations

import hashlib


def student_seed(secret: str, student: str) -> int:
    """63 bits that nobody can foretell without the secret; every student's are different."""
    return _number(secret, student)


def part_seed(seed: int, *parts: str | int) -> int:
    """The seed of one part (a case, a run, an axis, the noise of it), so that parts do not depend on each other."""
    return _number(str(seed), *map(str, parts))


def _number(*parts: str) -> int:
    # lengths before the texts: ("a", "bc") and ("ab", "c") are not the same
    told = "".join(f"{len(part)}:{part}" for part in parts)
    return int.from_bytes(hashlib.sha256(told.encode("utf-8", "surrogatepass")).digest()[:8], "big") >> 1
