"""The analysis as users get it: numbers, words, JSON, picture."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from math import inf
from typing import Any

import pytest

from rds.bus.analysis.analysis_plot import plot
from rds.bus.analysis.analysis_report import analyse, analyse_messages
from rds.bus.analysis.messages import Message
from rds.bus.analysis.response_times import Errors
from rds.bus.medium.bits import frame_bits
from rds.core.errors import InputError
from rds.machines import load_machine


def test_the_mini_cnc_at_1_mbit() -> None:
    """Five frames of 8 bytes: 5 x 135 bits at worst in 1000 bit times."""
    analysis = analyse(load_machine("mini-cnc"))
    assert analysis.worst_load_percent == pytest.approx(67.5)
    assert analysis.load_percent == pytest.approx(sum(row.bits for row in analysis.rows) / 10)
    assert [row.response for row in analysis.rows] == pytest.approx([135e-6, 270e-6, 405e-6, 540e-6, 675e-6])
    assert analysis.met and analysis.worst_cycle == pytest.approx(675e-6)
    assert analysis.cycle[-1].end == sum(row.bits for row in analysis.rows) * 1000
    assert analysis.row("answer Z").sender == "Z"
    with pytest.raises(InputError, match="no message 'answer W'"):
        analysis.row("answer W")


def test_a_bit_rate_may_be_written_as_a_float_and_is_whole() -> None:
    table = [Message("a", identifier=1, extended=False, size=8, period=0.01)]
    rate: Any = 500e3
    assert analyse_messages(table, rate) == analyse_messages(table, 500_000)
    wrong: list[Any] = [1000.5, inf, "500000", None]
    for rate in wrong:
        with pytest.raises(InputError, match="whole number of bit/s"):
            analyse_messages(table, rate)


@pytest.mark.parametrize(("bitrate", "period"), [(125_000, 1e-3), (250_000, 1e-3), (500_000, 1e-3), (1_000_000, 5e-4)])
def test_overload_is_said(bitrate: int, period: float) -> None:
    analysis = analyse(load_machine("mini-cnc"), bitrate, period)
    assert analysis.worst_load_percent > 100 and not analysis.met and analysis.worst_cycle == inf
    last = analysis.rows[-1]
    assert (last.verdict, last.response) == ("unbounded", inf)
    assert f"answer spindle: unbounded, for {last.reason}" in str(analysis)
    assert " % of the bus" in last.reason or "it comes after 'command', which is unbounded" in last.reason
    assert json.loads(json.dumps(analysis.to_json(), allow_nan=False))["messages"][-1]["response_us"] is None


@pytest.mark.parametrize(("bitrate", "hertz"), [(125_000, 184), (250_000, 368), (500_000, 737), (1_000_000, 1475)])
def test_the_highest_sample_rate_of_four_axes(bitrate: int, hertz: int) -> None:
    """675 bits a cycle: what fits into the period is met, three per cent faster is not."""
    assert analyse(load_machine("mini-cnc"), bitrate, 1 / hertz).met
    assert not analyse(load_machine("mini-cnc"), bitrate, 1 / (hertz * 1.03)).met


def test_two_axes_more_barely_fit() -> None:
    command = Message("command", 0x10, False, 8, 1e-3)
    for axes, fits in ((6, True), (7, False)):
        answers = [Message(f"{node}", 0x20 + node, False, 8, 1e-3, after="command") for node in range(1, axes + 1)]
        assert analyse_messages([command, *answers]).met is fits


def test_slow_modules_late_hosts_and_errors_are_added() -> None:
    machine = load_machine("mini-cnc")
    slow = analyse(machine, response_time=50e-6, host_jitter=20e-6)
    assert slow.row("command").response == pytest.approx(155e-6)
    assert slow.row("answer X").response == pytest.approx((20 + 135 + 50 + 135 + 135) * 1e-6)  # behind one lower answer
    wrong = analyse(machine, errors=Errors())
    assert wrong.row("answer X").response == pytest.approx((270 + 31 + 135) * 1e-6)


@pytest.mark.parametrize("mode, target", [("cst", 4), ("csp", 6)])
def test_drives_answer_sync_and_get_their_targets_in_one_cycle(mode: str, target: int) -> None:
    """SYNC, the TPDOs of 6 bytes, then the RPDOs: each waits for what comes before it, and once for the heartbeats."""
    machine = load_machine("mini-cnc")
    analysis = analyse(machine, dialect="cia402", cia402={"mode": mode})
    beats = 5 * (55 + 10)
    start = 55 + beats
    tpdo, rpdo = 55 + 60, 55 + 10 * target
    expected = {"SYNC": start}
    for place, name in enumerate(("X", "Y", "Z", "spindle"), 1):
        expected |= {f"TPDO {name}": start + place * tpdo, f"RPDO {name}": start + 4 * tpdo + place * rpdo}
    worst = max(expected.values())
    assert worst > 1000 and not analysis.met  # with all heartbeats at once it does not fit into 1 ms
    slower = analyse(machine, sample_period=2e-3, dialect="cia402", cia402={"mode": mode})
    for name, bits in expected.items():
        assert slower.row(name).response <= bits * 1e-6 * (1 + 1e-9)
    assert slower.row("RPDO spindle").response == pytest.approx(worst * 1e-6)
    assert slower.met and {row.identifier for row in analysis.rows} >= {0x080, 0x182, 0x202, 0x702, 0x77F}
    cycle = sum(row.longest_bits for row in analysis.rows if "heartbeat" not in row.name)
    assert analysis.worst_load_percent == pytest.approx(cycle / 10 + beats / 1000)


def test_what_the_times_rest_on_is_said() -> None:
    machine = load_machine("mini-cnc")
    assert "if modules answer at once, the host is on time, there are no errors" in str(analyse(machine))
    slow = analyse(machine, response_time=50e-6, host_jitter=20e-6, errors=Errors(2, 0.1))
    said = (
        "modules answer within 50 µs, the host is up to 20 µs late, 2 errors come at once, and one more every 100000 µs"
    )
    assert slow.assumed == slow.to_json()["assumed"] == said
    with pytest.raises(InputError, match="there is no dialect 'canopen'; known dialects: rds, oacs, cia402, dcs"):
        analyse(machine, dialect="canopen")


def test_load_is_exact_for_the_data_given() -> None:
    data = b"\x55" * 8
    analysis = analyse_messages([Message("m", 0x555, False, 8, 1e-3, data=data)], 500_000)
    assert analysis.load_percent == pytest.approx((frame_bits(0x555, data).total + 3) * 2e-6 / 1e-3 * 100)
    assert analysis.worst_load_percent == pytest.approx(27.0)


def test_fd_frames_take_both_rates() -> None:
    fd = Message("fd", 0x555, False, 64, 1e-3, fd=True, bitrate_switch=True)
    slow, fast = analyse_messages([fd], 500_000), analyse_messages([fd], 500_000, 2_000_000)
    most = fd.most()
    assert slow.rows[0].transmission == pytest.approx((most.total + 3) * 2e-6)
    assert fast.rows[0].transmission == pytest.approx((most.nominal + 3) * 2e-6 + most.fast * 0.5e-6)


def test_words() -> None:
    text = str(analyse(load_machine("mini-cnc")))
    assert text.startswith("mini-cnc, 1000 Hz: 1000 kbit/s\nbus load 62.5 % with the table's data, 67.5 % at worst\n")
    assert "answer spindle       0x025      8" in text and text.count(" met") == 5


@pytest.mark.parametrize("bitrate", [0, -1, 2_000_000])
def test_impossible_rates_are_refused(bitrate: int) -> None:
    with pytest.raises(InputError, match="bit rate"):
        analyse(load_machine("mini-cnc"), bitrate)
    with pytest.raises(InputError, match="data bit rate 100000"):
        analyse_messages([Message("m", 1, False, 0, 1.0)], 500_000, 100_000)


def test_a_machine_with_too_many_axes_is_refused() -> None:
    machine = load_machine("mini-cnc")
    axes = {f"{name}{copy}": axis for name, axis in machine.axes.items() for copy in (1, 2, 3)}
    with pytest.raises(InputError, match="12 axes; "):
        analyse(replace(machine, axes=axes))


@pytest.mark.parametrize("bitrate", [1_000_000, 500_000])
def test_the_picture_shows_each_message_twice(bitrate: int) -> None:
    figure = plot(analyse(load_machine("mini-cnc"), bitrate))
    for axes in figure.axes:
        assert axes.get_yticklabels()[0].get_text() == "command  0x010"
        assert "[µs]" in axes.get_xlabel()
    figure.canvas.draw()


def test_no_need_of_python_can_or_matplotlib() -> None:
    code = "import sys, rds.bus.analysis.analysis_report\n"
    code += "sys.exit(bool({'can', 'matplotlib', 'numpy'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
