"""Methods A, B and C: the same part, its contour errors as numbers, and everything that can go wrong on the way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf, nan, pi
from pathlib import Path

import numpy as np
import pytest

from rds.bus.modules import segments
from rds.bus.modules.dcs import commands, dry_run, methods
from rds.bus.modules.dcs.frames import Status
from rds.core.errors import InputError, MachineError
from rds.machines import load_machine
from rds.nc.run.serial_methods import METHODS, MethodRun, run_method
from rds.nc.run.serial_motion import serial_motion
from rds.nc.run.serial_records import write_records
from rds.nc.run.serial_report import methods_report

from .conftest import Bench

Maker = Callable[..., Bench]
HALF = 0.5 * 2**0.5 * 10.0  # µm: half a BLU in X and in Y
CIRCLE = "G21 G17 G90 F480 G61\nG1 X3\nG3 X3 Y0 I-3 J0\nG1 X0\nM2\n"
PYRAMID_EDGE = "G21 G17 G90 F600 G61.1\nG1 X5 Y5 Z-8\nG1 X10 Y0 Z0\nG1 X15 Y5 Z-8\nG1 X20 Y0 Z0\nM2\n"


def runs(tmp_path: Path, program: str, names: Sequence[str] = "ABC", **words: object) -> dict[str, MethodRun]:
    file = tmp_path / "part.ngc"
    file.write_text(program)
    machine = load_machine("starmill")
    how = {"motion": words.pop("motion", "plan")}
    made = serial_motion(file, machine, **how)  # type: ignore[arg-type]
    return {name: run_method(name, made, machine, **words) for name in names}  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def circle(tmp_path_factory: pytest.TempPathFactory) -> dict[str, MethodRun]:
    return runs(tmp_path_factory.mktemp("circle"), CIRCLE)


def test_a_circle_is_kept_to_half_a_step_by_every_method(circle: dict[str, MethodRun]) -> None:
    for name, run in circle.items():
        if name == "B":
            continue  # it starts without a ramp
        assert run.path_error.max() * 1e3 <= HALF + 1e-6, name
        assert run.error.max() * 1e3 <= HALF + 1.0, name
        assert not any(run.lost.values()), name


def test_a_dwell_takes_its_time_by_every_method(tmp_path: Path) -> None:
    dwells = "G21 G90 G61 F240\nG4 P0.1\nG1 X1\nG4 P0.2\nG4 P0.1\nG1 X2\nG3 X2 I-0.4 F120\nG4 P0.05\nM2\n"
    for name, run in runs(tmp_path, dwells).items():
        x = run.position[:, 0]
        assert 95 < (x < 0.005).sum() < 200, name  # ms, of 100; a planned motion begins slowly
        assert 295 < (abs(x - 1.0) < 0.005).sum() < 450, name
        assert run.error.max() < 0.02 and not any(run.lost.values()), name


def test_the_spindle_turns_by_every_method(tmp_path: Path) -> None:
    turned = "G21 G90 G61 F240\nM3 S1000\nG4 P1\nG1 X1\nM4 S500\nG4 P1\nG1 X0\nM5\nG4 P2\nM2\n"
    for name, run in [*runs(tmp_path, turned).items(), *runs(tmp_path, turned, ["C-thesis"]).items()]:
        forward, backward = run.speed[run.position[:, 0] > 0.9].max(), run.speed.min()
        assert forward == pytest.approx(1000.0, rel=0.02) and backward == pytest.approx(-500.0, rel=0.02), name
        assert abs(run.speed[-1]) < 10.0 and not any(run.astray.values()), name
        assert [file.name for file in write_records([run], tmp_path)] == ["path.csv", f"gauges-{name}.csv"]
    assert (tmp_path / "gauges-A.csv").read_text().startswith("time_s,x_mm,y_mm,z_mm,segment,spindle_rev_min\n")


@pytest.mark.parametrize(("mode", "longest"), [("A", 0.1), ("C", 15.0), ("C-thesis", 16.0)])
def test_a_host_that_dies_leaves_no_spindle_turning(bench: Maker, mode: str, longest: float) -> None:
    """At the end of what it holds; while buffers are filled again, after ten seconds."""
    b = bench(baud=115_200)
    dies = b.port.now() + 8.0
    full = np.full((3000, 1), 127)
    plain = b.port.write

    def write(data: bytes) -> None:
        if b.port.now() > dies:
            raise MachineError("dead")
        plain(data)

    b.port.write = write  # type: ignore[method-assign]
    with pytest.raises(MachineError, match="dead"):
        if mode == "A":
            methods.method_a(b.host, full, {5: 3})
        else:
            methods.method_c(b.host, full, [5], as_thesis=mode == "C-thesis")
    speed = b.position(5)
    assert speed > 1900.0
    b.port.sleep(b.port.now() + longest + 4.0)
    assert abs(b.position(5)) < 1.0


@pytest.mark.parametrize("method", ["B", "C"])
def test_units_stand_where_the_host_is_interrupted(bench: Maker, method: str) -> None:
    """They hold buffers of many seconds."""
    b = bench(baud=115_200)
    plain = b.port.sleep

    def sleep(until: float) -> None:
        if b.port.now() > 3.0:
            b.port.sleep = plain  # type: ignore[method-assign]
            raise KeyboardInterrupt
        plain(until)

    b.port.sleep = sleep  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        if method == "B":
            methods.method_b(b.host, {2: [segments.line(0.0, 900.0, 1500)]})
        else:
            methods.method_c(b.host, np.ones((1500, 1), np.int64), [2])
    plain(b.port.now() + 0.5)
    there = b.position(2)
    plain(b.port.now() + 5.0)
    assert 0.0 < there == b.position(2)


def test_a_full_buffer_is_sent_nothing_that_it_cannot_take(bench: Maker) -> None:
    for method, size in (
        (lambda b: methods.method_c(b.host, steps(2400), UNITS), 1),
        (lambda b: methods.method_b(b.host, {unit: [segments.line(0.0, 9.0, 20)] * 120 for unit in UNITS}), 24 / 20),
    ):
        b = bench(baud=115_200)
        method(b)
        inquiries = 3 * 2 * 250  # 25 s, ten looks a second at each unit
        assert b.line.down.bytes < 3 * 2400 * size * 1.1 + inquiries


def test_method_b_needs_next_to_nothing_of_the_line(circle: dict[str, MethodRun]) -> None:
    assert circle["B"].bytes < circle["C"].bytes / 2 < circle["A"].bytes / 4
    assert circle["B"].path_error.max() * 1e3 <= HALF + 1e-3


def test_a_thesis_buffer_rests_between_two_fillings_and_a_cyclic_one_does_not(tmp_path: Path) -> None:
    long = "G21 G90 F120 G61\nG1 X30\nM2\n"  # 15 s: 1500 steps, and some
    file = tmp_path / "long.ngc"
    file.write_text(long)
    machine = load_machine("starmill")
    made = serial_motion(file, machine)
    assert len(made.pulses) > 1500
    thesis, ours = (run_method(name, made, machine, baud=38_400) for name in ("C-thesis", "C"))
    # a second time three buffers of 0.395 s, and their checksums
    assert thesis.course.pauses == pytest.approx(3 * 0.3953, rel=0.03)
    assert ours.course.pauses == 0.0
    assert ours.course.ended - ours.course.begun == pytest.approx(len(made.pulses) * 0.01)


def test_z_loses_steps_where_its_speed_changes_suddenly_and_none_where_it_is_planned(tmp_path: Path) -> None:
    sudden = runs(tmp_path, PYRAMID_EDGE, "C", motion="constant")["C"]
    planned = runs(tmp_path, PYRAMID_EDGE, "C", motion="plan")["C"]
    assert sudden.lost["Z"] != 0 and sudden.error.max() > 0.03
    assert not any(planned.lost.values()) and planned.error.max() < 0.02


def test_clocks_that_drift_are_corrected(bench: Maker) -> None:
    angle = np.arange(4001) / 4000 * 2 * pi
    places = np.rint(np.column_stack([1500 * np.cos(angle) - 1500, 1500 * np.sin(angle)])).astype(int)
    errors = {}
    for corrected in (True, False):
        b = bench(baud=115_200, drift={"X": 300, "Y": -300})
        if not corrected:
            b.host.clock = lambda begun: None  # type: ignore[method-assign]
        rows: list[tuple[float, ...]] = []
        b.line.watch, b.line.next_look = lambda at, there, rows=rows: rows.append(tuple(there)), 0.0  # type: ignore[misc]
        methods.method_c(b.host, np.diff(places, axis=0), [2, 3])
        there = np.array(rows)
        errors[corrected] = np.abs(np.hypot(there[:, 0] + 15.0, there[:, 1]) - 15.0).max()
    assert errors[True] < 0.009 < 0.02 < errors[False]  # mm; 600 ppm of 40 s at 2.4 mm/s are 0.06 mm


def test_equations_of_a_circle_come_back_to_its_start() -> None:
    x = segments.arc(1000.0, 0.0, 0.0, 2 * pi, 5000, True)
    y = segments.arc(0.0, 1000.0, 0.0, 2 * pi, 5000, False)
    for node, end in ((x, 1000.0), (y, 0.0)):
        equations = segments.Equations(segments.unpack(node.pack()))
        for _ in range(5000):
            last = equations.next()
        assert last == pytest.approx(end, abs=0.01)
    equations = segments.Equations(segments.unpack(segments.arc(4000.0, 0.0, 0.0, 2 * pi, 25133, True).pack()))
    for _ in range(25133):  # 40 mm at 60 mm/min: the step's cosine as a float32 would end 2.9 BLU outside
        last = equations.next()
    assert last == pytest.approx(4000.0, abs=0.01)
    # the thesis's cos Δθ ≅ 1 (equation 6.10) would end at a radius larger by √(1 + Δθ²)^n
    assert (1 + (2 * pi / 5000) ** 2) ** 2500 * 1000.0 == pytest.approx(1004.0, abs=0.1)


def steps(count: int = 800) -> np.ndarray:
    return np.ones((count, 3), int)


def during(b: Bench, at: float, do: Callable[[], None]) -> None:
    """Something happens on the line at an instant."""
    done = []

    def look(now: float, there: list[float]) -> None:
        if now >= at and not done:
            done.append(now)
            do()

    b.line.watch, b.line.next_look = look, 0.0


UNITS = [2, 3, 4]
SLOTS = {2: 0, 3: 1, 4: 2}


def test_a_unit_that_resets_in_the_middle_ends_the_motion_of_all(bench: Maker) -> None:
    for method in (
        lambda b: methods.method_a(b.host, steps(), SLOTS),
        lambda b: methods.method_c(b.host, steps(), UNITS),
        lambda b: methods.method_b(b.host, {unit: [segments.line(0.0, 240.0, 800)] for unit in UNITS}),
    ):
        b = bench(baud=115_200)
        unit = b.line.unit(3)
        assert unit is not None
        during(b, 2.0, lambda: unit.power_cycle(b.port.now()))  # noqa: B023
        with pytest.raises(MachineError, match=r"Y \(unit 3\) has been reset in the middle of the motion"):
            method(b)
        b.port.sleep(b.port.now() + 0.1)
        b.line.positions(b.port.now())
        assert not any(each.motor.moving for each in b.line.units)


def test_a_cut_cable_or_a_dead_unit_ends_the_motion_and_is_named(bench: Maker) -> None:
    for do, named in ((lambda b: setattr(b.line, "cut", True), "[XYZ]"), (lambda b: b.line.remove(4, 2.0), "Z")):
        for method in (
            lambda b: methods.method_a(b.host, steps(), SLOTS),
            lambda b: methods.method_c(b.host, steps(), UNITS),
        ):
            b = bench(baud=115_200)
            during(b, 2.0, lambda: do(b))  # noqa: B023
            with pytest.raises(MachineError, match=rf"no answer from {named} \(unit"):
                method(b)


def test_a_host_that_is_too_slow_starves_the_buffer_and_is_told(bench: Maker) -> None:
    b = bench(baud=115_200)
    sleep = b.port.sleep
    b.port.sleep = lambda until: sleep(until + (20.0 if b.port.now() > 3.0 else 0.0))  # type: ignore[method-assign]
    with pytest.raises(MachineError, match=r"X \(unit 2\) ran empty at step \d+ of 4000: the host was too slow"):
        methods.method_c(b.host, steps(4000), UNITS)


def test_a_line_that_is_too_slow_for_the_motion_is_told(bench: Maker) -> None:
    b = bench(baud=1200)
    with pytest.raises(MachineError, match="ran empty at step"):
        methods.method_c(b.host, steps(4000), UNITS)


def test_noise_is_retried_and_moves_nothing_wrong(bench: Maker) -> None:
    b = bench(baud=115_200, noise=1e-3, seed=4)
    course = methods.method_c(b.host, steps(3000), UNITS)
    assert course.retries > 0
    assert [b.host.inquire(unit).counts for unit in UNITS] == [3000, 3000, 3000]


def test_on_a_line_of_much_noise_pieces_of_a_buffer_become_small(bench: Maker) -> None:
    """Of pieces of 200 bytes, 87 % are damaged; a smaller one may follow one that was taken and had no answer."""
    b = bench(baud=115_200, noise=1e-2, seed=3)
    methods.method_c(b.host, np.ones((400, 1), np.int64), [2])
    b.port.sleep(b.port.now() + 0.1)
    assert b.position(2) == pytest.approx(4.0, abs=1e-9)


@pytest.mark.parametrize("wrong", [nan, inf, 1e30])
@pytest.mark.parametrize("arc", [True, False])
def test_equations_that_lead_nowhere_end_the_steps(bench: Maker, wrong: float, arc: bool) -> None:
    """A host of one's own may send anything; the units of all other axes are in the same process."""
    b = bench(baud=115_200)
    straight = segments.line(0.0, 5.0, 5)
    data = straight.pack() + straight._replace(arc=arc, a=wrong, b=wrong, own=5.0).pack() + straight.pack()
    assert b.host.data(2, commands.SEGMENT, 0, data).step == len(data)
    b.host.go()
    b.port.sleep(b.port.now() + 0.5)
    assert b.host.inquire(2).status & Status.EMPTY
    assert b.position(2) == pytest.approx(0.05) or arc  # an angle of any size is one


