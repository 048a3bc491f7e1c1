"""Which of the dialect's options are on, and how far a program may run."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Dialect:
    """Options of the language. The defaults read a program as LinuxCNC's `rs274 -g` does, on a machine in mm.

    block_delete: blocks that begin with `/` are left out (LinuxCNC's default is to run them).
    gr: the subroutine call of dcs-thesis (its table 6.1): `GR100` does what `O100 CALL` does.
    program_numbers: the first block may be a program number, `P001` (oacs-thesis, section 7.3) or `O001` (dcs-thesis,
        table 5.2), and `;` ends a block (then there are no comments behind `;`).
    default_feed: a move by feed may come before the first word F, and has the machine's default feed; without it such a
        move is a fault.
    open_end: the program may end with its last line, without M2, M30 or %; without it that is a fault.
    inch_machine: lengths in the tool table and the parameter file are in inches (as they are for `rs274 -g`), not mm.
    any_exit: the first move after G40 may be as short as it likes, as in LinuxCNC, where it may take the cutter onto
        the contour; without it such a move is a fault.
    max_jumps: after so many calls and jumps back the program is taken for one that does not end (ProgramError).
    max_depth: subroutine calls inside one another (9 in LinuxCNC).
    """

    block_delete: bool = False
    gr: bool = False
    program_numbers: bool = False
    inch_machine: bool = False
    any_exit: bool = False
    default_feed: bool = False
    open_end: bool = False
    max_jumps: int = 1_000_000
    max_depth: int = 9
