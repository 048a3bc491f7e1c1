"""The drivers' contract over the serial line, as the CAN dialects keep it; and what goes wrong on a real one."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from rds.bus.modules.dcs import frames
from rds.bus.modules.dcs.drivers import DcsDrivers, exchange_time
from rds.bus.modules.dcs.frames import Info, Mode, Status
from rds.bus.modules.dcs.port import is_there
from rds.bus.modules.dcs.server import PtyEnd, serve
from rds.bus.modules.server_process import end_server, start_server
from rds.core.errors import InputError, MachineError
from rds.machines import load_machine

from .conftest import Bench, Served

pytestmark = pytest.mark.realtime
Server = Callable[..., Served]


@pytest.fixture
def drivers(served: Server) -> Callable[..., DcsDrivers]:
    def make(axes: str = "XYZ", **options: object) -> DcsDrivers:
        return DcsDrivers(load_machine("starmill"), list(axes), timeout=2.0, **options)  # type: ignore[arg-type]

    return make


def cycle(drivers: DcsDrivers, voltages: list[float], times: int) -> list[float]:
    found: list[float] = []
    for _ in range(times):
        due = time.monotonic() + 0.01
        found = drivers.exchange()
        drivers.write(voltages)
        time.sleep(max(0.0, due - time.monotonic()))
    return found


def test_voltages_move_axes_and_what_acts_is_told(served: Server, drivers: Callable[..., DcsDrivers]) -> None:
    served()
    d = drivers()
    try:
        d.start()
        assert d.exchange() == [0.0, 0.0, 0.0]
        assert d.write([1.0, -1.0, 0.0]) == (0.0, 0.0, 0.0)  # what the tick before sent
        d.exchange()
        acting = d.write([1.0, -1.0, 0.0])
        assert acting == pytest.approx((1.0, -1.0, 0.0), abs=frames.VOLTS_PER_UNIT)
        x, y, z = cycle(d, [1.0, -1.0, 0.0], 30)
        assert x > 0.3 and y < -0.3 and z == 0.0
        assert x == pytest.approx(-y, abs=0.02)
    finally:
        d.close()


def test_a_dry_run_moves_nothing(served: Server, drivers: Callable[..., DcsDrivers]) -> None:
    served()
    d = drivers(dry_run=True)
    try:
        d.start()
        assert cycle(d, [5.0, 5.0, 5.0], 20) == [0.0, 0.0, 0.0]
    finally:
        d.close()


def test_a_converter_beyond_what_a_frame_carries_is_refused_at_the_start() -> None:
    machine = load_machine("starmill")
    with pytest.raises(InputError, match="its converter gives 12 V, and a frame on a serial line carries 10 V"):
        DcsDrivers(replace(machine, converter=replace(machine.converter, range=12.0)))


def test_a_host_that_reads_nothing_does_not_hold_the_units_up() -> None:
    end = PtyEnd("deaf", 38_400)
    writing = threading.Thread(target=lambda: [end.write(bytes(4096)) for _ in range(100)], daemon=True)
    writing.start()
    writing.join(10.0)
    assert not writing.is_alive()
    end.close()


def test_a_second_host_is_refused(served: Server, drivers: Callable[..., DcsDrivers]) -> None:
    served()
    d = drivers()
    try:
        d.start()
        with pytest.raises(MachineError, match="another host commands it; stop that one"):
            drivers()
    finally:
        d.close()


def test_nobody_there_is_told() -> None:
    with pytest.raises(MachineError, match=r"there is no serial line starmill; start the machine \(rds machine serve"):
        DcsDrivers(load_machine("starmill"))


def test_a_wrong_baud_rate_is_told(
    served: Server, drivers: Callable[..., DcsDrivers], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rds.bus.modules.dcs.drivers._STARTING", 0.3)
    served(baud=57_600)
    d = drivers(baud=115_200)
    try:
        with pytest.raises(
            MachineError, match=r"no answer from X \(unit 2\), Y \(unit 3\), Z \(unit 4\) on bus serial"
        ):
            d.start()
    finally:
        d.close()


def test_a_unit_that_resets_ends_the_run(served: Server, drivers: Callable[..., DcsDrivers]) -> None:
    line = served()
    d = drivers()
    try:
        d.start()
        cycle(d, [1.0, 0.0, 0.0], 3)
        line.do("unit 2 reset")
        with pytest.raises(MachineError, match=r"X \(unit 2\) .* has been reset in the run; its position is lost"):
            cycle(d, [1.0, 0.0, 0.0], 300)
    finally:
        d.close()


@pytest.mark.parametrize(("hand", "named"), [("cut", "X|Y|Z"), ("unit 3 off", "Y")])
def test_what_falls_silent_is_named(served: Server, drivers: Callable[..., DcsDrivers], hand: str, named: str) -> None:
    line = served()
    d = drivers()
    d._timeout = 0.02
    try:
        d.start()
        line.do(hand)
        with pytest.raises(MachineError, match=rf"no answer from ({named}) \(unit \d\).* on bus serial:starmill"):
            cycle(d, [0.0, 0.0, 0.0], 300)
        assert d.counters.cut > 0  # nobody moved by positions that were not known
    finally:
        d.close()


def test_noise_costs_answers_and_no_run(served: Server, drivers: Callable[..., DcsDrivers]) -> None:
    served(noise=2e-3, seed=5)
    d = drivers()
    d._timeout = 0.02
    try:
        d.start()
        cycle(d, [0.5, 0.5, 0.5], 90)
        assert d.counters.missing > 0 and d.counters.damaged > 0
    finally:
        d.close()


def test_too_slow_a_line_is_refused() -> None:
    assert exchange_time(38_400, 3) == pytest.approx((14 + 21) * 10 / 38_400 + 3 * 250e-6)
    with pytest.raises(InputError, match=r"at 19200 bit/s, more than 80% of the sample period of 10 ms"):
        DcsDrivers(load_machine("starmill"), baud=19_200)


def test_voltage_ends_when_frames_end(bench: Callable[..., Bench]) -> None:
    b = bench(baud=115_200)
    b.port.write(frames.encode(Info(Mode.SETUP), frames.setup_body(0.01, 1)))
    b.port.sleep(0.02)
    b.port.write(frames.encode(Info(Mode.VOLTAGES), frames.voltage_words([2.0])))
    b.port.sleep(1.0)
    report = b.host.inquire(2)
    assert report.status & Status.WATCHDOG and not report.status & Status.MOVING
    assert report.counts == pytest.approx(2.0 * 2.0 * 0.025 / 0.01, abs=1)  # two and a half periods


def test_a_killed_machine_is_told_and_leaves_no_link(runtime_directory: Path) -> None:
    server = start_server("dcs", "starmill", "killed")
    d = DcsDrivers(load_machine("starmill"), ["X"], channel="killed", timeout=0.02)
    try:
        d.start()
        server.kill()
        server.wait()
        with pytest.raises(MachineError, match=r"the serial line failed|no answer from X"):
            cycle(d, [0.0], 300)
    finally:
        d.close()
        end_server(server)
    assert not is_there("killed")
    assert not list(runtime_directory.rglob("*.tty"))


def test_one_channel_is_served_once(served: Server) -> None:
    served()
    with pytest.raises(MachineError, match="serial line starmill is served already"):
        serve(load_machine("starmill"))


def test_a_machine_of_seven_axes_is_on_no_serial_line(tmp_path: Path) -> None:
    """A frame has places for six. It was said to be on the built-in bus, where such a machine may well be."""
    axis = '[axis.{}]\nnode = {}\nunit = "mm"\ntravel = [0, 9]\nresolution = 0.01\n[axis.{}.model]\n{}\n'
    model = 'name = "linear-axis"\ntau = 0.02\nK = 1.0'
    axes = "".join(axis.format(name, node, name, model) for node, name in enumerate("XYZABCU", 2))
    file = tmp_path / "seven.toml"
    file.write_text(f'name = "seven"\nsample_period = 0.01\n[converter]\nrange = 10.0\nbits = 16\n{axes}')
    with pytest.raises(MachineError, match=r"on a serial line did not start: .*7 axes; a frame has places for 6"):
        start_server("dcs", str(file), "seven")
