"""Logs laid over the schedule: never beyond a bound whose assumptions hold, and beyond where they do not.

The logs are made in virtual time, by the built-in bus's own medium or by the exact schedule that it keeps to.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from random import Random

import can
import numpy as np
import pytest
from typer.testing import CliRunner

from rds.bus.analysis.analysis_plot import plot
from rds.bus.analysis.analysis_report import Analysis, analyse, analyse_messages
from rds.bus.analysis.measured import Measured, measured, of_frames
from rds.bus.analysis.messages import Message, in_order
from rds.bus.analysis.schedule import Slot, occupied, schedule
from rds.bus.medium.bits import frame_bits
from rds.bus.tools.logs import LogWriter
from rds.cli.main import app
from rds.core.errors import InputError
from rds.machines import load_machine
from rds.network.trace import read_trace

from .wires import bus, drain, identifier_of, record

EPOCH = 1_700_000_000.0  # s
MS = 1_000_000  # ns


def frame(identifier: int, at: float, data: bytes = bytes(8), **words: object) -> can.Message:
    """A frame with its time stamp in whole µs, as logs keep it."""
    stamp = round(EPOCH + at, 6)
    words = {"is_extended_id": False, **words}
    return can.Message(timestamp=stamp, arbitration_id=identifier, data=data, **words)  # type: ignore[arg-type]


def cycles(
    analysis: Analysis,
    count: int = 400,
    late: int = 0,
    answers: int = 0,
    bitrate: int | None = None,
    period: int = MS,
    foreign: Iterable[int] = (),
) -> list[can.Message]:
    """A log of a machine's bus: a host `late` ns at most, modules that answer within `answers` ns; ns.

    `foreign` are instants at which frames 0x001 of eight bytes are released.
    """
    chance, rate = Random(1), bitrate or analysis.bitrate
    table = [Message("flood", 0x001, False, 8, 1.0, data=b"\x55" * 8), *analysis.messages]
    bits = [message.exact() for message in table]
    root = next(n for n, message in enumerate(table) if n and message.after is None)

    def follow(slot: Slot) -> list[tuple[int, int]]:
        if slot.message != root:
            return []
        arrived = slot.start + bits[root].time(rate)
        return [(arrived + chance.randint(0, answers), n) for n, message in enumerate(table) if message.after]

    releases = [(5 * MS + k * period + chance.randint(0, late), root) for k in range(count)]
    releases += [(at, 0) for at in foreign]
    slots = schedule(releases, lambda n: occupied(bits[n], rate), follow)
    ends = [slot.start + bits[slot.message].time(rate) for slot in slots]
    return [
        frame(table[slot.message].identifier, end * 1e-9, table[slot.message].data or b"")
        for slot, end in zip(slots, ends, strict=True)
    ]


def cnc(**words: float) -> Analysis:
    return analyse(load_machine("mini-cnc"), **words)  # type: ignore[arg-type]


# --- within


def test_a_bus_that_keeps_to_its_schedule_is_measured_to_the_bit() -> None:
    """With answers at once the cycle is the one that the analysis draws: 127, 251, 376, 501 and 625 bits of 1 µs."""
    found = of_frames(cnc(), cycles(cnc()))
    assert found.met and [row.verdict for row in found.rows] == ["within"] * 5
    assert [row.largest for row in found.rows] == pytest.approx([127e-6, 251e-6, 376e-6, 501e-6, 625e-6], abs=2e-6)
    assert [row.median for row in found.rows] == pytest.approx([127e-6, 251e-6, 376e-6, 501e-6, 625e-6], abs=2e-6)
    assert [row.frames for row in found.rows] == [400] * 5 and not found.foreign
    assert found.wire.closer < 2e-6 and found.wire.bitrate == pytest.approx(1e6, rel=0.02)
    assert found.load == pytest.approx(62.5, abs=0.2)


def test_late_hosts_and_slow_modules_stay_within_the_bounds_that_know_of_them() -> None:
    analysis = cnc(host_jitter=80e-6, response_time=150e-6)
    log = cycles(analysis, late=80_000, answers=150_000)
    found = of_frames(analysis, log)
    assert found.met
    command, first = found.row("command"), found.row("answer X")
    assert 127e-6 < command.median < command.largest <= 127e-6 + 80e-6 + 2e-6  # type: ignore[operator]
    assert command.largest > 127e-6 + 75e-6  # type: ignore[operator]  # the grid is found although nobody tells its phase
    assert first.largest <= first.bound and first.largest > 251e-6 + 150e-6  # type: ignore[operator]
    too_good = of_frames(cnc(), log)
    assert {row.name for row in too_good.rows if row.verdict == "beyond"} >= {"command", "answer spindle"}
    assert too_good.row("command").during.free > too_good.row("command").beyond
    said = str(too_good)
    assert "--host-jitter" in said and "--response-time" in said and "`rds report response`" in said


@pytest.mark.parametrize("seed", range(12))
def test_no_delay_is_measured_beyond_the_bound_on_the_timed_bus(seed: int) -> None:
    """Any table whose jitters are kept, by senders whose clock is 80 ppm fast, on the built-in bus's medium."""
    chance = Random(seed)
    bitrate = chance.choice([125_000, 250_000, 500_000, 1_000_000])
    messages = in_order(
        Message(f"m{n}", chance.randrange(n * 90, n * 90 + 90), False, chance.randint(0, 8),
                chance.randint(6, 40) * 0.5e-3 * 1e6 / bitrate, chance.choice([0.0, 50e-6, 400e-6]))
        for n in range(6)
    )  # fmt: skip
    analysis = analyse_messages(messages, bitrate)
    offers = []
    for message in messages:
        period, at, phase = message.period * 1e9, 0, chance.random() * message.period * 1e9
        for k in range(int(1.5e9 / period)):
            at = max(at, round((phase + k * period) * (1 - 80e-6)) + chance.randint(0, round(message.jitter * 1e9)))
            offers.append((at, message, chance.randbytes(message.size)))
    medium = bus("log", *(message.name for message in messages), bitrate=bitrate)
    log, sizes = [], {message.identifier: message.size for message in messages}

    def take(until: int) -> None:
        for delivery in drain(medium, until):
            identifier = identifier_of(delivery)
            data = bytes(delivery.frame[-64:][: sizes[identifier]])
            log.append(frame(identifier, delivery.at * 1e-9, data))

    for at, message, data in sorted(offers, key=lambda offer: offer[0]):
        medium.offer(message.name, record(message.identifier, data), at)
        take(at - 1)
    take(10**11)
    assert len(log) == len(offers)
    found = of_frames(analysis, log)
    assert found.met, str(found)
    for row, message in zip(found.rows, messages, strict=True):
        assert row.frames > 0.98 * 1.5 / message.period - 2
        assert row.log_period == pytest.approx(message.period * (1 - 80e-6), rel=3e-4)


