"""The command line: thin over the rest. What takes long to import is imported by the command that needs it.

Exit codes: 0 done; 1 ran, and a verdict or check failed; 2 bad input, explained on stderr.

A command is a function in a file of its own whose arguments say their help (typer); its docstring is the command's. It
is imported and added here, and named under one of the HEADINGS. What fails in it is raised as InputError inside
`common.refusals()`; one that writes has the decorator `common.writes_files`, one whose help lists parts of a library
the class `library.NamesParts`. Options of a bus, a program's reading or a cluster are one parameter, `BusOptions`,
`ProgramOptions` or `ClusterOptions`: `option_groups.grouped_options`, which is in `writes_files`, makes options of it.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from typer.core import TyperGroup
from typer.main import get_command_name
from typer.models import CommandInfo

from rds.bus.tools.mf4 import put_off_asammdf
from rds.cli import (
    analyse,
    bus,
    calibrate,
    cutting,
    data,
    design,
    docs,
    doctor,
    drive,
    estop,
    excite,
    fault,
    fit,
    forces,
    grade,
    grade_export,
    grade_lti,
    grade_review,
    grade_run,
    interpolate,
    jobs,
    jog,
    learn,
    library,
    machine_serve,
    machine_watch,
    machines,
    modules,
    nc,
    network,
    reports,
    robustness,
    scan,
    schema,
    validate,
)
from rds.cli.app import app as app_page
from rds.cli.common import (
    Explain,
    Json,
    ends_as_ctrl_c,
    explain,
    print_json,
    progress_bars,
    refusals,
    results_folder,
    say_notices,
    say_what_is_replaced,
    stdout_kept,
    writes_files,
)
from rds.cli.exchange import Events, Exchange, Yes, only_with_exchange, run_on, runs_json
from rds.cli.guard import guarded
from rds.core.errors import InputError
from rds.core.private_files import keep_process_private
from rds.modes import mode_names

# `rds --help` lists the commands in this order, under these headings: what a newcomer types first is at the top.
HEADINGS = {
    "Experiments": ("run", "compare", "check", "learn", "robustness", "demo", "app"),
    "Logged data, models and design": ("data", "excite", "fit", "validate", "design", "network"),
    "Part programs": ("nc", "interpolate", "forces", "cutting", "jobs"),
    "Machines and buses": ("machine", "scan", "jog", "estop", "doctor", "module", "drive", "bus"),
    "Grading": ("grade",),
    "Reference": ("library", "schema", "docs", "report"),
}
_ORDER = [name for names in HEADINGS.values() for name in names]


class _InOrder(TyperGroup):
    def list_commands(self, ctx: object) -> list[str]:
        return sorted(self.commands, key=lambda name: _ORDER.index(name) if name in _ORDER else len(_ORDER))


app = typer.Typer(
    cls=_InOrder,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Rapid development system for machine-tool axes: one controller file in simulation, emulation and "
    "implementation.",
    epilog="RDS_FILE_LIMITS=4 before a command makes the limits on files four times as large, for one that you trust.",
)
machine_app = typer.Typer(
    no_args_is_help=True, help="Machines: list, assemble, judge and draw them; serve one on a CAN bus."
)
app.add_typer(machine_app, name="machine")
app.add_typer(modules.module_app, name="module")
app.add_typer(bus.app, name="bus")
app.add_typer(drive.app, name="drive")
app.add_typer(nc.app, name="nc")
app.add_typer(network.app, name="network")
app.add_typer(jobs.app, name="jobs")
app.add_typer(data.app, name="data")
app.add_typer(cutting.app, name="cutting")
bus.app.command(cls=library.NamesParts)(analyse.analyse)
bus.app.command()(fault.fault)
bus.app.command()(fault.nodes)
app.command()(scan.scan)
app.command()(estop.estop)
app.command()(doctor.doctor)
app.command()(jog.jog)
app.command(cls=library.NamesParts)(reports.report)
app.command(cls=library.NamesParts)(fit.fit)
app.command()(library.library)
app.command()(excite.excite)
app.command()(validate.validate)
app.command()(forces.forces)
app.command("app")(app_page)
app.command()(docs.docs)
app.command()(schema.schema)
app.command(cls=library.NamesParts)(interpolate.interpolate)
app.command()(robustness.robustness)
app.command()(learn.learn)
app.add_typer(design.app, name="design")
app.add_typer(grade.app, name="grade")
grade.app.command()(grade_run.run)
grade.app.command(cls=library.NamesParts)(grade_export.export)
grade.app.command()(grade_lti.lti)
grade.app.command()(grade_review.review)
grade.app.command()(grade_review.regrade)
grade.app.command()(grade_review.best)
grade.app.command("late-days")(grade_review.late_days)
machine_app.command("from")(design.machine_from)
machine_app.command()(forces.power)
for command in (machines.new, machines.show, machines.pose, machines.joints, machines.urdf, machines.script):
    machine_app.command()(command)
machine_app.command()(calibrate.calibrate)
machine_app.command("modules")(machines.modules)
machine_app.command("watch")(machine_watch.watch)
machine_app.command("list")(machine_serve.list_machines)
machine_app.command("serve", cls=library.NamesParts)(machine_serve.serve)


def _print_version(is_asked: bool) -> None:
    if is_asked:
        from rds.core.installed import version  # it looks into installed packages, which no other command waits for

        typer.echo(f"rds {version()}")
        raise typer.Exit


@app.callback()
def _whole(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version and exit.")
    ] = False,
) -> None:
    pass


Out = Annotated[
    Path | None, typer.Option("--out", "-o", callback=results_folder, help="Folder for the results (made if missing).")
]


@app.command()
@writes_files
def demo(out: Out = None, json: Json = False) -> None:
    """Track a sine on X, Y and Z in all three modes, and show the published numbers beside ours."""
    with refusals(), stdout_kept(json), ends_as_ctrl_c():
        from rds.cli.demo import run_demo

        with progress_bars() as bar:
            outcome = run_demo(out or Path("demo"), bar)
    if json:
        print_json(outcome.to_json())
    else:
        from rds.cli.console import show_demo

        show_demo(outcome)
    for result in outcome.results.values():
        explain(result)
    raise typer.Exit(outcome.exit_code)


@app.command()
@writes_files
def run(
    experiment: Annotated[Path, typer.Argument(help="The experiment, a TOML file.")],
    mode: Annotated[
        str | None,
        typer.Option("--mode", "-m", help=f"Run in this mode instead of the file's own: {', '.join(mode_names())}."),
    ] = None,
    out: Out = None,
    exchange: Exchange = None,
    yes: Yes = False,
    events: Events = None,
    explain_verdict: Explain = False,
    json: Json = False,
) -> None:
    """Run an experiment and save its results: tables, plots and a report."""
    with refusals(), stdout_kept(json), ends_as_ctrl_c():
        from rds.modes.experiment.report import exit_code, run_and_save, run_json

        say_what_is_replaced(out)
        if exchange is None:
            only_with_exchange(yes, events)
            with progress_bars() as bar:
                made = [run_and_save(experiment, mode, out, bar(mode or "run"))]
        else:
            made = run_on(experiment, exchange, yes, events, json, mode, out)
    result, files = made[-1]
    if json:
        print_json(run_json(result, files) | ({} if exchange is None else runs_json(made)))
    else:
        from rds.cli.console import show_result

        for each in made:
            show_result(*each)
    for each in made:
        explain(each[0], is_shown=not json, in_full=explain_verdict)
    raise typer.Exit(exit_code(result))


@app.command()
def check(
    file: Annotated[
        Path, typer.Argument(help="A .py file with control(), derivatives(), ...; a model file; a machine.")
    ],
    sample_period: Annotated[
        float, typer.Option(help="Sample period that a call must fit into, s.", max=1000.0)
    ] = 0.001,
    axes: Annotated[
        int | None,
        typer.Option(
            min=1, max=64, help="The controller is a coupled one: it gets arrays, one value per axis.", metavar="N"
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Say which interface a file fills, and whether it keeps it; of a machine whether its links make one."""
    if file.suffix == ".toml" and machines.is_machine(file):
        machines.check_machine(file, json, axes)
    with refusals(), stdout_kept(json):
        if file.suffix == ".toml":
            from rds.identification.fit.run_model import check_model_file

            if axes is not None:
                raise InputError(f"--axes {axes} is for a coupled controller, and this is a model file", str(file))
            report = check_model_file(file, sample_period)
        else:
            from rds.checks import check_file

            report = check_file(file, sample_period, coupled=axes is not None, axes=axes or 2)
    if json:
        print_json(report.to_json())
    else:
        typer.echo(str(report))
    raise typer.Exit(0 if report.ok else 1)


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(help="A saved result: a folder or a CSV, MAT or Parquet file.")],
    b: Annotated[Path, typer.Argument(help="Another one.")],
    json: Json = False,
) -> None:
    """Compare two saved results without running them again."""
    with refusals():
        from rds.results import open_result
        from rds.results.compare import compare as compare_results

        comparison = compare_results(open_result(a), open_result(b))
    if json:
        print_json(comparison.to_json())
    else:
        typer.echo(str(comparison))


