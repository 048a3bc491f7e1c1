"""A part program carried out by move commands to distributed modules, in virtual time and on a bus."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from oacs_bench import MACHINE
from typer.testing import CliRunner

from rds.bus.hub.command import Command, commanded
from rds.bus.modules.oacs.codes import Acknowledges, Code, Kind, Move
from rds.bus.modules.oacs.link import acknowledgement
from rds.bus.modules.oacs.messages import Decoded, Frame, decode, encode
from rds.bus.modules.oacs.module import OacsModule
from rds.bus.modules.oacs.module_data import read_modules
from rds.bus.modules.oacs.module_group import ModuleGroup, VirtualPort
from rds.cli.main import app
from rds.core.errors import InputError, MachineError
from rds.machines import load_machine
from rds.nc.language.dialect import Dialect
from rds.nc.run.module_moves import MovesRun, moves_report, require_start, run_moves
from rds.nc.run.node_methods import nodes_of, run_together
from rds.nc.setup import Setup

# the thesis's program, section 7.3, as it is printed
P001 = "P001;\nN10 G01 X0 Y0;\nN20 G01 X100 A25 F100 S1000;\nN30 M00;\nN40 M02;\n"
HOLE = "G21 G90\nS300 M3\nG0 X2\nG1 Z-1 F60\nG4 P1\nG0 Z0\nM5\nM2\n"
EXACT = {"controller": "PI", "Kp": 8.0, "Ki": 20.0, "integral_limit": 1000.0, "output_low": -255.0} | {
    "sample_time": 0.02,
    "tolerance": 2.0,
}
DATA = read_modules(MACHINE)
END_OF_TURNING = acknowledgement(Acknowledges.START, last=True)


def carried_out(folder: Path, text: str, **options: Any) -> MovesRun:
    path = folder / "part.ngc"
    path.write_text(text)
    return run_moves(path, MACHINE, **options)


def test_the_program_of_the_thesis_by_its_controllers(tmp_path: Path) -> None:
    """Speeds of tables 18 and O35; X within its 1 mm (table 14), A too far by counts that its board loses (9.5)."""
    setup = Setup(options=Dialect(program_numbers=True, default_feed=True))
    told: list[str] = []
    run = carried_out(tmp_path, P001, setup=setup, tell=told.append)
    x, a = run.moves
    assert (x.line, x.axis, x.end, a.line, a.axis, a.end) == (3, "X", 100.0, 3, "A", 25.0)
    assert x.seconds == pytest.approx(100.0 / 130.0 * 60.0, abs=1.0)
    assert a.seconds == pytest.approx(25.0 * 67 / 63 / 314.0 * 60.0, abs=1.0)
    assert run.seconds == pytest.approx(x.seconds, abs=0.1), "the two axes move together"
    assert x.gauge is not None and 0.0 < x.gauge - 100.0 < 1.0 and x.arrived == pytest.approx(x.gauge, abs=0.01)
    assert a.gauge is not None and abs(a.off) < 0.2, "by its own counts it is there..."
    assert a.gauge - a.arrived == pytest.approx(25.0 * 4 / 63, abs=0.6), "... of which it has lost four of 67"
    assert told == list(run.notes) and len(told) == 2, "before it moves"
    report = moves_report(run, tmp_path / "part.ngc", {"machine": "mrmt-oacs"})
    said = " ".join(report.findings)
    assert "within its 1 mm" in said and "A ends 1." in said
    assert "F is not obeyed" in said and "M0 and M1" in said


def test_lines_come_one_after_the_other_and_a_virtual_run_repeats(tmp_path: Path) -> None:
    run = carried_out(tmp_path, HOLE)
    assert [(move.line, move.axis, move.start, move.end) for move in run.moves] == [
        (3, "X", 0.0, 2.0),
        (4, "Z", 0.0, -1.0),
        (6, "Z", -1.0, 0.0),
    ]
    assert run.seconds == pytest.approx(sum(move.seconds for move in run.moves) + 1.0, abs=0.8), "and the dwell"
    assert carried_out(tmp_path, HOLE) == run
    told = dict(run.positions["X"])
    assert list(told.values()) == sorted(told.values()) and max(told.values()) == pytest.approx(2.0, abs=0.3)
    assert max(told) < min(at for at, place in run.positions["Z"] if place < -0.05), "Z goes when X has arrived"


def test_a_controller_that_brakes_ends_on_the_point(tmp_path: Path) -> None:
    """The thesis's own, whose output is never negative, coasts beyond it."""
    line = "G21 G90 F60\nG1 X2\nM2\n"
    (own,), (exact,) = carried_out(tmp_path, line).moves, carried_out(tmp_path, line, tuning=EXACT).moves
    assert 0.03 < own.off < 0.6
    assert exact.off == pytest.approx(0.0, abs=2.5 / 169) and exact.gauge == pytest.approx(2.0, abs=0.03)