def test_a_go_that_nobody_heard_is_said_again_and_one_that_some_heard_is_told(bench: Maker) -> None:
    def deaf(b: Bench, units: Sequence[int]) -> None:
        """The first go does not reach these units."""
        write = b.port.write

        def written(data: bytes) -> None:
            if data[0] != commands.GO:
                write(data)
                return
            b.port.write = write  # type: ignore[method-assign]
            for unit in set(UNITS) - set(units):
                found = b.line.unit(unit)
                assert found is not None
                found.program.start(b.port.now())

        b.port.write = written  # type: ignore[method-assign]

    b = bench(baud=115_200)
    deaf(b, UNITS)
    methods.method_c(b.host, steps(20), UNITS)
    b.port.sleep(b.port.now() + 0.1)
    assert [b.position(unit) for unit in UNITS] == pytest.approx([0.2] * 3)
    b = bench(baud=115_200)
    deaf(b, [3])
    with pytest.raises(MachineError, match=r"^Y \(unit 3\) did not begin; check power"):
        methods.method_c(b.host, steps(20), UNITS)


def test_steps_that_noise_took_from_a_frame_are_told(tmp_path: Path) -> None:
    """Method A sends increments once: one in fifty frames damaged leaves units short, and the host says so."""
    found = runs(tmp_path, CIRCLE, "AC", noise=2e-3, seed=3)
    assert any(found["A"].astray.values()) and not any(found["C"].astray.values())
    for name, steps_off in found["A"].astray.items():
        assert found["A"].lost[name] == steps_off  # the motors made all that they got
    report = methods_report(list(found.values()), Path("part.ngc"), {"machine": "starmill"})
    assert report.title == "part.ngc on starmill by methods A, C"
    said = report.findings
    assert sum("did not get" in sentence for sentence in said) == 1
    assert not any("lost by motors" in sentence for sentence in said)


