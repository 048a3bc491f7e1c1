"""`rds machine new|show|pose|joints|urdf|modules`, and `rds check` of a machine's file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rds.cli.buses import BusOptions, ChosenBus
from rds.cli.common import Json, print_json, refusals, writes_files

if TYPE_CHECKING:
    from rds.machines import Machine
    from rds.machines.configuration import Verdict

Name = Annotated[str, typer.Argument(help="A machine's name, or the path of its TOML file.", metavar="MACHINE")]
Out = Annotated[Path, typer.Option("--out", "-o", help="The machine's file, MACHINE.toml.")]
Force = Annotated[bool, typer.Option("--force", help="Overwrite the file of --out.")]
JOINTS = "Joint values by name, as in X=10,A=30 (mm, degrees); joints that are not named are 0."


@writes_files
def new(
    out: Out,
    *,
    script: Annotated[
        Path | None,
        typer.Argument(
            help="A configuration script (.ncc), a part program that begins with one, or a .urdf file.",
            metavar="SCRIPT",
        ),
    ] = None,
    scan: Annotated[bool, typer.Option("--scan", help="From what the modules on the bus say (dialect oacs).")] = False,
    order: Annotated[
        str | None,
        typer.Option(
            help="With --scan: modules from the tool to the work, by number; what has no board by its name in the "
            "library, as in 5,oacs-range-arm,2,4,3. By default that of --like, or as they fit."
        ),
    ] = None,
    modules: Annotated[
        str | None,
        typer.Option(
            help="Put it together of modules of the library (`rds machine modules`), from the tool to the work: "
            "oacs-drill,oacs-range-arm,oacs-z,oacs-x."
        ),
    ] = None,
    like: Annotated[
        str | None,
        typer.Option(
            metavar="MACHINE",
            help="With a script or --scan, the machine that is reconfigured: what nobody says (models, limits, "
            "converter, spindle) is its, and the links of a script that has RF02 and RF03 alone. By default of a "
            "machine of the package with such modules, or chosen.",
        ),
    ] = None,
    on_bus: BusOptions,
    force: Force = False,
    json: Json = False,
) -> None:
    """Make a machine's file from a script, a URDF, the modules on the bus, or modules of the library; and judge it."""
    with refusals():
        from rds.core.errors import InputError
        from rds.machines import load_machine
        from rds.machines.by_hand import text_of_modules
        from rds.machines.configuration import verdict

        ways = (script is not None) + scan + (modules is not None)
        if ways != 1:
            given = "none is given" if not ways else f"{ways} are given"
            raise InputError(f"{given}: name a script, or ask the bus with --scan, or name --modules of the library")
        if not scan and (order or any(on_bus)):
            raise InputError(
                "--order, --interface, --channel, --bitrate and --experiment belong to --scan, which is not given"
            )
        if like is not None and modules is not None:
            raise InputError("--like belongs to a script or --scan; modules of the library are chosen whole")
        check_out(out, ".toml", force)
        before = load_machine(like) if like is not None else None
        if modules is not None:
            text = text_of_modules([each.strip() for each in modules.split(",")], out.stem)
        elif scan:
            text = _scanned(out.stem, order, before, on_bus.chosen())
        else:
            text = _from_file(script, out.stem, before)
        judged = verdict(_readable(text, out.name))
        write_made(out, text)
    _show_verdict(judged, json, f"wrote {out}")


def _readable(text: str, name: str) -> Machine:
    """The machine of a file that is not written yet: one that is refused must not take the place of a good one."""
    from tempfile import TemporaryDirectory

    from rds.core.errors import InputError
    from rds.machines import load_machine

    with TemporaryDirectory() as folder:
        path = Path(folder, name)
        write_made(path, text)
        try:
            return load_machine(str(path))
        except InputError as error:
            said = str(error).removeprefix(f"{error.where}: ")
            raise InputError(f"{name} is not written, as no machine comes of it: {said}") from None