@pytest.mark.parametrize(
    ("text", "options", "says"),
    [
        ("G21 G90 F60\nG1 X1\nG18 G2 X3 Z0 I1 K0\nM2\n", {}, "line 3 is an arc, and a move command takes an axis"),
        ("G21 G90\nG4 P1\nM2\n", {}, "nothing in it moves"),
        (HOLE, {"mode": "emulation"}, "a move command has no dry run"),
        (HOLE, {"channel": "bench"}, "a simulation has modules of its own"),
        (HOLE, {"tuning": {"noise": 1.0}}, "--option noise is none of method moves"),
        (HOLE, {"tuning": {"controller": "PDI"}}, "must be PI or PID"),
        (HOLE, {"tuning": {"Kp": -1.0}}, "Kp = -1.0 must be a number from 0"),
    ],
)
def test_what_move_commands_cannot_do_is_refused(tmp_path: Path, text: str, options: Any, says: str) -> None:
    with pytest.raises(InputError, match=says):
        carried_out(tmp_path, text, **options)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("G21 G90\nG0 X2\nM0\nG0 X4\nM2\n", r"line 3 waits for somebody .* line 4 moves on"),
        ("G21 G90\nM1\nG4 P1\nG0 X4\nM2\n", r"line 2 waits for somebody .* line 4 moves on"),
        ("G21 G90\nT1 M6\nG0 X2\nM2\n", r"line 2 changes the tool"),
        ("G21 G90\nG0 X2\nT1 M6\nG0 X4\nM2\n", r"line 3 changes the tool"),
    ],
)
def test_real_modules_do_not_move_on_where_somebody_has_to_be_waited_for(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "tools.tbl").write_text("T1 P1 D4\n")
    setup = Setup(tools=tmp_path / "tools.tbl")
    with pytest.raises(InputError, match=says):
        carried_out(tmp_path, text, mode="implementation", channel="nobody", setup=setup)
    assert len(carried_out(tmp_path, text, setup=setup).moves) == text.count("X"), "in a simulation no hands are near"


def test_a_stop_at_the_end_of_a_program_is_no_hindrance(channel: str, tmp_path: Path) -> None:
    with pytest.raises(MachineError, match="did not answer"):  # the bus is empty, and was asked
        carried_out(tmp_path, "G21 G90\nG0 X2\nM0\nM2\n", mode="implementation", channel=channel)


def test_a_bit_rate_is_a_number() -> None:
    with pytest.raises(InputError, match="bitrate = '500k' must be a whole number from 10000"):
        nodes_of(load_machine("mini-cnc"), options={"bitrate": "500k"})


def test_modules_that_another_run_commands_are_left_alone(channel: str, tmp_path: Path) -> None:
    """By move commands, and by method A of modules on CAN."""
    cnc = load_machine("mini-cnc")
    (tmp_path / "line.ngc").write_text("G21 G90 F300\nG1 X1\nM2\n")
    with Command(channel):
        with pytest.raises(MachineError, match=f"another run commands the machine on channel '{channel}'"):
            carried_out(tmp_path, HOLE, mode="implementation", channel=channel)
        for mode in ("emulation", "implementation"):
            with pytest.raises(MachineError, match="another run commands"):
                run_together(
                    *(nodes_of(cnc), ["A"], tmp_path / "line.ngc", cnc, Setup()),
                    mode=mode,
                    channel=channel,
                )
    with pytest.raises(MachineError, match="did not answer"):  # it has gone
        carried_out(tmp_path, HOLE, mode="implementation", channel=channel)
    assert not commanded(channel), "a run that fails gives the command back"


class Bench:
    """X, Z and the drill in virtual time."""

    def __init__(self) -> None:
        self.modules = {
            name: OacsModule(MACHINE.axis(name), DATA[name], slot, MACHINE.sample_period, 0.0, serial=slot)
            for slot, name in enumerate(("X", "Z", "drill"))
        }
        self.port = VirtualPort(list(self.modules.values()))
        self.host = ModuleGroup(self.port, {DATA[name].node: name for name in self.modules})