@pytest.mark.parametrize("count", [1, 2, 7, 12, 400])
@pytest.mark.parametrize("late, answers", [(300_000, 0), (900_000, 200_000), (0, 2_000_000)])
def test_hosts_that_are_late_by_nearly_a_period_and_short_logs_are_not_beyond_either(
    count: int, late: int, answers: int
) -> None:
    analysis = cnc(host_jitter=late * 1e-9, response_time=answers * 1e-9)
    found = of_frames(analysis, cycles(analysis, count, late, answers))
    assert found.met, str(found)


def test_frames_that_are_missing_late_for_a_whole_period_and_sent_beside_it_are_told_apart() -> None:
    table = analyse_messages([Message("m", 0x100, False, 8, 1e-3)])
    times = [k * 1e-3 for k in range(200) if k not in (50, 60)]
    times[100] += 2.6e-3  # 102 was held up, and 103 and 104 with it
    times[101] = times[100] + 150e-6
    times[102] = times[101] + 150e-6
    found = of_frames(table, [frame(0x100, at) for at in [*times, times[-1] + 0.3e-3]])
    row = found.row("m")
    assert (row.missing, row.extra, row.frames) == (2, 1, 198)
    duration = Message("m", 0x100, False, 8, 1e-3, data=bytes(8)).exact().total * 1e-6 + 3e-6
    assert row.largest == pytest.approx(2.6e-3 + duration, abs=3e-6) and row.verdict == "beyond"
    assert row.median == pytest.approx(duration, abs=3e-6)
    assert row.at == pytest.approx(times[100], abs=2e-6)
    assert "m did not come in 2 of its periods" in str(found)