def _from_file(path: Path | None, name: str, before: Machine | None) -> str:
    from rds.core.errors import InputError
    from rds.machines.ncc import machine_text_of_script, read_script
    from rds.machines.urdf import machine_text_of_urdf

    assert path is not None
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeError:
        raise InputError("is no text; name a configuration script or a .urdf file", str(path)) from None
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror}); check the path", str(path)) from error
    if path.suffix.lower() == ".urdf" or text.lstrip("\ufeff \t\r\n").startswith("<"):
        if before is not None:
            raise InputError("--like belongs to a script or --scan; a .urdf file says all of its joints", str(path))
        return machine_text_of_urdf(text, name, str(path))
    script = read_script(text, str(path), program=path.suffix.lower() != ".ncc")
    return machine_text_of_script(script, name, before)


def _scanned(name: str, order: str | None, before: Machine | None, place: ChosenBus) -> str:
    from rds.bus.modules.oacs.remote import Module
    from rds.bus.tools.scan import scan_all
    from rds.core.errors import MachineError
    from rds.machines.assembly import first_order, machine_text, order_of

    rows = scan_all(place.interface, place.channel, **place.options)
    numbers = [row["id"] for row in rows if row["dialect"] == "oacs"]
    if not numbers:
        raise MachineError(f"no module that describes itself answers on {place.name}; is a machine served with oacs?")
    data = {}
    with place.opened() as bus:
        for number in numbers:
            data[number] = Module(bus, number).info().as_dict()
    words = [word.strip() for word in order.split(",")] if order else []
    chosen = [int(word) if word.isdigit() else word for word in words]
    if not chosen:
        chosen = (order_of(before, data) if before is not None else None) or first_order(data)
    return machine_text(name, chosen, data, before)


@writes_files
def show(
    machine: Name,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The picture: .png, .svg, .pdf or .html (default MACHINE.png).")
    ] = None,
    joints: Annotated[str | None, typer.Option(help=JOINTS)] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Draw a machine's links with their frames, and its workspace."""
    with refusals():
        from rds.core.atomic import write_whole
        from rds.machines import load_machine
        from rds.machines.kinematics.workspace import singularities, workspace
        from rds.machines.picture import FORMATS, picture_file

        made = load_machine(machine)
        path = out or Path(f"{made.name}.png")
        check_out(path, FORMATS, force or out is None)
        write_whole(path, picture_file(made, path, _values(joints, "--joints") if joints else None))
        rooms = {within: workspace(made.kinematics, within) for within in ("travel", "limits")}
        singular = singularities(made.kinematics)
    if json:
        boxes = {within: [room.low.tolist(), room.high.tolist()] for within, room in rooms.items()}
        print_json({"file": str(path), "workspace": boxes, "singular": singular})
        return
    for within, what in (("travel", "reachable"), ("limits", "operational")):
        low, high = rooms[within].low, rooms[within].high
        box = ", ".join(f"{k} {a:g} to {b:g}" for k, a, b in zip("xyz", low.round(6), high.round(6), strict=True))
        typer.echo(f"{what} workspace: {box} mm")
    for each in singular:
        typer.echo("singular where " + ", ".join(f"{name} is {value:g}" for name, value in each.items()))
    typer.echo(f"wrote {path}")


def pose(machine: Name, joints: Annotated[str, typer.Option(help=JOINTS)], json: Json = False) -> None:
    """Where joint values take the tool's tip relative to the work, and the tool's direction there."""
    with refusals():
        from rds.machines import load_machine

        kinematics = load_machine(machine).kinematics
        matrix = kinematics.forward(_values(joints, "--joints"))
        fault = _outside(kinematics.joints, kinematics.values(_values(joints, "--joints"))[0], kinematics.limits)
    if json:
        names = {"position": matrix[:3, 3].tolist(), "direction": matrix[:3, 2].tolist(), "matrix": matrix.tolist()}
        print_json(names | {"warnings": [fault] if fault else []})
        return
    shown = (matrix.round(6) + 0.0).tolist()
    typer.echo("tip at " + ", ".join(f"{k} {row[3]:g}" for k, row in zip("xyz", shown, strict=False)) + " mm")
    typer.echo("tool along " + ", ".join(f"{k} {row[2]:g}" for k, row in zip("ijk", shown, strict=False)))
    if fault:
        typer.echo(f"note: {fault}", err=True)


