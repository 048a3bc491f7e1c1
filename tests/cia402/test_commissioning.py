"""A drive out of the box made ready: what is found, what is refused in time, and what is taken back."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from uuid import uuid4

import can
import canopen
import pytest
from typer.testing import CliRunner

from rds import Experiment
from rds.bus.modules.cia402 import first_motion
from rds.bus.modules.cia402.commissioned import Choices, experiment_text, machine_text
from rds.bus.modules.cia402.commissioning import Commissioned, CommissioningOptions, Declined, commission
from rds.bus.modules.cia402.examination import Units, gear_finding
from rds.bus.modules.cia402.identity import Identity, check_eds, keep_eds, kept_eds
from rds.bus.modules.cia402.lss import give_node_id
from rds.bus.modules.cia402.node import DriveNode
from rds.bus.modules.cia402.scan import scan
from rds.bus.modules.cia402.settings import read_settings
from rds.cli.main import app
from rds.core.errors import InputError, MachineError
from rds.machines import Machine, load_machine

from .conftest import Abort, Rig

T = 0.01  # s
VENDOR, PRODUCT = 0x1234, 0x77
Served = Callable[..., tuple[str, list[DriveNode]]]


class Operator:
    """Agrees to all but what has a word in it; notes what is said."""

    def __init__(self, refused: str = "\0", direction: int = 1):
        self.said: list[str] = []
        self.refused, self.direction = refused, direction

    def say(self, text: str) -> None:
        self.said.append(text)

    def agree(self, step: str) -> bool:
        self.said.append(step)
        return self.refused not in step

    def choose_direction(self, moved: int) -> int:
        return self.direction


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(first_motion, "_RISE", 1.0)
    monkeypatch.setattr(first_motion, "_REST", 0.1)


@contextmanager
def opened(channel: str) -> Iterator[can.BusABC]:
    with can.Bus(interface="virtual", channel=channel) as bus:
        yield bus


def made(channel: str, folder: Path, operator: Operator | None = None, **wishes: object) -> Commissioned:
    with opened(channel) as bus:
        return commission(
            bus, CommissioningOptions(node=2, period=T, **wishes), "bench", operator or Operator(), folder
        )  # type: ignore[arg-type]


@pytest.mark.realtime
def test_a_drive_out_of_the_box_is_made_ready(served: Served, tmp_path: Path) -> None:
    channel, nodes = served("X")
    operator = Operator(direction=-1)
    found = made(channel, tmp_path, operator, distance=20, keep_in_drive=True)
    assert (found.choices.mode, found.choices.counts, found.choices.direction) == ("csp", 1000.0, -1)
    assert 20 <= found.motion.moved < 200 and found.motion.agrees and 1 <= (found.motion.torque or 0) <= 100
    assert found.motion.increments == found.motion.moved
    assert nodes[0].drive.objects.values[0x6072, 0] == 1000  # written back
    nodes[0].drive.objects.reset()  # what it has kept: not the limit of the first motion
    assert nodes[0].drive.objects.values[0x6072, 0] == 1000
    table = tomllib.loads(experiment_text(found.choices, "bench.toml", {"channel": channel}))
    assert table["bus"]["cia402"]["axis"]["X"] == {"node": 2, "counts": 1000.0, "direction": -1}


@pytest.mark.realtime
@pytest.mark.parametrize(
    "quirk, said",
    [
        ("wrong-sign", "closed loops would run away"),
        ("wrong-gear", r"0\.1 position units per increment, and the motion showed 1"),
        ("closed-brake", "a brake that stays closed"),
    ],
)
def test_what_is_wrong_with_it_is_told_before_a_file_is_written(
    served: Served, tmp_path: Path, quirk: str, said: str
) -> None:
    channel, nodes = served("X", quirks=quirk)
    with pytest.raises(MachineError, match=said):
        made(channel, tmp_path, distance=20)
    assert not nodes[0].drive.operation.machine.state.name.startswith("OPERATION")
    assert nodes[0].drive.objects.values[0x6072, 0] == 1000


@pytest.mark.realtime
@pytest.mark.parametrize("says_its_type", [True, False])
def test_a_device_that_is_no_drive_is_refused_and_not_said_to_be_missing(tmp_path: Path, says_its_type: bool) -> None:
    channel = f"test-{uuid4().hex[:8]}"
    network = canopen.Network()
    network.connect(interface="virtual", channel=channel)
    try:
        device = network.create_node(2, canopen.ObjectDictionary())
        if says_its_type:
            device.data_store[0x1000] = {0: (401).to_bytes(4, "little")}
        with pytest.raises(
            MachineError, match=r"node 2 \(without a name\) is no CiA 402 drive: it has no statusword \(0x6041\)"
        ):
            made(channel, tmp_path)
    finally:
        network.disconnect()


@pytest.mark.realtime
def test_limits_at_zero_are_written_before_each_run(served: Served, tmp_path: Path) -> None:
    channel, nodes = served("X", quirks="zero-limits")
    found = made(channel, tmp_path, distance=20)
    assert nodes[0].drive.objects.values[0x6072, 0] == 1000
    assert (0x6072, 0, 1000) in found.choices.write and {entry[0] for entry in found.choices.write} == {0x6072, 0x607D}
    written = experiment_text(found.choices, "bench.toml", {})
    assert tomllib.loads(written)["bus"]["cia402"]["axis"]["X"]["write"][0] == [0x6072, 0, 1000]


@pytest.mark.realtime
def test_a_mapping_that_cannot_be_changed_is_used_as_it_is(served: Served, tmp_path: Path) -> None:
    channel, _ = served("X", quirks="fixed-mapping")
    found = made(channel, tmp_path, distance=20)
    assert found.choices.fixed_mapping and found.choices.mode == "csp" and found.motion.torque is None
    with pytest.raises(
        MachineError, match=r"no RPDO with the controlword and the target 0x6071.*RPDO 3: 0x6040:00, 0x607A"
    ):
        made(channel, tmp_path, mode="cst")


@pytest.mark.realtime
def test_a_drive_that_takes_speeds_alone_is_moved_by_a_speed(served: Served, tmp_path: Path) -> None:
    channel, _ = served("X", quirks="fixed-mapping")
    operator = Operator()
    found = made(channel, tmp_path, operator, distance=20, mode="csv")
    assert found.choices.mode == "csv" and found.motion.torque is None
    assert found.motion.moved == pytest.approx(20, abs=10) and any("by its velocity loop" in it for it in operator.said)


class OneWay:
    """Drivers of an axis that 40 ‰ move one way, and nothing moves back; what they were told, V."""

    def __init__(self) -> None:
        self.drives = [type("Drive", (), {"node": 2, "enabled": True})]
        self.told: dict[tuple[int, int], bytes] = {}
        self.written: list[float] = [0.0]
        self.at = 0.0

    def exchange(self) -> list[float]:
        self.at += 0.05 * (self.written[-1] > 0.4)
        return [self.at]

    def write(self, targets: list[float]) -> None:
        self.written += targets

    def ask_for(self, drive: object, index: int) -> None:
        """Nothing answers."""


def test_the_way_back_of_the_first_motion_keeps_to_its_torque(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(first_motion, "_RISE", 0.3)
    monkeypatch.setattr(first_motion, "_REST", 0.01)
    drivers = OneWay()
    found = first_motion._Bench(drivers, 1000.0, 0.001).pushed(40, 50, 0.01)  # type: ignore[arg-type]
    assert found.moved >= 40 and min(drivers.written) >= -0.5  # V: 50 ‰


def test_names_that_are_no_bare_keys_are_quoted_in_the_files(tmp_path: Path) -> None:
    choices = Choices('mill "1"', "Achse Ä", "mm", (-5.0, 5.0), 0.002, "csp", 2, 1000.0)
    path = tmp_path / "machine.toml"
    path.write_text(machine_text(choices, "node 2: Servo\r\n\x07"), encoding="utf-8")
    machine = load_machine(str(path))
    assert machine.name == 'mill "1"' and list(machine.axes) == ["Achse Ä"]
    table = tomllib.loads(experiment_text(choices, 'mill "1".toml', {}))
    assert table["axis"] == "Achse Ä" and table["bus"]["cia402"]["axis"]["Achse Ä"]["node"] == 2
    assert table["machine"] == 'mill "1".toml'


def test_a_no_ends_it_and_takes_back_what_was_changed(served: Served, tmp_path: Path) -> None:
    channel, nodes = served("X", quirks="zero-limits")
    for step in ("take 1000 counts", "map statusword", "software limits", "switch the power on"):
        with pytest.raises(Declined):
            made(channel, tmp_path, Operator(refused=step))
    values = nodes[0].drive.objects.values
    assert (values[0x6072, 0], values[0x607D, 1], values[0x607D, 2]) == (0, 0, 0)


def others_eds(folder: Path, vendor: int = VENDOR) -> Path:
    """Another vendor's EDS, with the line ends of another system."""
    text = files("rds.bus.modules.cia402").joinpath("axis.eds").read_text()
    text = text.replace("VendorNumber=0x0\n", f"VendorNumber={vendor:#x}\n").replace(
        "ProductNumber=0x402", f"ProductNumber={PRODUCT}"
    )
    path = folder / "servo.eds"
    path.write_text(text.replace("\n", "\r\n"))
    return path


