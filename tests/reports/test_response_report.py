"""Response times: known delays come back out of every log format; patterns and pairs say what they will not take."""

from __future__ import annotations

from pathlib import Path

import can
import pytest
from hypothesis import given
from hypothesis.strategies import floats, lists

from rds.core.errors import InputError
from rds.results.reports import make_report
from rds.results.reports.dialects import DIALECTS, OACS_MOVES
from rds.results.reports.pairing import Frame, exchanges, parse_pairs, parse_pattern

# table 20, ms: modules 0x05, 0x04, 0x03, 0x02
TABLE_20 = {
    "general call": {5: 5.2, 4: 1.1, 3: 6.7, 2: 1.5},
    "data download": {5: 5.3, 4: 1.4, 3: 6.9, 2: 2.2},
}
OACS = parse_pairs(DIALECTS["oacs"])


def frame(time: float, identifier: int, data: str, extended: bool = False) -> Frame:
    return Frame(time, identifier, extended, bytes.fromhex(data))


def table_20_frames() -> list[Frame]:
    frames = [frame(1.0, 1, "0100000000000000")]
    frames += [frame(1.0 + ms / 1e3, 0, f"01{m:02x}5365727620") for m, ms in TABLE_20["general call"].items()]
    for at, (module, ms) in enumerate(TABLE_20["data download"].items()):
        asked = 2.0 + 0.1 * at
        frames += [frame(asked, module, "0200000000000000"), frame(asked + ms / 1e3, 0, f"02{module:02x}4c696e72")]
    return sorted(frames)