def joints(
    machine: Name,
    pose: Annotated[
        str,
        typer.Option(
            help="x, y, z of the tip, mm; and the tool's direction from its tip as i, j, k, or as angles a, b, c in "
            "degrees about x, y, z: x=10,y=0,z=5,a=30. By default the tool stands as with all joints at zero."
        ),
    ],
    near: Annotated[str | None, typer.Option(help="Of several solutions the one nearest to these joints.")] = None,
    json: Json = False,
) -> None:
    """Joint values that bring the tool into a pose; exit code 1 where there are none."""
    with refusals():
        from rds.machines import load_machine

        kinematics = load_machine(machine).kinematics
        wanted = _pose(pose, kinematics.forward({})[:3, 2])
        found = kinematics.inverse(wanted, near=_values(near, "--near") if near else None)
        reached = bool((found == found).all())
        values = {name: round(float(value), 9) + 0.0 for name, value in zip(kinematics.joints, found, strict=True)}
    if json:
        print_json({"reached": reached, "joints": values if reached else None})
    elif reached:
        typer.echo(", ".join(f"{name} {value:g}" for name, value in values.items()))
    else:
        typer.echo("the machine cannot reach this pose within its limits", err=True)
    raise typer.Exit(0 if reached else 1)


@writes_files
def urdf(
    machine: Name,
    out: Annotated[Path, typer.Option("--out", "-o", help="The file, NAME.urdf.")],
    force: Force = False,
    json: Json = False,
) -> None:
    """Write a machine's links as URDF, the robot description that ROS and simulators read."""
    with refusals():
        from rds.machines import load_machine
        from rds.machines.urdf import urdf_text

        check_out(out, ".urdf", force)
        write_made(out, urdf_text(load_machine(machine)))
    print_json({"file": str(out)}) if json else typer.echo(f"wrote {out}")


@writes_files
def script(
    machine: Name,
    out: Annotated[Path, typer.Option("--out", "-o", help="The file, NAME.ncc.")],
    force: Force = False,
    json: Json = False,
) -> None:
    """Write a machine's links as a configuration script (NCC)."""
    with refusals():
        from rds.machines import load_machine
        from rds.machines.ncc import script_of_machine

        check_out(out, ".ncc", force)
        write_made(out, script_of_machine(load_machine(machine)))
    print_json({"file": str(out)}) if json else typer.echo(f"wrote {out}")


def modules(json: Json = False) -> None:
    """The library of modules that machines are assembled of."""
    from rds.machines.library import library

    found = library().values()
    if json:
        keys = ("kind", "title", "source", "joint", "travel", "speed")
        print_json({module.name: {key: getattr(module, key) for key in keys} for module in found})
        return
    for module in found:
        sides = "; ".join(map(str, module.interfaces.values()))
        typer.echo(f"{module.name:16} {module.kind:10} {module.joint:3} {module.title}\n{'':16} {sides}")


def is_machine(file: Path) -> bool:
    """Whether a TOML file describes a machine, and no model."""
    from rds.core.toml_file import read_toml

    with refusals():
        return isinstance(read_toml(file)[0].get("axis"), dict)


def check_machine(file: Path, json: bool, axes: int | None) -> None:
    """The verdict on a machine's file, printed; exit code 1 where it is no machine."""
    with refusals():
        from rds.core.errors import InputError
        from rds.machines import load_machine
        from rds.machines.configuration import verdict

        if axes is not None:
            raise InputError(f"--axes {axes} is for a coupled controller, and this is a machine's file", str(file))
        machine = load_machine(str(file))
        _check_motions(machine)
        judged = verdict(machine)
    _show_verdict(judged, json, notes=[*machine.too_fast(machine.axes), *machine.unlinked()])