def test_a_sender_that_begins_again_with_another_phase_is_not_late() -> None:
    table = analyse_messages([Message("m", 0x100, False, 8, 1e-3)])
    times = [k * 1e-3 for k in range(60)] + [60.6e-3 + k * 1e-3 for k in range(60)]
    row = of_frames(table, [frame(0x100, at) for at in times]).row("m")
    assert (row.verdict, row.pauses, row.frames) == ("within", 1, 120)
    few = times[:60] + [60.6e-3, 61.6e-3, 62.6e-3] + [k * 1e-3 for k in range(63, 120)]
    assert of_frames(table, [frame(0x100, at) for at in few]).row("m").verdict == "beyond"  # three in between were late


# --- beyond


def flooded() -> Measured:
    """The mini CNC's bus at rest, and in it 40 foreign frames without a pause, released with the 196th command."""
    return of_frames(cnc(), cycles(cnc(), foreign=[200 * MS] * 40))


def test_a_flood_of_higher_priority_is_beyond_and_named() -> None:
    found = flooded()
    assert not found.met
    command, flood = found.row("command"), 40 * (frame_bits(0x001, b"\x55" * 8).total + 3) * 1e-6
    assert command.verdict == "beyond" and command.largest == pytest.approx(flood + 127e-6, abs=3e-6)
    assert command.at == pytest.approx(0.195 + flood, abs=3e-6)  # since the first command was over
    assert command.beyond == pytest.approx(flood + 127e-6 - 135e-6, abs=3e-6)
    assert command.during.foreign == pytest.approx(flood, abs=3e-6) and command.during.free < 5e-6
    assert "--host-jitter" not in str(found)  # nobody was late: the bus was taken
    (foreign,) = found.foreign
    assert (foreign.text, foreign.frames, foreign.above) == ("0x001", 40, 5)
    assert foreign.load == pytest.approx(100 * flood / 0.4, rel=0.01)
    said = str(found)
    assert "command is beyond its bound by" in said and "Foreign: identifiers that are not in the schedule: 1, " in said
    assert "0x001 (40, " in said and "The schedule that was analysed is not that of this bus." in said


def test_another_bit_rate_and_another_period_are_named() -> None:
    slow = of_frames(cnc(sample_period=2e-3), cycles(cnc(), bitrate=500_000, period=2 * MS))
    assert not slow.met and "Bit rate: the closest frames follow each other as at about 500 kbit/s" in str(slow)
    assert "try --bitrate 500000" in str(slow)
    rare = of_frames(cnc(), cycles(cnc(), period=3 * MS))
    assert "Period: command comes every 3 ms in the log, 1 ms in the schedule" in str(rare)
    assert rare.row("command").largest == pytest.approx(127e-6, abs=2e-6)


def test_stamps_that_no_wire_can_make_are_said() -> None:
    log = cycles(cnc())
    for place in range(0, len(log), 50):
        log[place].timestamp += 60e-6
    found = of_frames(cnc(), log)
    assert found.wire.closer == pytest.approx(60e-6, abs=3e-6)
    assert "Frames are up to 60" in str(found) and "each delay is uncertain by that" in found.to_json()["time_stamps"]
    assert "No frame is closer to the one before than the wire allows" in str(of_frames(cnc(), cycles(cnc())))