@pytest.mark.parametrize("ending", ["asc", "blf", "log", "trc", "csv"])
def test_table_20_out_of_every_log_format(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"bus.{ending}"
    with can.Logger(str(path)) as log:
        for time, identifier, extended, data in table_20_frames():
            log.on_message_received(
                can.Message(time, identifier, is_extended_id=extended, data=data, channel=0, is_rx=True)
            )
    table = make_report("response", [path]).table("Mean response time")
    assert table.columns == ["message", "0x02 [ms]", "0x03 [ms]", "0x04 [ms]", "0x05 [ms]"]
    for row in table.rows:
        assert row[1:] == pytest.approx([TABLE_20[row[0]][module] for module in (2, 3, 4, 5)], abs=0.11)
        if ending != "trc":  # 0.1 ms is what a TRC file resolves
            assert [f"{ms:.1f}" for ms in row[1:]] == [f"{TABLE_20[row[0]][m]:.1f}" for m in (2, 3, 4, 5)]


def test_a_table_of_frames(tmp_path: Path) -> None:
    path = tmp_path / "bus.csv"
    lines = [f"{time * 1e3:.3f};{identifier:#05x};{data.hex(' ')}" for time, identifier, _, data in table_20_frames()]
    path.write_text("time_ms;id;data\n" + "\n".join(lines))
    report = make_report("response", [path])
    assert report.table("Mean response time").rows[0][1] == pytest.approx(1.5)
    assert report.findings[0].startswith("general call: module 0x04 answers first, after 1.100 ms")


@given(lists(floats(1e-4, 0.05), min_size=1, max_size=30))
def test_every_delay_comes_back(delays: list[float]) -> None:
    frames = []
    for at, delay in enumerate(delays):
        frames += [frame(at, 3, "0301500100000000"), frame(at + delay, 0, "04030058")]
    found = exchanges(frames, OACS, 1.0)
    assert found.times == {("move start", 3): pytest.approx(delays, abs=1e-9)}
    assert found.unanswered("move start", 3) == 0 and found.strays == 0


def test_unanswered_repeated_late_and_stray() -> None:
    asked, answered = "0301500100000000", "04030058"
    frames = [
        frame(0.0, 3, asked),
        frame(1.0, 3, asked),
        frame(1.2, 0, answered),  # to the second
        frame(1.3, 0, answered),  # to none
        frame(2.0, 3, asked),
        frame(9.0, 0, answered),  # too late
        frame(10.0, 4, asked),
        frame(10.1, 0, answered),  # of another module, though that one's request is still open
    ]
    found = exchanges(frames, OACS, 5.0)
    assert found.times == {("move start", 3): [pytest.approx(0.2)]}
    assert found.unanswered("move start", 3) == 2 and found.unanswered("move start", 4) == 1
    assert found.strays == 3


def test_the_end_of_a_move_that_was_accepted_is_no_stray() -> None:
    asked, accepted, done, stopped = "0301500100000000", "0403000101000000", "0403000001000000", "0403000501000000"
    frames = [
        frame(0.0, 3, asked),
        frame(0.1, 0, accepted),
        frame(5.0, 0, done),
        frame(6.0, 0, done),  # to none
        frame(7.0, 3, asked),
        frame(7.1, 0, accepted),
        frame(8.0, 0, stopped),
        frame(9.0, 0, "0404000001000000"),  # a module that was asked nothing
    ]
    found = exchanges(frames, OACS, 1.0)
    assert found.times == {("move start", 3): pytest.approx([0.1, 0.1])} and found.strays == 2


def test_each_module_answers_a_general_call_once() -> None:
    call = [frame(0.0, 1, "0100000000000000"), frame(0.1, 0, "0102"), frame(0.2, 0, "0103"), frame(0.3, 0, "0102")]
    found = exchanges([*call, frame(1.0, 1, "0100000000000000"), frame(1.1, 0, "0102")], OACS, 5.0)
    assert found.times == {("general call", 2): [pytest.approx(0.1)] * 2, ("general call", 3): [pytest.approx(0.2)]}
    assert found.unanswered("general call", 3) == 1 and found.strays == 1


def test_the_cyclic_exchange_of_this_projects_modules(tmp_path: Path) -> None:
    from rds.bus.modules.rds.frames import ANSWER, COMMAND, Answer, Kind, Status, encode_answer, encode_voltages

    lines = ["time_s,id,data"]
    for k in range(5):
        lines.append(f"{k * 1e-3},{COMMAND:03x},{encode_voltages([1.0]).hex()}")
        for node in (1, 2):
            data = encode_answer(Answer(k, Status.ENABLED, Kind.ANSWER, k))
            lines.append(f"{k * 1e-3 + node * 2e-4},{ANSWER + node:03x},{data.hex()}")
    path = tmp_path / "bus.csv"
    path.write_text("\n".join(lines))
    report = make_report("response", [path], {"dialect": "rds"})
    assert report.table("Mean response time").rows == [["cycle", pytest.approx(0.2), pytest.approx(0.4)]]


def test_moves_from_a_bus_log(tmp_path: Path) -> None:
    lines = ["(0.0) can0 002#0301500100000000", "(36.9) can0 000#04020058", "(40.0) can0 002#0301500000000000"]
    path = tmp_path / "moves.log"
    path.write_text("\n".join([*lines, "(70.1) can0 000#04020058"]) + "\n")
    report = make_report("moves", [path], {"distances": "2=80 mm"})
    assert [row[:3] for row in report.tables[0].rows] == [["2", "cw", 1], ["2", "ccw", 1]]
    assert report.tables[0].column("average speed") == pytest.approx([80 / 36.9 * 60, 80 / 30.1 * 60])
    assert parse_pairs(OACS_MOVES)[0].name == "cw"


def test_moves_to_a_point_are_moves() -> None:
    """As a part program by move commands makes them: accepted, then carried out, without a direction."""
    frames = [
        *(frame(1.0, 4, "0303000010270000"), frame(1.007, 0, "0404045801000000"), frame(6.5, 0, "04040458009a0600")),
        *(frame(7.0, 4, "0303000000000000"), frame(7.003, 0, "0404045802000000")),  # outside its travel
    ]
    assert exchanges(frames, OACS, 10.0).times["move to a point", 4] == pytest.approx([0.007, 0.003])
    moved = exchanges(frames, parse_pairs(OACS_MOVES), 600.0)
    assert moved.times == {("to a point", 4): pytest.approx([5.5])} and moved.unanswered("to a point", 4) == 1


def test_patterns() -> None:
    assert parse_pattern("001#01").module(frame(0, 1, "0100")) == 0
    assert parse_pattern("001#01").module(frame(0, 1, "02")) is None
    assert parse_pattern("001#01").module(frame(0, 1, "01", extended=True)) is None
    assert parse_pattern("00000001#01").module(frame(0, 1, "01", extended=True)) == 0
    assert parse_pattern("580+M#").module(frame(0, 0x5FF, "")) == 127
    assert parse_pattern("580+M#").module(frame(0, 0x600, "")) is None
    assert parse_pattern("M#03..MM").module(frame(0, 5, "03ff05")) == 5
    assert parse_pattern("M#03..MM").module(frame(0, 5, "03ff06")) is None
    assert parse_pattern("000#04MM").module(frame(0, 0, "0400")) is None


@pytest.mark.parametrize(
    "text", ["001", "#01", "xyz#01", "001#1", "001#0G", "800#", "20000000#", "+M#", "020M#", "020+#"]
)
def test_a_wrong_pattern_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"is not a pattern|too large"):
        parse_pattern(text)


@pytest.mark.parametrize("text", ["", "a: 001#", "001# -> 000#", "a: 001# -> 000#; a: 002# -> 000#"])
def test_a_wrong_pair_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"write (it|at least one) as in|rename one"):
        parse_pairs(text)


def test_our_modules_accept_a_move_before_it_is_carried_out_and_download_in_many_frames() -> None:
    frames = [
        *(frame(1.0, 4, "0200000000000000"), frame(1.0014, 0x124, "1080010158780000"), frame(1.002, 0x114, "30000000")),
        *(frame(2.0, 4, "0301050100000000"), frame(2.008, 0, "0404005801000000"), frame(4.4, 0, "0404005800110000")),
        *(frame(5.0, 4, "0301050000000000"), frame(5.008, 0, "0404005801000000"), frame(5.5, 0, "0404005809110000")),
    ]
    told = exchanges(frames, OACS, 1.0)
    assert told.times["data download", 4] == pytest.approx([0.0014])
    assert told.times["move start", 4] == pytest.approx([0.008, 0.008])
    moved = exchanges(frames, parse_pairs(OACS_MOVES), 600.0)
    assert moved.times == {("cw", 4): pytest.approx([2.4])} and moved.unanswered("ccw", 4) == 1  # a limit switch opened