def _check_motions(machine: Machine) -> None:
    """InputError for parameters of an axis that no model takes, or with which the machine could not be served."""
    from rds.core.errors import InputError
    from rds.models import library_model
    from rds.models.machine_axis import MachineParameters
    from rds.models.stepper_axis import StepperParameters

    for axis in machine.axes.values():
        where = f"{machine.path}, [axis.{axis.name}"
        if axis.model:
            try:
                library_model(**axis.model)
            except InputError as error:
                raise InputError(str(error), f"{where}.model]") from error
        if axis.machine:
            kind = StepperParameters if axis.module.get("motor") == "stepper" else MachineParameters
            kind.from_table(axis.machine, f"{where}.machine]")


def _show_verdict(judged: Verdict, json: bool, first: str = "", notes: Sequence[str] = ()) -> None:
    if json:
        print_json({**judged.to_json(), "notes": [*notes]})
    else:
        if first:
            typer.echo(first)
        typer.echo(f"{judged.machine}: {'a machine' if judged.ok else 'no machine'}")
        marks = {True: "ok", False: "no", None: "–"}
        for check in judged.checks:
            typer.echo(f"  {marks[check.passed]:3} {check.name:12} {check.text}")
        for note in notes:
            typer.echo(f"note: {note}")
    raise typer.Exit(0 if judged.ok else 1)


def _values(text: str, option: str) -> dict[str, float]:
    """NAME=VALUE,... as numbers by name; InputError for anything else."""
    from rds.core.errors import InputError

    found: dict[str, float] = {}
    for part in text.split(","):
        name, equals, value = (word.strip() for word in part.partition("="))
        try:
            number = float(value)
        except ValueError:
            number = float("nan")
        if not (name and equals) or not abs(number) < float("inf"):
            raise InputError(f"{option} {part!r} must be NAME=NUMBER, as in X=10,A=30")
        if name in found:
            raise InputError(f"{option} names {name} twice, {found[name]:g} and {number:g}; name it once")
        found[name] = number
    return found


def _pose(text: str, upright: Any) -> Any:
    from rds.core.errors import InputError
    from rds.machines.kinematics.kinematics import pose
    from rds.machines.kinematics.transform import transformation

    given = {name.lower(): value for name, value in _values(text, "--pose").items()}
    if unknown := [name for name in given if name not in "xyzijkabc" or len(name) != 1]:
        raise InputError(f"--pose has no {unknown[0]!r}; it has x, y, z and i, j, k or a, b, c")
    by_vector, by_angles = (any(name in given for name in names) for names in ("ijk", "abc"))
    if by_vector and by_angles:
        raise InputError("--pose has a direction (i, j, k) and angles (a, b, c); give one of them")
    direction = upright
    if by_vector:
        direction = [given.get(name, 0.0) for name in "ijk"]
    elif by_angles:
        direction = transformation([given.get(name, 0.0) for name in "abc"] + [0.0] * 3)[:3, 2]
    return pose([[given.get(name, 0.0) for name in "xyz"]], direction)[0]


def _outside(names: tuple[str, ...], values: Any, limits: Any) -> str:
    for name, value, (low, high) in zip(names, values, limits, strict=True):
        if not low <= value <= high:
            return f"{name} = {value:g} is outside its limits, {low:g} to {high:g}"
    return ""


def check_out(path: Path, ending: str | tuple[str, ...], force: bool) -> None:
    from rds.core.errors import InputError

    if not path.name.endswith(ending):
        wanted = ending if isinstance(ending, str) else ", ".join(ending)
        raise InputError(f"--out {path.name!r} must end with {wanted}")
    if path.exists() and not force:
        raise InputError("there is such a file already; choose another name, or overwrite it with --force", str(path))


def write_made(path: Path, text: str) -> None:
    from rds.core.atomic import write_whole

    write_whole(path, text.encode())
