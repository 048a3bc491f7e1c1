"""`rds cutting`: the law of the cutting force, its coefficients, and the parameters of a cut."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rds.cli.common import Json, named_values, print_json, refusals, writes_files

app = typer.Typer(no_args_is_help=True, help="Cutting forces: coefficients, fitted ones, parameters of a cut.")
Coefficients = Annotated[
    Path | None, typer.Option(help="File of coefficients instead of those of the package, a table for each material.")
]


@app.command()
def materials(coefficients: Coefficients = None, json: Json = False) -> None:
    """The coefficients of F = K d^depth V^speed f^feed by material and tool, with their sources."""
    with refusals():
        from dataclasses import asdict

        from rds.machines.forces.force_law import coefficient_names, force_law

        laws = [force_law(name, coefficients) for name in coefficient_names(coefficients)]
    if json:
        print_json({law.name: asdict(law) for law in laws})
        return
    from rds.cli.console import show_table

    columns = ["name", "material", "tool", "K [N]", "depth", "speed", "feed"]
    rows = [
        [law.name, law.material, law.tool, f"{law.K:g}", *map(str, (law.depth, law.speed, law.feed))] for law in laws
    ]
    show_table("Cutting forces", columns, rows, "F = K d^depth V^speed f^feed, with d and f in mm, V in m/min.")
    for law in laws:
        typer.echo(f"- {law.name}: {law.source}")


@app.command()
def parameters(
    speed: Annotated[float, typer.Option(help="Spindle speed, rev/min.")],
    teeth: Annotated[int, typer.Option(help="Teeth of the tool.")],
    feed: Annotated[float, typer.Option(help="Feed per tooth, mm.")],
    depth: Annotated[float, typer.Option(help="Depth of cut, along the tool, mm.")],
    width: Annotated[float, typer.Option(help="Width of cut, across the tool, mm.")],
    diameter: Annotated[float, typer.Option(help="Diameter of the tool, mm.")],
    material: Annotated[str | None, typer.Option(help="Takes kc11 and mc from the coefficients.")] = None,
    coefficients: Coefficients = None,
    kc11: Annotated[float | None, typer.Option(help="Specific cutting force at a chip of 1 mm by 1 mm, N/mm².")] = None,
    mc: Annotated[float | None, typer.Option(help="Exponent by which it falls with the chip thickness.")] = None,
    rake: Annotated[float, typer.Option(help="Rake angle, degrees.")] = 0.0,
    entering: Annotated[float, typer.Option(help="Entering angle, degrees.")] = 90.0,
    engaged: Annotated[
        float | None, typer.Option(help="Angle of engagement, degrees (default: from width and diameter).")
    ] = None,
    efficiency: Annotated[float, typer.Option(help="Of the spindle's drive.")] = 1.0,
    power: Annotated[float | None, typer.Option(help="What the spindle has, W.")] = None,
    feed_speed: Annotated[float | None, typer.Option(help="What the machine does, mm/min.")] = None,
    json: Json = False,
) -> None:
    """Feed speed, chip thickness, specific cutting force and power of a cut (equations 5.3 to 5.6 of dcs-thesis).

    The exit code is 1 where the cut takes more power than the spindle has, or more feed than the machine does.
    """
    with refusals():
        from rds.core.errors import InputError
        from rds.machines.forces.force_law import force_law
        from rds.machines.forces.milling import cut, largest_feed, warnings

        if material is not None:
            if kc11 is not None or mc is not None:
                raise InputError("--material says kc11 and mc; leave --kc11 and --mc away")
            law = force_law(material, coefficients)
            if law.kc11 is None or law.mc is None:
                raise InputError(f"the coefficients of {material} have no kc11 and mc; give --kc11 and --mc")
            kc11, mc = law.kc11, law.mc
        elif coefficients is not None:
            raise InputError("--coefficients is a file of materials; say which with --material")
        given = {
            "speed": speed,
            "teeth": teeth,
            "depth": depth,
            "width": width,
            "diameter": diameter,
            "kc11": kc11,
            "mc": mc,
            "rake": rake,
            "entering": entering,
            "engaged": engaged,
            "efficiency": efficiency,
        }
        for name, value in (("--power", power), ("--feed-speed", feed_speed)):
            if value is not None and not value > 0.0:
                raise InputError(f"{name} {value:g} must be more than 0")
        made = cut(feed=feed, **given)
        kilowatts = None if power is None else power / 1e3
        said = warnings(made, kilowatts, feed_speed)
        most = None if kilowatts is None else largest_feed(kilowatts, **given)
    if json:
        print_json({**made.to_json(), "largest_feed_per_tooth": most, "warnings": said})
        raise typer.Exit(1 if said else 0)
    from rds.cli.console import show_table

    rows = [
        ["feed speed", f"{made.feed_speed:.1f}", "mm/min"],
        ["cutting speed", f"{made.cutting_speed:.1f}", "m/min"],
        ["angle of engagement", f"{made.engaged:.1f}", "degrees"],
        ["mean chip thickness", f"{made.chip_thickness:.4f}", "mm"],
        ["specific cutting force", f"{made.specific_force:.1f}", "N/mm²"],
        ["removal", f"{made.removal:.2f}", "cm³/min"],
        ["power", f"{1e3 * made.power:.1f}", "W"],
        ["torque", f"{made.torque:.3f}", "N m"],
    ]
    if most is not None:
        rows.append(["largest feed per tooth by the power", f"{most:.4f}", "mm"])
    show_table("The cut", ["what", "value", "unit"], rows)
    for sentence in said:
        typer.echo(f"warning: {sentence}")
    raise typer.Exit(1 if said else 0)


@app.command()
@writes_files
def fit(
    data: Annotated[
        Path, typer.Argument(help="CSV with columns force \\[N], and depth \\[mm], speed \\[m/min], feed \\[mm].")
    ],
    fix: Annotated[
        list[str] | None, typer.Option(metavar="NAME=EXPONENT", help="An exponent that is known, as in speed=0.")
    ] = None,
    name: Annotated[str, typer.Option(help="Of the table in the file of coefficients.")] = "fitted",
    material: Annotated[str, typer.Option(help="What was cut, for the file.")] = "as measured",
    tool: Annotated[str, typer.Option(help="What cut, for the file.")] = "as measured",
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Write a file of coefficients (TOML).")] = None,
    json: Json = False,
) -> None:
    """Coefficients from measured forces, with intervals of 95 %: least squares of the logarithms."""
    with refusals():
        from rds.cli.force_table import fit_table, fit_toml

        found = fit_table(data, named_values(fix or (), "--fix", "speed=0"))
        if out is not None:
            from rds.core.private_files import write_private

            write_private(out, fit_toml(found, name, material, tool, data.name))
    if json:
        intervals = {key: list(value) for key, value in found.intervals.items()}
        print_json({"values": dict(found.values), "intervals": intervals, "scatter": found.scatter})
        return
    from rds.cli.console import show_table

    rows = []
    for key, value in found.values.items():
        low, high = found.intervals.get(key, (None, None))
        rows.append([key, f"{value:.5g}", "" if low is None else f"{low:.5g}", "" if high is None else f"{high:.5g}"])
    note = f"{found.readings} readings, R² = {found.r_squared:.4f}, scatter {100 * found.scatter:.2f} %."
    show_table("Coefficients of F = K d^depth V^speed f^feed", ["name", "value", "from", "to (95 %)"], rows, note)
    if out is not None:
        typer.echo(f"wrote {out}")
