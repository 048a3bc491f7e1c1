"""One new part of each kind that docs/architecture.md says how to add: what its files hold, and how a user meets it."""

from __future__ import annotations

from pathlib import Path
from textwrap import dedent
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent


class Line(NamedTuple):
    """A line that a table gets: behind another one, which it has once."""

    after: str
    new: str


class Part(NamedTuple):
    """A part called `name`. `files` are those that the document names, with NAME in place of the name: the text of a
    new file, or the lines that one gets.

    `use` is Python that a user would write, or a test in place of him; its variable `found` must become `expected`.
    """

    name: str
    files: dict[str, str | list[Line]]
    use: str
    expected: object


RUN = """
from pathlib import Path
import rds
Path("e.toml").write_text('''axis = "X"
duration = 0.1
{words}
''')
result = rds.Experiment.from_toml("e.toml").run({mode})
"""
COMMAND = """
import rds
from typer.testing import CliRunner
from rds.cli.main import app
done = CliRunner().invoke(app, {arguments})
assert done.exit_code < 2, done.output
"""
CONSTANT = "[reference]\nkind = 'constant'\nvalue = 1.0\n"


def run(words: str, found: str, mode: str = "") -> str:
    """An experiment file with these words, run."""
    return RUN.format(words=words, mode=f"mode={mode!r}" if mode else "") + f"found = {found}\n"


def command(arguments: list[str], found: str) -> str:
    """A command of `rds`."""
    return COMMAND.format(arguments=arguments) + f"found = {found}\n"


def text(source: str) -> str:
    """The text of a file."""
    return dedent(source).lstrip("\n")