def test_axes_that_stand_off_the_start_are_told_before_anything_moves() -> None:
    """Also one that the program never moves, as `G0 X0` off the zero does not; Z, which may be in a hole, first."""
    bench = Bench()
    data = {name: DATA[name] for name in bench.modules}
    start = dict.fromkeys("XZ", 0.0)
    require_start(bench.host, data, start)
    bench.host.to({data["X"].node: 3.0, data["Z"].node: -3.0}, 60.0)
    with pytest.raises(
        MachineError, match=r"^Z stands at -3\S* mm, X stands at 3\S* mm, .*begins with Z at 0, X at 0"
    ) as e:
        require_start(bench.host, data, start)
    away, across = (f"`rds module {data[name].node} move --to 0`" for name in "ZX")
    assert f"Z first, in the Jog panel or by {away}, then {across}" in str(e.value)
    bench.host.rest(2.0)
    assert bench.modules["X"].plant.true_position == pytest.approx(3.0, abs=0.6), "it was not taken there"
    bench.host.to({data["Z"].node: 0.0}, 60.0)
    with pytest.raises(MachineError, match=r"^X stands at 3"):
        require_start(bench.host, data, start)


def test_another_hosts_motion_that_began_at_the_same_time_is_not_taken_for_ours() -> None:
    """X went to 10 mm for the other host, and `to` 2 mm returned as if it had arrived; the drill likewise."""
    bench, node = Bench(), DATA["X"].node
    bench.port.send(encode("Command", node, Code=Code.MOVE, Move=Move.TO_POINT, Argument=10_000))
    with pytest.raises(MachineError, match="X was told to move to 2: it is in motion"):
        bench.host.to({node: 2.0}, 60.0)
    drill = next(data.node for data in DATA.values() if data.kind == Kind.TOOL)
    bench.port.send(encode("Command", drill, Code=Code.MOVE, Move=Move.START, Direction=1, Argument=200_000))
    with pytest.raises(MachineError, match="it is in motion"):
        bench.host.turn(drill, 300.0)
        bench.host.rest(1.0)


def test_what_is_refused_later_is_another_hosts() -> None:
    bench, node = Bench(), DATA["X"].node
    disturbed = []

    def disturb(at: float, message: Decoded) -> None:
        if at > 2.0 and not disturbed:
            disturbed.append(at)
            bench.port.send(encode("Command", node, Code=Code.MOVE, Move=Move.TO_POINT, Argument=1_000))

    bench.host.listen = disturb
    bench.host.to({node: 10.0}, 60.0)
    assert disturbed and bench.modules["X"].plant.true_position == pytest.approx(10.0, abs=0.6)


def test_a_tool_turns_at_its_speed_until_it_is_stopped() -> None:
    bench = Bench()
    node = next(data.node for data in DATA.values() if data.kind == Kind.TOOL)
    bench.host.turn(node, 300.0)
    bench.host.rest(5.0)  # longer than the 2 s of a silent host
    assert bench.modules["drill"].plant.velocity == pytest.approx(300.0, rel=0.05)
    bench.host.turn(node, -200.0)
    bench.host.rest(3.0)
    assert bench.modules["drill"].plant.velocity == pytest.approx(-200.0, rel=0.08)
    bench.host.turn(node, 0.0)
    bench.host.rest(3.0)
    assert bench.modules["drill"].plant.velocity == pytest.approx(0.0, abs=0.5)


def test_a_tool_that_does_not_come_to_rest_is_named() -> None:
    bench = Bench()

    class Deaf(VirtualPort):
        """Hears nothing of the end of a tool's turning."""

        def hear(self, until: float) -> Decoded | None:
            while (said := super().hear(until)) is not None and END_OF_TURNING(said):
                pass
            return said

    node = DATA["drill"].node
    host = ModuleGroup(Deaf(list(bench.modules.values())), {DATA[name].node: name for name in bench.modules})
    host.turn(node, 300.0)
    with pytest.raises(MachineError, match=r"^drill was told to stop and did not say within 60 s that it is at rest"):
        host.turn(node, 0.0)


def test_a_module_that_refuses_is_named_and_all_stop() -> None:
    bench = Bench()
    bench.modules["Z"].set_emergency_input(True, 0.0)
    with pytest.raises(MachineError, match=r"^Z was told to move to 3: .*emergency stop"):
        bench.host.to({DATA["X"].node: 20.0, DATA["Z"].node: 3.0}, 60.0)
    bench.host.rest(1.0)
    assert bench.modules["X"].plant.voltage == 0.0 and abs(bench.modules["X"].plant.velocity) == 0.0
    assert bench.modules["X"].plant.true_position < 1.0