def test_anothers_eds_is_checked_and_kept_for_the_next_time(served: Served, tmp_path: Path) -> None:
    channel, nodes = served("X")
    nodes[0].drive.objects.values |= {(0x1018, 1): VENDOR, (0x1018, 2): PRODUCT}
    operator, folder = Operator(refused="take 1000 counts"), tmp_path / "kept"
    with pytest.raises(Declined):
        made(channel, folder, operator, eds=others_eds(tmp_path))
    assert any("is kept for the next time" in said for said in operator.said)
    assert (folder / "00001234-00000077.eds").is_file()
    again = Operator(refused="take 1000 counts")
    with pytest.raises(Declined):
        made(channel, folder, again)
    assert not any("no EDS of this drive" in said for said in again.said)


def test_an_eds_of_another_drive_is_told(tmp_path: Path) -> None:
    identity = Identity(2, "servo", VENDOR, PRODUCT, 1, 7, None)
    assert not check_eds(others_eds(tmp_path), identity)
    assert "vendor 0x9999, and the drive says 0x1234" in check_eds(others_eds(tmp_path, 0x9999), identity)[0]
    keep_eds(others_eds(tmp_path), identity, tmp_path / "kept")
    assert kept_eds(identity, tmp_path / "kept") is not None and kept_eds(identity, tmp_path) is None
    (tmp_path / "no.eds").write_text("nothing")
    with pytest.raises(InputError, match="not a readable EDS"):
        check_eds(tmp_path / "no.eds", identity)


