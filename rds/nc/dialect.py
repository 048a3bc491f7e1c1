"""Which of the dialect's options are on, and how far a program may run."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Dialect:
    """Options of the language. The defaults read a program as LinuxCNC's `rs274 -g` does.

    block_delete: blocks that begin with `/` are left out (LinuxCNC's default is to run them).
    gr: the `GR` subroutine call of dcs-thesis (its table 6.1).
    program_numbers: the `P` program number of oacs-thesis (section 7.3), where `;` ends a block.
    max_blocks: after so many executed blocks the program is taken for one that does not end (ProgramError).
    max_depth: subroutine calls inside one another (LinuxCNC's limit is 10).
    """

    block_delete: bool = False
    gr: bool = False
    program_numbers: bool = False
    max_blocks: int = 100_000_000
    max_depth: int = 10
