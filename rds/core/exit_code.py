"""What the exit code of a process says of its end."""

from __future__ import annotations


def how_it_ended(code: int) -> str:
    """Of a process without a last word, in a sentence's middle; `code` as `subprocess` has it, below 0: a signal."""
    return f"was ended by signal {-code}" if code < 0 else f"ended with code {code}, and said nothing"