def test_what_friction_leaves_of_a_servo_motor_is_no_lost_step(tmp_path: Path) -> None:
    file = tmp_path / "part.ngc"
    file.write_text("G21 G90 G61 F240\nG1 X2 Y1\nM2\n")
    machine = load_machine("three-axis-mill")
    run = run_method("C", serial_motion(file, machine), machine, baud=115_200)
    assert any(run.lost.values()) and not run.astray
    assert not any("lost" in said for said in methods_report([run], file, {"machine": machine.name}).findings)


def test_an_arc_whose_end_is_off_its_circle_is_noted(tmp_path: Path) -> None:
    """0.1 % of the radius is allowed: 40 µm at 40 mm, which the difference equations leave to the next segment."""
    file = tmp_path / "part.ngc"
    file.write_text("G21 G90 F600\nG3 X-40 Y40.038 I-40 J0\nG1 Y40\nM2\n")
    made = serial_motion(file, load_machine("starmill"))
    (note,) = (each for each in made.notes if "off the circle" in each)
    assert note.startswith("the arc of line 2 ends 38 µm off")


def test_what_cannot_be_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "part.ngc"
    file.write_text(CIRCLE)
    machine = load_machine("starmill")
    with pytest.raises(InputError, match="motion 'fast' is unknown; known: plan, constant"):
        serial_motion(file, machine, motion="fast")
    still = tmp_path / "still.ngc"
    still.write_text("G21 G90\nG4 P0.1\nM2\n")
    with pytest.raises(InputError, match=r"still\.ngc.*nothing in it moves"):
        serial_motion(still, machine)
    made = serial_motion(file, machine)
    with pytest.raises(InputError, match="method 'D' is unknown; known: A, B, C, C-thesis"):
        run_method("D", made, machine)
    with pytest.raises(InputError, match="method C-thesis has no dry run"):
        run_method("C-thesis", made, machine, mode="emulation")
    with pytest.raises(InputError, match="the serial line has no option bitrate"):
        run_method("A", made, machine, bitrate=5)
    assert METHODS == ("A", "B", "C", "C-thesis", "B-free", "C-free")