def _name_of(command: CommandInfo) -> str:
    return command.name or get_command_name(getattr(command.callback, "__name__", ""))


for heading, names in HEADINGS.items():
    for command_info in app.registered_commands:
        if _name_of(command_info) in names:
            command_info.rich_help_panel = heading
    for group in app.registered_groups:
        if group.name in names:
            group.rich_help_panel = heading


def main() -> None:
    """The console command `rds`. What runs a student's code in this process does so in a child of it."""
    put_off_asammdf()
    try:
        keep_process_private()
    except InputError as error:
        typer.echo(f"rds: {error}", err=True)
        sys.exit(2)
    say_notices()
    # a program in a terminal takes keys, which a process group in the background may not
    own = sys.argv[1:2] == ["fit"] and any(word.endswith(".py") for word in sys.argv)
    asks = "--exchange" in sys.argv and "--yes" not in sys.argv and sys.stdin.isatty()
    program = sys.argv[1:3] == ["nc", "run"] and not sys.stdin.isatty()
    if own or (sys.argv[1:2] in (["run"], ["robustness"]) and not asks) or program:
        guarded(_app)
    try:
        _app()
    except SystemExit as end:
        interrupt = getattr(end.__context__, "__cause__", None)  # typer makes a silent exit of it
        if isinstance(interrupt, KeyboardInterrupt):
            typer.echo(f"rds: stopped by {interrupt.args[0] if interrupt.args else 'Ctrl-C'}", err=True)
        raise


def _app() -> int:
    narrow(app, sys.argv[1:])
    app()
    return 0


def narrow(whole: typer.Typer, words: list[str]) -> None:
    """Leave in `whole` the command that `words` name, and one beside it, without which typer would ask for no name.

    Typer builds every command that there is before it looks at the words, which takes longer than most commands take.
    What names none is left whole, for the sentence that lists the commands.
    """
    named = words[0] if words else ""
    commands = [each for each in whole.registered_commands if _name_of(each) == named]
    groups = [each for each in whole.registered_groups if each.name == named]
    if commands or groups:
        beside = [each for each in whole.registered_commands if each not in commands][:1]
        whole.registered_commands, whole.registered_groups = [*commands, *beside], groups
    for group in groups:
        if group.typer_instance is not None:
            narrow(group.typer_instance, words[1:])


if __name__ == "__main__":
    main()