def test_units_come_from_the_objects_or_are_doubted() -> None:
    assert Units(10_000.0, 2.0, None).counts(5.0) == 4000.0
    assert Units(10_000.0, 1.0, 3600.0).counts(360.0) == 10.0
    assert Units(None, 1.0, None).counts(5.0) is None
    assert gear_finding(Units(1000.0, 1.0, 1000.0), 50, 51) is None
    assert gear_finding(Units(1000.0, 1.0, 500.0), 60, 30) is None
    assert gear_finding(Units(1000.0, 1.0, 500.0), 60, 60) is not None


def test_a_drive_without_a_node_id_gets_one_by_lss(served: Served) -> None:
    channel, nodes = served("X", quirks="no-node-id")
    assert not scan("virtual", channel)
    with opened(channel) as bus:
        found = give_node_id(bus, 17, wait=0.03)
        assert found == (0, 0x402, 0x10000, nodes[0].drive.serial)
        with pytest.raises(MachineError, match="no device without a node-ID"):
            give_node_id(bus, 18, wait=0.03)
    assert [drive.node for drive in scan("virtual", channel)] == [17]


def test_parameters_are_kept_until_they_are_restored(rig: Rig) -> None:
    rig.write(0x6065, 4321, 4)
    rig.write(0x1010, 0x65766173, 4, 1)
    rig.write(0x6065, 1, 4)
    rig.nmt(0x81)
    assert rig.read(0x6065) == 4321 and rig.read(0x1010, 1) == 1
    with pytest.raises(Abort):
        rig.write(0x1010, 1, 4, 1)
    rig.write(0x1011, 0x64616F6C, 4, 1)
    rig.nmt(0x81)
    assert rig.read(0x6065) != 4321


def test_the_mapping_of_a_table_is_one_of_two_words(machine: Machine) -> None:
    with pytest.raises(InputError, match='must be "dynamic" or "fixed"'):
        read_settings({"axis": {"X": {"mapping": "static"}}}, machine)


@pytest.mark.realtime
def test_the_command_writes_a_machine_and_an_experiment_that_can_be_read(
    served: Served, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    channel, _ = served("X")
    words = ["drive", "setup", "-o", str(tmp_path / "mill.toml"), "--yes", "--json", "--direction", "-1", "--lead", "2"]
    words += ["--interface", "virtual", "--channel", channel, "--sample-period", str(T), "--distance", "20"]
    done = CliRunner().invoke(app, words, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["choices"]["counts"] == 500.0
    machine = load_machine(str(tmp_path / "mill.toml"))
    assert machine.axis("X").resolution == pytest.approx(0.002)
    sine = tomllib.loads((tmp_path / "mill-sine.toml").read_text())
    assert sine["bus"]["cia402"]["axis"]["X"]["direction"] == -1 and sine["machine"] == "mill.toml"
    assert Experiment.from_toml(tmp_path / "mill-sine.toml").run("simulation").meta["ending"] == "done"
    assert CliRunner().invoke(app, words).exit_code == 2  # nothing is overwritten unasked
    assert "--unit inch must be mm or deg" in CliRunner().invoke(app, [*words, "--unit", "inch"]).output
