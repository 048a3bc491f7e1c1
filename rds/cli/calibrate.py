"""`rds machine calibrate`: assembly errors of links from measured positions of the tool's tip."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rds.cli.common import Json, print_json, refusals, writes_files
from rds.cli.machines import Force, Name, check_out, write_made

_TIP = "tip_"
_LARGEST = 10.0  # degrees or mm of a link: what an assembly could be off


@writes_files
def calibrate(
    machine: Name,
    data: Annotated[
        Path,
        typer.Argument(
            help="CSV with a column for each joint (X \\[mm], A \\[deg]), and of tip_x, tip_y and tip_z \\[mm] what "
            "was measured.",
            metavar="READINGS",
        ),
    ],
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Write the errors as a script, NAME.ncc.")] = None,
    link: Annotated[
        list[str] | None,
        typer.Option(help="A link that may have errors, as in LN4; may be repeated. By default all.", metavar="LNn"),
    ] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Find the assembly errors of a machine's links from where the tool's tip was measured; RF03 lines for a script.

    Links have the numbers that `rds machine script` writes.
    """
    with refusals():
        import numpy as np

        from rds.core.errors import InputError
        from rds.machines import load_machine
        from rds.machines.calibration import calibrate as found_by
        from rds.machines.link_table import ENTRIES
        from rds.results.reports.reading import read_columns

        if out is not None:
            check_out(out, ".ncc", force)
        made = load_machine(machine)
        kinematics = made.kinematics
        columns = {column.name: column for column in read_columns(data)}
        tips = [f"{_TIP}{each}" for each in "xyz" if f"{_TIP}{each}" in columns]
        wanted = [*kinematics.joints, *(f"{_TIP}{each}" for each in "xyz")]
        if strange := [name for name in columns if name not in wanted]:
            known = ", ".join(wanted)
            raise InputError(f"column {strange[0]!r} is neither joint nor tip; those are {known}", str(data))
        if missing := [name for name in kinematics.joints if name not in columns]:
            raise InputError(f"it has no column {missing[0]!r} of the joint; add it", str(data))
        if not tips:
            raise InputError("it says nothing of the tip; add tip_x, tip_y or tip_z", str(data))
        for name, column in columns.items():
            unit = "mm" if name in tips else made.axis(name).unit
            if column.unit not in ("", unit):
                raise InputError(f"column {name!r} is in {column.unit}; give it in {unit}", str(data))
        numbers = {name: np.array(column.numbers()) for name, column in columns.items()}
        joints = np.column_stack([numbers[name] for name in kinematics.joints])
        try:
            found = found_by(made, joints, {name[len(_TIP) :]: numbers[name] for name in tips}, _numbers(link))
        except InputError as error:
            raise InputError(str(error), str(data)) from None
        if out is not None:
            write_made(out, found.script(f"assembly errors of {made.name}, from {data.name}"))
    far = {when: np.linalg.norm(off, axis=1) for when, off in (("before", found.before), ("after", found.after))}
    rms = {when: float(np.sqrt(np.mean(each**2))) for when, each in far.items()}
    most = {when: float(each.max()) for when, each in far.items()}
    if any(abs(value) > _LARGEST for row in found.errors.values() for value in row):
        typer.echo(
            f"rds: note: {data}: errors of more than {_LARGEST:g}° or {_LARGEST:g} mm are none of an assembly; see "
            "whether columns are exchanged, a sign is wrong, or the tip was measured from another zero",
            err=True,
        )
    if json:
        errors = {f"LN{number}": dict(zip(ENTRIES, row, strict=True)) for number, row in found.errors.items()}
        print_json(
            {"errors": errors, "determined": found.determined, "unknown": found.unknown, "rms": rms, "largest": most}
            | ({"file": str(out)} if out is not None else {})
        )
        return
    from rds.cli.console import show_table

    rows = [[f"LN{number}", *(f"{value:g}" for value in row)] for number, row in found.errors.items()]
    note = (
        f"Angles in degrees, shifts in mm. The readings tell {found.determined} combinations of these {found.unknown} "
        "numbers; of all that agree, the smallest are taken."
    )
    show_table(f"Assembly errors of {made.name}", ["link", *ENTRIES], rows, note)
    for when, what in (("before", "without them"), ("after", "with them")):
        typer.echo(f"tip off {what}: {rms[when]:.4g} mm RMS, {most[when]:.4g} mm at most")
    if out is not None:
        typer.echo(f"wrote {out}")


def _numbers(links: list[str] | None) -> list[int] | None:
    from rds.core.errors import InputError

    if not links:
        return None
    found = []
    for each in links:
        if not each.upper().startswith("LN") or not each[2:].isdigit():
            raise InputError(f"--link {each!r} must be LN and a number, as in LN4")
        found.append(int(each[2:]))
    return found