def test_a_stop_that_does_not_reach_one_module_is_told_to_the_others() -> None:
    bench = Bench()

    class Broken(VirtualPort):
        """Sends nothing to X, once it is broken."""

        broken = False

        def send(self, frame: Frame) -> None:
            if self.broken and decode(*frame).node == DATA["X"].node:
                raise MachineError("the bus is broken")
            super().send(frame)

    port = Broken(list(bench.modules.values()))
    host = ModuleGroup(port, {DATA[name].node: name for name in ("X", "drill")})
    host.turn(DATA["drill"].node, 300.0)
    host.rest(1.0)
    port.broken = True
    with pytest.raises(MachineError, match="the bus is broken"):
        host.stop()
    port.broken = False
    host.rest(1.0)
    assert bench.modules["drill"].plant.voltage == 0.0


def test_a_module_that_is_not_there_is_named_and_all_stop() -> None:
    bench = Bench()
    host = ModuleGroup(bench.port, {DATA["X"].node: "X", DATA["A"].node: "A"})
    with pytest.raises(MachineError, match=r"^A was told to move to 3 and did not answer within 0.5 s"):
        host.to({DATA["X"].node: 20.0, DATA["A"].node: 3.0}, 60.0)
    host.rest(1.0)
    assert bench.modules["X"].plant.voltage == 0.0 and bench.modules["X"].plant.true_position < 2.0


def test_a_module_that_is_lost_in_the_middle_is_named_within_seconds_and_the_others_stop() -> None:
    """Whether it moves or not: a long way would be waited for otherwise, and a plug may be out."""
    for lost in ("X", "Z"):
        bench = Bench()

        class Unplugged(VirtualPort):
            """Its module `node` is cut off 3 s after the beginning."""

            node = DATA[lost].node

            def hear(self, until: float) -> Decoded | None:
                while (said := super().hear(until)) is not None and self.now() > 3.0:
                    if self.node not in (said.node, said.fields.get("BoardID")):
                        break
                return said

        host = ModuleGroup(Unplugged(list(bench.modules.values())), {DATA[name].node: name for name in bench.modules})
        with pytest.raises(MachineError, match=rf"^{lost} has fallen silent: it answered nothing for 2 s; see to"):
            host.to({DATA["X"].node: 100.0}, 200.0)
        assert 4.5 < host.port.now() < 6.0
        host.rest(0.5)
        assert bench.modules["X"].plant.voltage == 0.0


def test_a_tool_that_stops_by_itself_ends_the_motion() -> None:
    bench = Bench()
    bench.host.turn(DATA["drill"].node, 300.0)
    bench.modules["drill"].set_emergency_input(True, bench.port.now())
    with pytest.raises(MachineError, match="drill does not turn any more"):
        bench.host.to({DATA["X"].node: 20.0}, 60.0)


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("hole.ngc").write_text(HOLE)
    words = ["nc", "run", "hole.ngc", "--method", "moves"]
    ran = CliRunner().invoke(app, [*words, "--option", "tolerance=1", "--out", "moved", "--json"])
    assert ran.exit_code == 0, ran.output
    told = json.loads(ran.stdout)
    table = told["tables"][0]
    rows = [dict(zip(table["columns"], row, strict=True)) for row in table["rows"]]
    assert [(row["line"], row["axis"], row["to"]) for row in rows] == [(3, "X", 2), (4, "Z", -1), (6, "Z", 0)]
    assert all(row["time [s]"] > 0.2 for row in rows)
    assert Path("moved/module-moves-positions.png").stat().st_size > 5000
    assert Path("moved/module-moves.html").is_file() and Path("moved/module-moves-moves.csv").is_file()
    refused = CliRunner().invoke(app, [*words, "--motion", "plan", "--baud", "9600"])
    assert refused.exit_code == 2 and "--motion, --baud is of methods A, B and C" in refused.stderr


@pytest.mark.realtime
def test_served_modules_carry_the_same_out(serve: Any, channel: str, tmp_path: Path) -> None:
    serve()
    text = "G21 G90\nS300 M3\nG0 X1\nG1 Z-1.5 F60\nM5\nM2\n"
    run = carried_out(tmp_path, text, mode="implementation", channel=channel)
    virtual = carried_out(tmp_path, text)
    assert [(m.line, m.axis, m.end, m.gauge) for m in run.moves] == [(3, "X", 1.0, None), (4, "Z", -1.5, None)]
    for real, meant in zip(run.moves, virtual.moves, strict=True):
        assert real.arrived == pytest.approx(meant.arrived, abs=0.1)
    with pytest.raises(InputError, match="modules that are served already keep their tuning"):
        carried_out(tmp_path, text, mode="implementation", channel=channel, tuning={"Kp": 2.0})
    with pytest.raises(
        MachineError, match=r"^Z stands at -1.\d+ mm, .*the program begins with Z at 0.*nothing has moved"
    ):
        carried_out(tmp_path, "G21 G90\nG0 X2\nM2\n", mode="implementation", channel=channel)