@pytest.mark.realtime
def test_buffers_on_a_pseudo_terminal_make_the_same_part(tmp_path: Path) -> None:
    program = "G21 G17 G90 F300 G61\nG1 X.4\nG3 X.4 Y0 I-.4 J0\nG1 X0\nM2\n"
    for name, run in runs(tmp_path, program, "BC", mode="implementation").items():
        assert run.error.max() * 1e3 <= 25.0, name
        assert run.path_error.max() * 1e3 <= HALF + 1e-3 and run.bytes > 0


@pytest.mark.realtime
def test_an_emulation_equals_the_simulation_and_its_line_works_dry(tmp_path: Path) -> None:
    program = "G21 G17 G90 F300 G61\nG1 X0.5\nG1 X0\nM2\n"
    simulated = runs(tmp_path, program)
    for name, run in runs(tmp_path, program, mode="emulation").items():
        assert np.array_equal(run.position, simulated[name].position) and run.lost == simulated[name].lost
        assert run.course.missing < run.course.steps * len(UNITS)  # units answered; how many, the computer decides


def test_a_dry_run_moves_nothing_and_notices_a_reset(bench: Maker) -> None:
    nodes = {unit: [segments.line(0.0, 120.0, 400)] * 3 for unit in UNITS}
    data = {unit: bytes([1]) * 2000 for unit in UNITS}
    for dry in (
        lambda b: dry_run.calls(b.host, UNITS, 400),
        lambda b: dry_run.filled(b.host, data, 400),
        lambda b: dry_run.filled(b.host, methods.segment_bytes(nodes), 400, nodes),
    ):
        b = bench(baud=115_200)
        course = dry(b)
        assert course.ended - course.begun == pytest.approx(4.0) and course.missing == 0
        assert [b.position(unit) for unit in UNITS] == [0.0, 0.0, 0.0]
        b = bench(baud=115_200)
        unit = b.line.unit(3)
        assert unit is not None
        during(b, 2.0, lambda: unit.power_cycle(b.port.now()))  # noqa: B023
        with pytest.raises(MachineError, match=r"Y \(unit 3\) has been reset"):
            dry(b)
