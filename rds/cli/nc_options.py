"""The options that all commands on part programs share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

if TYPE_CHECKING:
    from rds.nc.setup import Setup

Program = Annotated[Path, typer.Argument(help="The part program (RS274NGC, as LinuxCNC reads it).", metavar="FILE")]
MachineName = Annotated[str, typer.Option("--machine", help="A machine's name, or the path of its TOML file.")]
Tools = Annotated[Path | None, typer.Option(help="Tool table as LinuxCNC keeps it, in mm, or tool library (.toml).")]
Parameters = Annotated[Path | None, typer.Option(help="Parameter file, as LinuxCNC keeps it (offsets, #parameters).")]
With = Annotated[
    list[str] | None,
    typer.Option(
        "--with",
        metavar="OPTION",
        help="Of the dialect: block-delete, gr, program-numbers, default-feed, open-end, ncc, inch-machine, any-exit, "
        "tcp; probe-surface=Z: where probing moves touch, mm; or correction: of the assembly errors in the machine's "
        "links.",
    ),
]
ProfileName = Annotated[
    str, typer.Option("--profile", help="Of the motion: planned, trapezoid, blended or point-to-point.")
]
MaxJumps = Annotated[
    int | None,
    typer.Option(
        min=1, help="Calls and jumps back after which a program is taken for endless (default 1000000).", metavar="N"
    ),
]
DIALECT = (
    *("block-delete", "gr", "program-numbers", "default-feed", "open-end", "ncc", "inch-machine", "any-exit", "tcp"),
)
CORRECTION = "correction"
PROBE = "probe-surface="


class ProgramOptions(NamedTuple):
    """The options by which most commands are told how to read a part program."""

    tools: Tools = None
    parameters: Parameters = None
    with_: With = None
    max_jumps: MaxJumps = None

    def setup(self) -> Setup:
        """What a program is read with. InputError for an option that there is not."""
        from rds.core.errors import InputError
        from rds.nc.language.dialect import Dialect
        from rds.nc.setup import Setup

        correct = CORRECTION in (self.with_ or ())
        given: dict[str, Any] = {}
        for name in self.with_ or ():
            if name.startswith(PROBE):
                try:
                    given["probe_surface"] = float(name.removeprefix(PROBE))
                except ValueError:
                    raise InputError(f"--with {name!r}: {PROBE} wants a height in mm, as in {PROBE}-3.5") from None
        options = [name for name in self.with_ or () if name != CORRECTION and not name.startswith(PROBE)]
        for name in options:
            if name not in DIALECT:
                known = ", ".join((*DIALECT, f"{PROBE}Z", CORRECTION))
                raise InputError(f"--with {name!r} is no option of the dialect; there are {known}")
        given |= {name.replace("-", "_"): True for name in options}
        if self.max_jumps is not None:
            given["max_jumps"] = self.max_jumps
        return Setup(self.tools, self.parameters, Dialect(**given), correct)