PARTS = {
    "controller": Part(
        "two-volts",
        {
            "rds/controllers/NAME.py": text("""
                from rds.core.options import read_options
                from rds.core.quantities import Quantity
                from rds.core.types import Controller, Source

                OPTIONS = {"volts": Quantity("the voltage", "V")}

                def law(position, velocity, acceleration, y, state, c):
                    return c[0], state

                def control(t, r, y, state, params):
                    return law(r[0], r[1], r[2], y, state, params["coefficients"])

                def make(axis_model, T, converter_range, *, unit="mm", **options):
                    given = {"volts": 2.0} | read_options(options, OPTIONS, "controller 'two-volts'")
                    params = given | {"coefficients": (given["volts"],)}
                    return Controller(control, (), params, Source("two-volts"), tunable=OPTIONS)
            """),
            "rds/controllers/__init__.py": [
                Line(
                    '        "p": "rds.controllers.proportional",', '        "two-volts": "rds.controllers.two_volts",'
                )
            ],
        },
        run(f"{CONSTANT}[controller]\nname = 'two-volts'\nvolts = 3.0", "set(result['X_command'].tolist())"),
        "{3.0}",
    ),
    "model": Part(
        "integrator",
        {
            "rds/models/NAME.py": text("""
                from rds.core.options import read_options
                from rds.core.quantities import Quantity
                from rds.core.types import Model, Source

                PARAMETERS = {"K": Quantity("gain", "(mm/s)/V")}

                def advance(x, u, T, params):
                    return (x[0] + params["K"] * u * T,)

                def make(**params):
                    values = read_options(params, PARAMETERS, "integrator")
                    return Model(advance, (0.0,), values, source=Source("integrator"))
            """),
            "rds/models/__init__.py": [
                Line('        "spindle": "rds.models.spindle",', '        "integrator": "rds.models.integrator",')
            ],
        },
        run(
            "[interface]\nquantization = false\n[signal]\nkind = 'constant'\nvalue = 5.0\n"
            "[model]\nname = 'integrator'\nK = 2.0",
            "float(round(result['X_measured'][-1], 9))",
        ),
        "0.99",
    ),
    "interpolator": Part(
        "one-jump",
        {
            "rds/interpolators/NAME.py": text("""
                import numpy as np

                OPTIONS = {}

                def interpolate(segment, T, params):
                    still = np.zeros(len(segment.start))
                    yield np.array(segment.end), still, still
            """),
            "rds/interpolators/__init__.py": [
                Line(
                    '        "linear": "rds.interpolators.linear",', '        "one-jump": "rds.interpolators.one_jump",'
                )
            ],
        },
        command(
            ["interpolate", "--line", "0,0:30,40", "--feed", "600", "--method", "one-jump", "--out", "."],
            "rds.open_result('interpolation.csv')['X_reference'].tolist()",
        ),
        "[0.0, 30.0]",
    ),
    "acceleration filter": Part(
        "two-steps",
        {
            "rds/interpolators/NAME.py": text("""
                import numpy as np

                MULTIPLIERS = False
                OPTIONS = {}
                DEFAULTS = {"time": 0.0}

                def weights(T, params):
                    return np.array([1.0, 3.0])
            """),
            "rds/interpolators/acceleration.py": [
                Line(
                    '        "linear": "rds.interpolators.linear_acceleration",',
                    '        "two-steps": "rds.interpolators.two_steps",',
                )
            ],
        },
        "from rds.interpolators.acceleration import make_acceleration\n"
        "found = make_acceleration('two-steps').weights(0.001).tolist()\n",
        "[0.25, 0.75]",
    ),
    "signal": Part(
        "ramp",
        {
            "rds/references/NAME.py": text("""
                import numpy as np

                from rds.core.quantities import Quantity
                from rds.references.signal import Signal

                OPTIONS = {"slope": Quantity("the speed", "V/s or mm/s")}

                def ramp(slope: float) -> Signal:
                    def motion(t):
                        return slope * t, np.full_like(t, slope), np.zeros_like(t)

                    return Signal("ramp", motion, settings={"slope": slope})
            """),
            "rds/references/__init__.py": [
                Line("from rds.references.periodic import", "from rds.references.ramp import ramp"),
                Line('        "square": square,', '        "ramp": ramp,'),
            ],
        },
        run(
            "[reference]\nkind = 'ramp'\nslope = 10.0\n[controller]\nname = 'p'",
            "float(round(result['X_reference'][-1], 9)), [f.name for f in signal_fields('ramp', 'mm')], "
            "'\"slope\"' in schema_text('experiment')",
        )
        .replace("import rds\n", "import rds\nfrom rds.cli.schema import schema_text\n")
        .replace("import rds\n", "import rds\nfrom rds.panels.equipment.fields import signal_fields\n", 1),
        "(0.99, ['signal.slope'], True)",
    ),
    "machine": Part(
        "tiny",
        {
            "rds/machines/NAME.toml": (ROOT / "rds" / "machines" / "mini-cnc.toml")
            .read_text(encoding="utf-8")
            .replace('name = "mini-cnc"', 'name = "tiny"')
        },
        command(["machine", "list"], "'tiny: Mini CNC' in done.output"),
        "True",
    ),
    "mode": Part(
        "late-simulation",
        {
            "rds/modes/NAME.py": text("""
                \"\"\"A simulation whose voltages act a sample later, as those of a machine do.\"\"\"

                from dataclasses import replace

                from rds.modes import simulation
                from rds.modes.parts import SimulatedAxes, loop

                def build(plan, drivers):
                    axes = SimulatedAxes(plan)
                    waiting = [[0.0] * len(plan.axes)]

                    def write(voltages):
                        waiting.append(list(voltages))
                        return waiting.pop(0)

                    return loop(plan, axes.measure, write, axes.follow)

                MODE = replace(simulation.MODE, name="late-simulation", build=build)
            """),
            "rds/modes/__init__.py": [
                Line(
                    '        SIMULATION: "rds.modes.simulation",',
                    '        "late-simulation": "rds.modes.late_simulation",',
                )
            ],
        },
        run(
            f"{CONSTANT}[controller]\nname = 'p'\nPgain = 3.0",
            "(result.mode, float(result['X_voltage'][0]), "
            "bool(abs(result['X_voltage'][1:] - result['X_command'][:-1]).max() < 0.005))",
            "late-simulation",
        ),
        "('late-simulation', 0.0, True)",
    ),
    "dialect": Part(
        "mirrored",
        {
            "rds/bus/modules/NAME/__init__.py": '"""The mirrored dialect: axes mounted the other way round."""\n',
            "rds/bus/modules/NAME/dialect.py": text("""
                from rds.bus.modules.rds.dialect import IDENTIFIERS, SERVED_WITH, answers

                def drivers():
                    from rds.bus.modules.rds.drivers import AxisDrivers

                    class MirroredDrivers(AxisDrivers):
                        def exchange(self):
                            return [-position for position in super().exchange()]

                    return MirroredDrivers
            """),
            "rds/bus/modules/NAME/server.py": text("""
                import sys

                from rds.bus.modules import server_program
                from rds.bus.modules.rds.server import serve

                def main(arguments=None):
                    return server_program.run(serve, __spec__.name, "serve mirrored modules", arguments)

                if __name__ == "__main__":
                    sys.exit(main())
            """),
            "rds/bus/modules/dialects.py": [
                Line(
                    '        "rds": "rds.bus.modules.rds.dialect",',
                    '        "mirrored": "rds.bus.modules.mirrored.dialect",',
                )
            ],
        },
        run(
            "[signal]\nkind = 'constant'\nvalue = 5.0\n[bus]\ndialect = 'mirrored'",
            "bool(result['X_measured'][-1] < -0.1)",
            "system-test",
        ),
        "True",
    ),
    "format of bus logs": Part(
        "candump",
        {
            "rds/bus/tools/log_formats.py": [
                Line(
                    "FORMATS: dict[str, LogFormat] = {",
                    '    ".candump": LogFormat("candump -L", "all", "can:CanutilsLogWriter", '
                    'rules=log_lines.CANDUMP, reader="can:CanutilsLogReader"),',
                )
            ],
        },
        "import can\nfrom rds.bus.tools.logs import LogFile, LogWriter\n"
        "from rds.panels.data.state import DataState\nfrom rds.panels.session.session import Session\n"
        "log = LogWriter('a.candump')\n"
        "log.write(can.Message(arbitration_id=0x22, is_extended_id=False, data=bytes(8), timestamp=1.0))\n"
        "log.close()\nfound = [bytes(message.data) for message in LogFile('a.candump')] == [bytes(8)]\n"
        "found = found, 'a.candump' in DataState(Session('.')).files()\n"
        + command(["bus", "record", "--help"], "*found, '.candump' in done.output")
        + command(["data", "describe", "a.candump", "--json"], "*found, 'answer_2.position' in done.output"),
        "(True, True, True, True)",
    ),
    "format of logged data": Part(
        "jsonl",
        {
            "rds/identification/logs/NAME_table.py": text("""
                import json

                import numpy as np

                from rds.identification.logs.table import Column, Table

                def read_jsonl(path):
                    rows = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
                    columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
                    return Table(path, "jsonl", {name: Column(name, None, columns[name]) for name in columns})
            """),
            "rds/identification/logs/tables.py": [
                Line(
                    "FORMATS: tuple[DataFormat, ...] = (",
                    '    DataFormat("lines of JSON", (".jsonl",), _late("jsonl_table", "read_jsonl")),',
                )
            ],
        },
        "from pathlib import Path\n"
        "Path('a.jsonl').write_text('\\n'.join('{\"time\": %s, \"x\": %s}' % (k / 100, k * k) for k in range(50)))\n"
        "from rds.panels.data.state import DataState\nfrom rds.panels.session.session import Session\n"
        + command(
            ["data", "describe", "a.jsonl", "--json"],
            "'\"format\": \"jsonl\"' in done.output, 'a.jsonl' in DataState(Session('.')).files()",
        ),
        "(True, True)",
    ),
    "report": Part(
        "heights",
        {
            "rds/results/reports/NAME.py": text("""
                from rds.results.reports.content import Report, Table

                SETTINGS = {}

                def report(files, settings):
                    rows = [[float(line)] for file in files for line in file.read_text().split()]
                    table = Table("All", ["h [mm]"], rows)
                    return Report("heights", "Heights", [str(file) for file in files], {}, [table], {}, [])
            """),
            "rds/results/reports/__init__.py": [
                Line(
                    '        "accuracy": "rds.results.reports.accuracy",',
                    '        "heights": "rds.results.reports.heights",',
                )
            ],
        },
        "from pathlib import Path\nPath('h.txt').write_text('1.5 2.5')\n"
        + command(["report", "heights", "h.txt", "--json"], "'[[1.5], [2.5]]' in done.output"),
        "True",
    ),
    "criterion": Part(
        "first-error",
        {
            "rds/grading/criteria/NAME.py": text("""
                from rds.grading.criteria.measuring import over_axes

                MEANING = "the error at the first sample"
                UNIT = None
                MORE_IS_WORSE = True
                FOR = ("controller",)
                OPTIONS = {}

                def measure(run, options):
                    return over_axes(run, lambda axis: abs(float(run.result[f"{axis}_reference"][0])))
            """),
            "rds/grading/criteria/__init__.py": [
                Line('                "mean-error",', '                "first-error",')
            ],
        },
        "from rds.grading.assignment.assignment import read_assignment\n"
        "from rds.grading.cases.case import CaseRun\n"
        "import rds\n"
        "from pathlib import Path\n"
        "Path('control.py').write_text('def control(t, r, y, state, params):\\n    return 0.0, state\\n')\n"
        "Path('assignment.toml').write_text('''title = 'T'\nkind = 'controller'\nfiles = ['control.py']\n"
        "secret = 'long enough'\n"
        "solution = 'control.py'\n"
        "[[case]]\nname = 'c'\naxis = 'X'\nduration = 0.1\n[case.reference]\nkind = 'constant'\nvalue = 1.5\n"
        "[[criterion]]\nname = 'n'\nkind = 'first-error'\ncase = 'c'\npoints = 4\n"
        "full = 1.0\nnone = 2.0\nunit = 'mm'\n''')\n"
        "(criterion,) = read_assignment('assignment.toml').criteria\n"
        "columns = {'time': [0.0, 0.1], 'X_reference': [1.5, 1.5]}\n"
        "result = rds.Result(columns, {}, {'axes': ['X'], 'sample_period': 0.1})\n"
        "found = criterion.score(criterion.measure(CaseRun('c', 0, result)), 'c').score\n",
        "2.0",
    ),
    "gradebook": Part(
        "plain-list",
        {
            "rds/grading/exports/NAME.py": text("""
                from rds.grading.exports.exported import Exported

                FILE = "list.txt"
                USES = ()

                def export(finished, wanted):
                    wanted.refuse_all_but(USES, "plain-list")
                    lines = [f"{grade.student} {grade.score:g}\\n" for grade in finished.to_hand_on]
                    return Exported({FILE: "".join(lines).encode()}, students=len(lines))
            """),
            "rds/grading/exports/__init__.py": [
                Line(
                    '            "nbgrader": "rds.grading.exports.nbgrader",',
                    '            "plain-list": "rds.grading.exports.plain_list",',
                )
            ],
        },
        command(["grade", "export", "batch", "--to", "plain-list", "-o", "list.txt"], "open('list.txt').read()"),
        "'ada 26\\n'",
    ),
    "panel": Part(
        "hello",
        {
            "rds/panels/NAME/__init__.py": '"""The panel that says hello."""\n',
            "rds/panels/NAME/panel.py": text("""
                import ipywidgets as widgets

                NAME = "hello"
                TITLE = "Hello"
                SUMMARY = "Says hello"
                HELP = "readme"

                def build(shell):
                    return widgets.HTML(f"hello from {shell.session.machine}")
            """),
            "rds/panels/registry.py": [
                Line('        "menu": "rds.panels.page.menu",', '        "hello": "rds.panels.hello.panel",')
            ],
        },
        "import rds.panels\n"
        "def inside(widget):\n"
        "    return [widget, *(each for child in getattr(widget, 'children', ()) for each in inside(child))]\n"
        "page = rds.panels.main('.', panel='hello')\n"
        "found = 'hello from mini-cnc' in [getattr(widget, 'value', None) for widget in inside(page)]\n",
        "True",
    ),
    "command": Part(
        "hello",
        {
            "rds/cli/NAME.py": text("""
                import typer

                def hello() -> None:
                    \"\"\"Say hello.\"\"\"
                    typer.echo("hello")
            """),
            "rds/cli/main.py": [
                Line("    grade_run,", "    hello,"),
                Line("app.command()(scan.scan)", "app.command()(hello.hello)"),
            ],
        },
        command(["hello"], "done.output"),
        "'hello\\n'",
    ),
}
