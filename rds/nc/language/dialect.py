"""Which of the dialect's options are on, and how far a program may run."""

from __future__ import annotations

from typing import NamedTuple


class Dialect(NamedTuple):
    """Options of the language. The defaults read a program as LinuxCNC's `rs274 -g` does, on a machine in mm.

    block_delete: blocks that begin with `/` are left out (LinuxCNC's default is to run them).
    gr: the subroutine call of dcs-thesis (its table 6.1): `GR100` does what `O100 CALL` does.
    program_numbers: the first block may be a program number, `P001` (oacs-thesis, section 7.3) or `O001` (dcs-thesis,
        table 5.2), and `;` ends a block (then there are no comments behind `;`).
    default_feed: a move by feed may come before the first word F, and has the machine's default feed; without it such a
        move is a fault.
    tcp: G43.4 H switches tool centre point control on, and G49 off (docs/part-program-language.md); a machine whose
        links have rotary axes has it always.
    open_end: the program may end with its last line, without M2, M30 or %; without it that is a fault.
    ncc: the program may begin with a configuration script (mrm-control, section 5: RF01, RF02, RF03, BUILD), which says
        the links of the machine that it is for.
    inch_machine: lengths in the tool table and the parameter file are in inches (as they are for `rs274 -g`), not mm.
    any_exit: the first move after G40 may be as short as it likes, as in LinuxCNC, where it may take the cutter onto
        the contour; without it such a move is a fault.
    probe_surface: where a probe touches (G38.2 to G38.5): mm, a height along the machine's Z. Without it the contact is
        at the move's end, as for `rs274 -g`.
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
    ncc: bool = False
    tcp: bool = False
    probe_surface: float | None = None
    max_jumps: int = 1_000_000
    max_depth: int = 9
