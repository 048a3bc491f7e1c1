"""Commands on a bus of one's own: what its [bus] table says reaches them, the emergency stop above all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from rds.cli.buses import ChosenBus, bus_table_of, chosen_bus, machine_of
from rds.cli.main import app
from rds.core.errors import InputError

ADAPTER = '[bus]\ninterface = "virtual"\nchannel = 0\nbitrate = 250000\n'
SECONDS = ["--seconds", "0.1"]


def experiment(folder: Path, text: str) -> Path:
    """A file with this text, in a folder of its own."""
    path = folder / "experiment.toml"
    path.write_text(text)
    return path


def told(opened: list[dict[str, Any]]) -> set[tuple[Any, ...]]:
    """Interface, channel and bit rate of each bus that was opened."""
    return {(call["interface"], call["channel"], call.get("bitrate")) for call in opened}


@pytest.mark.parametrize(
    "words, code",
    [
        (["estop"], 1),  # nobody is there to acknowledge it
        (["estop", "--reset"], 1),
        (["scan"], 0),
        (["module", "4", "stop"], 2),
        (["bus", "record", "log.asc", *SECONDS], 0),
    ],
)
def test_the_bit_rate_of_an_adapter_reaches_the_command(
    words: list[str], code: int, opened: list[dict[str, Any]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("rds.bus.tools.estop.drives.cut", lambda bus: {})  # it asks 127 nodes
    done = CliRunner().invoke(app, [*words, "--experiment", str(experiment(tmp_path, ADAPTER))])
    assert done.exit_code == code, done.output
    assert told(opened) == {("virtual", 0, 250_000)}
    opened.clear()
    (tmp_path / "log.asc").unlink(missing_ok=True)
    done = CliRunner().invoke(app, [*words, "--interface", "virtual", "--channel", "0", "--bitrate", "250000"])
    assert done.exit_code == code, done.output
    assert told(opened) == {("virtual", "0", 250_000)}


def test_a_bit_rate_is_no_serial_lines() -> None:
    done = CliRunner().invoke(app, ["scan", "--interface", "serial", "--bitrate", "250000"])
    assert done.exit_code == 2 and "--bitrate is for CAN" in done.stderr


def test_a_monitor_reckons_the_load_by_the_bit_rate_of_the_table(opened: list[Any], tmp_path: Path) -> None:
    file = str(experiment(tmp_path, ADAPTER))
    done = CliRunner().invoke(app, ["bus", "monitor", *SECONDS, "--json", "--experiment", file])
    assert '"bitrate": 250000' in done.stdout and told(opened) == {("virtual", 0, 250_000)}


def test_the_built_in_bus_is_joined_on_the_channel_of_the_experiment_s_machine(tmp_path: Path) -> None:
    """`rds estop` for an experiment on another machine went to the mini CNC's channel, and stopped nothing."""
    timed = experiment(tmp_path, 'machine = "mrmt-oacs"\n[bus]\nbitrate = 500000\n')
    assert chosen_bus(None, None, timed) == ChosenBus("rds", "mrmt-oacs")
    assert chosen_bus(None, "bench", timed) == ChosenBus("rds", "bench")
    assert chosen_bus(None, None, None) == ChosenBus("rds", "mini-cnc")
    assert (machine_of(timed), machine_of(None)) == ("mrmt-oacs", "mini-cnc")
    own = experiment(tmp_path, 'machine = "own.toml"\n')
    assert machine_of(own) == str(tmp_path / "own.toml")


def test_jog_and_the_page_are_for_the_machine_of_the_experiment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the travel of the mini CNC another machine would be driven into its ends."""
    file = str(experiment(tmp_path, 'machine = "mrmt-oacs"\n'))
    refused = CliRunner().invoke(app, ["jog", "Y", "--by", "1", "--experiment", file])
    assert refused.exit_code == 2 and "there is nothing called 'Y' to jog; there are X, Z, A" in refused.stderr
    served: list[Any] = []
    monkeypatch.setattr("rds.panels.app.serve.serve", lambda folder, machine, *words, bus: served.append(machine))
    for words in (["--experiment", file], ["--experiment", file, "--machine", "mini-cnc"], []):
        assert CliRunner().invoke(app, ["app", *words]).exit_code == 0
    assert served == ["mrmt-oacs", "mini-cnc", "mini-cnc"]


def test_an_option_goes_before_the_table_and_another_interface_is_refused(tmp_path: Path) -> None:
    file = experiment(tmp_path, ADAPTER)
    assert bus_table_of(file, "virtual", "1") == {"interface": "virtual", "channel": "1", "bitrate": 250_000}
    with pytest.raises(InputError, match=r"--interface slcan, and \[bus\] of .* is for virtual"):
        bus_table_of(file, "slcan")


def test_what_a_command_sets_itself_is_no_option_of_a_bus(tmp_path: Path) -> None:
    """`node` in the table was a traceback in a scan, `timeout` shortened it without a word."""
    for word in ("node = 3", "timeout = 0.001", "mask = 1"):
        file = experiment(tmp_path, ADAPTER + word + "\n")
        refused = CliRunner().invoke(app, ["scan", "--experiment", str(file)])
        assert refused.exit_code == 2 and "is no option of a bus" in refused.stderr and "line 5" in refused.stderr


def test_drives_are_no_distributed_modules(tmp_path: Path) -> None:
    file = str(experiment(tmp_path, ADAPTER + 'dialect = "cia402"\n'))
    refused = CliRunner().invoke(app, ["module", "4", "info", "--experiment", file])
    assert refused.exit_code == 2 and "drives are moved and homed by `rds jog`" in refused.stderr


def test_a_machine_is_served_on_the_bus_and_in_the_dialect_of_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    served: list[Any] = []
    monkeypatch.setattr(
        "rds.bus.modules.dialects.serve_machine", lambda *words, **options: served.append((words, options))
    )
    file = str(experiment(tmp_path, ADAPTER + 'dialect = "oacs"\n'))
    done = CliRunner().invoke(app, ["machine", "serve", "mrmt-oacs", "--experiment", file])
    assert done.exit_code == 0, done.output
    (words, options) = served[0]
    assert words[1:4] == ("oacs", "virtual", 0) and options == {"bitrate": 250_000, "axes": None}