def test_pauses_between_frames_are_no_other_bit_rate() -> None:
    log = [frame(0x010 if k % 4 == 0 else 0x021 + k % 4, (k // 4) * 4e-3 + (k % 4) * 135e-6) for k in range(400)]
    said = str(of_frames(cnc(), log))
    assert "not at 1000: the sender leaves pauses, or the stamps are not those of the wire" in said


def test_errors_longer_frames_and_silent_modules_are_said() -> None:
    log = [message for message in cycles(cnc()) if message.arbitration_id != 0x024]
    log.append(can.Message(timestamp=EPOCH + 0.1, is_error_frame=True))
    said = str(of_frames(cnc(), log))
    assert "Not in the log, or in no cycle of it: answer Z." in said
    assert "error frames in the log: 1 and the bounds are those of a bus without errors (--errors)" in said
    assert "Of 400 cycles" not in said and "the last frame of a cycle comes" in said  # of those that there are
    short = analyse_messages([Message("m", 0x100, False, 2, 1e-3)])
    assert "Length: 9 frames of m have more bytes" in str(of_frames(short, [frame(0x100, k * 1e-3) for k in range(9)]))


def test_logs_of_something_else_are_refused() -> None:
    with pytest.raises(InputError, match=r"none of its 2 frames is in the schedule \(0x010, .*it has 0x555"):
        of_frames(cnc(), [frame(0x555, 0.0), frame(0x555, 1.0)])
    two = [frame(0x010, 0.0, channel="can0"), frame(0x010, 1e-3, channel="can1")]
    with pytest.raises(InputError, match="frames of the channels can0 and can1"):
        of_frames(cnc(), two)


def test_a_log_of_answers_alone_has_no_delays() -> None:
    said = str(of_frames(cnc(), [frame(0x022, k * 1e-3) for k in range(3)]))
    assert "no message of the log has a delay that can be measured" in said


def test_a_frame_with_and_without_the_bit_rate_switch_takes_two_times() -> None:
    table = [Message("a", 0x100, False, 64, 0.001, fd=True)]
    fast = [frame(0x100, 0.001 * k, bytes(64), is_fd=True, bitrate_switch=k % 2 == 0) for k in range(40)]
    found = of_frames(analyse_messages(table, 500_000, 4_000_000), fast)
    slow = frame_bits(0x100, bytes(64), fd=True).time(500_000, 4_000_000, interframe=True)
    assert found.row("a").largest == pytest.approx(slow * 1e-9, abs=1e-6)


def test_frames_of_one_instant_have_no_delays() -> None:
    found = of_frames(cnc(), [frame(0x010, 5.0) for _ in range(30)])
    assert found.row("command").extra == 29


def test_a_log_whose_clock_was_set_back_is_refused(tmp_path: Path) -> None:
    stamps = [0.1 * k for k in range(20)]
    lines = [f"({1000.0 + stamp:.6f}) can0 010#0011223344556677\n" for stamp in [*stamps, *stamps[10:]]]
    (tmp_path / "run.log").write_text("".join(lines))
    with pytest.raises(InputError, match=r"go back by 0\.9 s at frame 21, to 1001\.000000 s"):
        measured(cnc(), tmp_path / "run.log")


def test_drives_are_measured_by_their_sync() -> None:
    """A run of one drive of four: SYNC, its TPDO 0.3 ms later, its RPDO 0.5 ms after that."""
    analysis = analyse(load_machine("mini-cnc"), 500_000, 5e-3, dialect="cia402", response_time=4e-4, host_jitter=4e-4)
    log = [
        frame(identifier, k * 5e-3 + at, bytes(size))
        for k in range(100)
        for identifier, at, size in ((0x080, 0.0, 0), (0x182, 3e-4, 6), (0x202, 8e-4, 4))
    ]
    found = of_frames(analysis, log)
    start = 44 * 2e-6  # at least: SYNC has 44 bits without stuff bits
    assert found.row("TPDO X").median == pytest.approx(3e-4 + start + 6e-6, abs=8e-6)
    assert found.row("RPDO X").median == pytest.approx(8e-4 + start + 6e-6, abs=8e-6)
    assert found.row("TPDO Y").verdict == "absent" and found.met
    first, second = found.to_json()["tracking"]
    assert np.median(found.cycle["sensor"]) == pytest.approx(8e-4, abs=1e-6) and "16.0 % of the sample period" in first
    assert second.startswith("--trace FILE.csv")  # targets go in the same cycle


# --- what it means, and the command


def test_tracking_is_told_in_shares_of_the_sample_period() -> None:
    found = of_frames(cnc(), cycles(cnc()))
    first, second = found.to_json()["tracking"]
    # the last answer ends 625 - 127 bits after the command
    assert "comes 498.1 µs (median) and at most 498.1 µs after its first frame, 49.8 % and 49.8 % of" in first
    assert "is up to 0.498 µm behind for each mm/s" in first
    assert "cost" in second and "rds network cost" in second
    late = flooded().to_json()["tracking"][0]
    assert "end after the next one has begun" in late


def saved(path: Path, log: Iterable[can.Message]) -> Path:
    writer = LogWriter(path)
    for message in log:
        message.channel = "can0"
        writer.write(message)
    writer.close()
    return path


@pytest.mark.parametrize("name", ["run.log", "run.asc", "run.blf", "run.csv", "run.trc"])
def test_the_command_reads_logs_and_says_the_same_of_each(tmp_path: Path, name: str) -> None:
    log = saved(tmp_path / name, cycles(cnc(), count=60))
    words = ["bus", "analyse", "mini-cnc", "--measured", str(log), "--json"]
    done = CliRunner().invoke(app, words, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)["measured"]
    assert told["within"] and told["frames"] == 300
    assert [row["largest_us"] for row in told["messages"]] == pytest.approx([127, 251, 376, 501, 625], abs=2.5)
    assert {row["counted_from"] for row in told["messages"]} == {"cycle", "period"}


def test_the_command_with_table_trace_and_picture(tmp_path: Path) -> None:
    log = saved(tmp_path / "run.log", cycles(cnc(), foreign=[200 * MS] * 40))
    trace, picture = tmp_path / "d.csv", tmp_path / "d.png"
    words = ["bus", "analyse", "mini-cnc", "--measured", str(log), "--trace", str(trace), "--plot", str(picture)]
    done = CliRunner().invoke(app, words, catch_exceptions=False)
    assert done.exit_code == 1 and "beyond by" in done.output and picture.read_bytes().startswith(b"\x89PNG")
    delays = read_trace(trace)
    assert np.nanmedian(delays["sensor"]) == pytest.approx(498e-6, abs=3e-6)
    assert np.nanmedian(delays["actuator"]) == pytest.approx(124e-6, abs=3e-6)


def test_a_table_of_independent_messages_is_measured_and_says_that_delays_are_lower_bounds(tmp_path: Path) -> None:
    (tmp_path / "bus.csv").write_text("identifier,period_ms,length,name\n0x100,10,8,Speed\n0x200,20,8,Load\n")
    log = [frame(0x100, k * 0.01) for k in range(100)] + [frame(0x200, 0.004 + k * 0.02) for k in range(50)]
    saved(tmp_path / "run.log", sorted(log, key=lambda each: each.timestamp))
    words = ["bus", "analyse", str(tmp_path / "bus.csv"), "--measured", str(tmp_path / "run.log")]
    done = CliRunner().invoke(app, [*words, "--bitrate", "500000"], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    assert "the largest is a lower bound" in done.output and "Tracking: at most 2." in done.output
    refused = CliRunner().invoke(app, [*words, "--trace", str(tmp_path / "d.csv")])
    assert refused.exit_code == 2 and "cycles of a command and its answers" in refused.stderr


def test_words_that_do_not_go_together_are_refused(tmp_path: Path) -> None:
    def say(*words: str) -> str:
        done = CliRunner().invoke(app, ["bus", "analyse", "mini-cnc", *words])
        assert done.exit_code == 2
        return done.stderr

    assert "--trace is of measured delays" in say("--trace", "d.csv")
    assert "a saved run keeps no frames" in say("--measured", str(tmp_path))
    assert "leave one of them out" in say("--measured", "run.log", "--fits")
    assert "--measured is for a CAN bus" in say("--measured", "run.log", "--dialect", "dcs")


def test_the_picture_shows_what_was_measured() -> None:
    found = flooded()
    figure = plot(found.analysis, found)
    below = figure.axes[1]
    assert any("beyond by" in text.get_text() for text in below.texts)
    assert "measured" in below.get_xlabel() and below.get_xlim()[1] > 4500
    figure.canvas.draw()
