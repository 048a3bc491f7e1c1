"""Each kind of bad data gets its sentence; good data get none."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.identification.fit.fit import fit
from rds.identification.logs import sampling
from rds.identification.logs.describe import describe
from rds.identification.logs.log import Finding, Gravity, Log
from rds.identification.logs.read_log import read_log
from rds.identification.logs.steps import step_of
from rds.identification.logs.time_base import time_base
from rds.identification.structures.structures import structure
from rds.results import Result
from tests.logs.data_files import MAP, axis, headed, write

Columns = dict[str, np.ndarray]


def read(folder: Path, columns: Columns, extra: str = "", axis_lines: str = "") -> Log:
    path = write(folder / "log.csv", columns)
    (folder / "log.csv.map.toml").write_text(extra + MAP + axis_lines)
    (log,) = read_log(path)
    return log


def grave(log: Log) -> dict[str, Finding]:
    return {f.kind: f for f in log.findings if f.gravity != "note"}


def test_a_good_log_has_nothing_grave(tmp_path: Path) -> None:
    log = read(tmp_path, axis(), 'machine = "mini-cnc"\n', "closed_loop = false\n")
    assert grave(log) == {}
    assert log.resolution == 0.001 and log.voltage_range == (-10.0, 10.0) and log.closed_loop is False
    assert log.sample_period == pytest.approx(1e-3, rel=1e-12)


def test_a_coarse_encoder_does_not_hide_a_direction(tmp_path: Path) -> None:
    """In windows of 20 ms steps of 0.1 mm are faster than the axis; over its way, it goes both ways."""
    good = axis()
    step = 0.02 * float(np.ptp(good["position"]))
    log = read(tmp_path, good | {"position": np.round(good["position"] / step) * step})
    assert log.resolution == pytest.approx(step)
    assert not any("never moves" in finding.what for finding in log.findings)


def changed(**change: Callable[[np.ndarray], np.ndarray]) -> Columns:
    return {name: change.get(name, lambda v: v)(values) for name, values in axis().items()}


def swapped() -> Columns:
    made = axis()
    return made | {"voltage": made["position"], "position": made["voltage"]}


BAD: list[tuple[Columns, str, str, str]] = [
    (changed(voltage=np.zeros_like), "excitation", "fault", "the command is 0 V throughout"),
    (changed(position=np.zeros_like), "excitation", "fault", "the axis hardly moves: 0 mm"),
    (changed(position=lambda p: np.round(p / 1000, 3)), "excitation", "fault", "the axis hardly moves"),
    (changed(position=np.negative), "sign", "fault", "moves against its command"),
    (swapped(), "columns", "fault", "they are swapped"),
    (changed(voltage=np.abs), "columns", "warning", "the command has one sign: is it a magnitude?"),
    (changed(position=lambda p: p * 1000), "units", "fault", "its unit is wrong"),
    (changed(voltage=lambda u: u * 1000), "units", "fault", "the converter gives 10 V at most"),
    (
        changed(voltage=lambda u: 3.0 * np.sign(u)),
        "excitation",
        "warning",
        "the gain K and the friction cannot be told",
    ),
    (changed(voltage=lambda u: np.clip(u * 3, -10, 10)), "saturation", "warning", "at its limits"),
    (changed(position=lambda p: p + 80.0), "saturation", "warning", "reaches the end of the travel"),
    (changed(position=lambda p: np.round(p / 0.01) * 0.01), "quantization", "warning", "10 of the stated resolution"),
]


@pytest.mark.parametrize(
    ("columns", "kind", "gravity", "sentence"), BAD, ids=[f"{b[1]}-{i}" for i, b in enumerate(BAD)]
)
def test_bad_data_are_told(tmp_path: Path, columns: Columns, kind: str, gravity: str, sentence: str) -> None:
    found = [f for f in read(tmp_path, columns, 'machine = "mini-cnc"\n').findings if f.kind == kind]
    assert any(re.search(sentence, f.what) and f.gravity == gravity for f in found), found


def test_an_axis_that_goes_one_way_does_not_tell_the_other_friction(tmp_path: Path) -> None:
    made = axis()
    up = np.maximum.accumulate(made["position"])
    log = read(tmp_path, made | {"voltage": np.abs(made["voltage"]), "position": up})
    assert any("never moves in the negative direction" in f.what and "F-" in f.what for f in log.findings)


def test_metres_without_a_machine_are_told_by_their_steps(tmp_path: Path) -> None:
    made = axis(resolution=5e-5)
    log = read(tmp_path, made | {"position": made["position"] / 1000})  # m, and the map says mm
    assert "finer than encoders are: check the unit" in grave(log)["units"].what


def test_times_in_ms_taken_for_s(tmp_path: Path) -> None:
    made = axis()
    log = read(tmp_path, made | {"time": made["time"] * 1000})
    assert "is the time in ms?" in grave(log)["units"].what


def test_a_closed_loop_shows_itself(tmp_path: Path) -> None:
    t = np.arange(4000) * 1e-3
    r = 5 * np.sin(2 * np.pi * t)
    x = v = 0.0
    u, y = np.empty_like(t), np.empty_like(t)
    for i in range(len(t)):
        y[i] = round(x, 3)
        u[i] = 10.0 * (r[i] - y[i]) + 0.567 * 10 * np.pi * np.cos(2 * np.pi * t[i])
        v += 0.1 * (1.764 * u[i] - v)
        x += 1e-3 * v
    columns = {"time": t, "voltage": u, "position": y, "ref": r}
    log = read(tmp_path, columns, axis_lines='reference = { column = "ref", unit = "mm" }\n')
    assert log.closed_loop is True and "closed-loop" in grave(log)
    open_loop = {**axis(), "ref": axis()["position"] * 0 + r}
    log = read(tmp_path, open_loop, axis_lines='reference = { column = "ref", unit = "mm" }\n')
    assert log.closed_loop is None and "closed-loop" not in grave(log)


def test_a_position_that_follows_its_reference_shows_a_controller_that_errors_do_not(tmp_path: Path) -> None:
    """A drive's integrator holds friction, so the error explains little of the command; an open loop never follows."""
    t = np.arange(4000) * 1e-3
    r = 5.0 * np.sin(2 * np.pi * 0.5 * t)
    random = np.random.default_rng(0)
    columns = {
        "time": t,
        "voltage": 0.5 * np.sign(np.cos(2 * np.pi * 0.5 * t)) + 0.1 * random.standard_normal(len(t)),
        "position": np.round(r + 0.01 * np.cos(2 * np.pi * 3.0 * t), 3),
        "ref": r,
    }
    reference = 'reference = { column = "ref", unit = "mm" }\n'
    log = read(tmp_path, columns, axis_lines=reference)
    assert log.closed_loop is True and "which only a controller does" in grave(log)["closed-loop"].what
    log = read(tmp_path, columns | {"ref": 2.0 * r}, axis_lines=reference)
    assert log.closed_loop is None and any(f.kind == "loop" and "not known" in f.what for f in log.findings)


# --- time


def test_times_that_are_not_exactly_regular_are_used_as_they_are(tmp_path: Path) -> None:
    made = axis()
    random = np.random.default_rng(0)
    made["time"] = made["time"] + random.uniform(-0.04, 0.04, len(made["time"])) * 1e-3
    log = read(tmp_path, made)
    assert np.allclose(log.time, made["time"], rtol=1e-11)
    jitter = next(f for f in log.findings if f.kind == "jitter")
    assert "used as they are" in jitter.what


@pytest.mark.parametrize("at", [1, 1234, 3998])
def test_beyond_the_limit_the_first_sample_is_named(tmp_path: Path, at: int) -> None:
    made = axis()
    made["time"][at] += 0.15e-3
    with pytest.raises(InputError, match=rf"beyond the limit of 10 % first at sample {at} "):
        read(tmp_path, made)
    assert len(read(tmp_path, made, "jitter_limit = 0.2\n")) == 4000


def test_times_of_a_slow_loop_are_taken_as_they_are_where_the_map_says_so(tmp_path: Path) -> None:
    made = axis()
    made["time"][1000:1003] += [0.63e-3, 0.05e-3, 0.0]  # a late sample, and one right behind it
    with pytest.raises(InputError, match=r"a larger jitter_limit in the map \(at most 1\)"):
        read(tmp_path, made)
    log = read(tmp_path, made, "jitter_limit = 1.0\n")
    (jitter,) = [finding for finding in log.findings if finding.kind == "jitter"]
    assert len(log) == 4000 and jitter.gravity is Gravity.WARNING
    made = axis()
    made["time"][1000:1003] += [2.0e-3, 1.1e-3, 0.2e-3]
    with pytest.raises(InputError, match='gaps = "keep" in the map'):
        read(tmp_path, made, "jitter_limit = 1.0\n")
    assert len(read(tmp_path, made, 'jitter_limit = 1.0\ngaps = "keep"\n')) == 4000


def test_rows_that_are_left_from_before_the_recording_are_to_be_removed(tmp_path: Path) -> None:
    made = axis()
    made["time"][0] = 1.074
    with pytest.raises(InputError, match=r"the first row of data is left from before .* remove it"):
        read(tmp_path, made)


@pytest.mark.parametrize(("late", "said"), [([0.8e-3], "80 %"), ([2.0e-3, 1.1e-3, 0.2e-3], "200 %")])
def test_samples_that_came_late_are_not_missing(tmp_path: Path, late: list[float], said: str) -> None:
    """They were told as a gap, and as samples in which the command was to be taken as held."""
    made = axis()
    made["time"][1000 : 1000 + len(late)] += late
    with pytest.raises(
        InputError, match=rf"\({said} of the period\) off; beyond the limit of 10 % first at sample 1000 "
    ):
        read(tmp_path, made)
    made = {name: np.delete(values, slice(2000, 2010)) for name, values in made.items()}
    with pytest.raises(InputError, match="1 gap, 10 samples missing; the first before sample 2000"):
        read(tmp_path, made)


def test_gaps_duplicates_and_blanks(tmp_path: Path) -> None:
    made = {name: np.delete(values, slice(1000, 1010)) for name, values in axis().items()}
    with pytest.raises(InputError, match="1 gap, 10 samples missing; the first before sample 1000"):
        read(tmp_path, made)
    (tmp_path / "log.csv.map.toml").write_text('gaps = "split"\n' + MAP)
    first, second = read_log(tmp_path / "log.csv")
    assert (len(first), len(second), second.name) == (1000, 2990, "log part 2")
    assert (first.first, second.first) == (0, 1000)  # rows, of which none is missing
    assert "gap" in grave(read(tmp_path, made, 'gaps = "keep"\n'))
    (tmp_path / "log.csv.map.toml").unlink()
    text = (tmp_path / "log.csv").read_text()
    headings = "time (s),command (V),position (mm)" + text[text.index("\n") :]
    (tmp_path / "bare.csv").write_text(headings)
    with pytest.raises(InputError, match=r"1 gap.*`rds data describe bare.csv --write-map` writes a map"):
        read_log(tmp_path / "bare.csv")

    made = {name: np.insert(values, 500, values[500]) for name, values in axis().items()}
    with pytest.raises(InputError, match="1 samples have the time of the one before, the first is sample 501"):
        read(tmp_path, made)
    log = read(tmp_path, made, 'duplicates = "drop"\n')
    assert len(log) == 4000 and grave(log)["duplicate"].sample == 501

    made = axis()
    made["position"][[0, 7]] = np.nan
    with pytest.raises(InputError, match="position has no number in 2 of 4000 samples, first in sample 0"):
        read(tmp_path, made)
    log = read(tmp_path, made, 'blanks = "drop"\ngaps = "keep"\n')
    assert len(log) == 3998 and grave(log)["blanks"].sample == 0

    made = axis()
    made["time"][2000:] -= 1.0
    with pytest.raises(InputError, match=r"time goes back at sample 2000, from 1\.999 to 1 s"):
        read(tmp_path, made)


def test_stretches_at_rest_beside_others_are_left_out_and_named(tmp_path: Path) -> None:
    made = axis()
    made["voltage"][1000:2000] = 0.0
    made["position"][1000:2000] = made["position"][1000]
    made = {name: np.delete(values, [1000, 2000]) for name, values in made.items()}
    read(tmp_path, made, 'gaps = "keep"\n')
    (tmp_path / "log.csv.map.toml").write_text('gaps = "split"\n' + MAP)
    logs = read_log(tmp_path / "log.csv")
    assert [log.name for log in logs] == ["log part 1", "log part 3"]
    for log in logs:
        assert grave(log)["excitation"].what.startswith(
            "log part 2 (1.001 to 1.999 s) was left out: the command is 0 V"
        )
    # alone it stays, with its fault
    made = {name: values[500:1990] if name != "voltage" else 0.0 * values[500:1990] for name, values in made.items()}
    made = {name: np.delete(values, [700]) for name, values in made.items()}
    read(tmp_path, made, 'gaps = "keep"\n')
    (tmp_path / "log.csv.map.toml").write_text('gaps = "split"\n' + MAP)
    logs = read_log(tmp_path / "log.csv")
    assert len(logs) > 1 and {grave(log)["excitation"].gravity for log in logs} == {Gravity.FAULT}


@given(
    steps=st.lists(st.floats(0.91e-3, 1.09e-3), min_size=15, max_size=60),
    holes=st.sets(st.integers(2, 50), max_size=4),
)
def test_stretches_hold_all_samples_but_the_lone_ones(steps: list[float], holes: set[int]) -> None:
    steps = [1e-3 if i % 3 else s for i, s in enumerate(steps)]  # the median stays 1 ms
    for at in holes:
        if at < len(steps):
            steps[at] += 0.05
    time = np.concatenate([[0.0], np.cumsum(steps)])
    base = time_base(time, 0.5, "refuse", "split", "log")
    assert all(0 <= a < b <= len(time) and b - a >= 2 for a, b in base.stretches)
    for first, end in base.stretches:
        assert np.diff(time[first:end]).max() < 1.5 * base.period
    used = sum(b - a for a, b in base.stretches)
    assert used >= len(time) - 1 - len(holes)


# --- steps


@given(
    exponent=st.integers(-7, 1),
    mantissa=st.floats(1.0, 9.99),
    seed=st.integers(0, 1000),
    offset=st.floats(-100.0, 100.0),
)
def test_the_step_of_an_encoder_is_found(exponent: int, mantissa: float, seed: int, offset: float) -> None:
    step = mantissa * 10.0**exponent
    counts = np.cumsum(np.random.default_rng(seed).integers(-9, 10, 2000))
    found = step_of(counts * step + offset * step)
    assert found == pytest.approx(step, rel=1e-6)


@given(seed=st.integers(0, 1000), scale=st.floats(1e-6, 1e6))
def test_noise_has_no_step(seed: int, scale: float) -> None:
    assert step_of(scale * np.random.default_rng(seed).normal(size=3000)) is None


def test_headed_and_mapped_logs_agree(tmp_path: Path) -> None:
    (tmp_path / "mapped").mkdir()
    (guessed,) = read_log(write(tmp_path / "log.csv", headed(axis())))
    mapped = read(tmp_path / "mapped", axis())
    assert np.array_equal(guessed.position, mapped.position) and np.array_equal(guessed.time, mapped.time)


# --- files at the edge


def rows(time: str, command: str, position: str, count: int = 200) -> str:
    """A table by a format of each cell; `i` is the row, `m` counts down, `c` is the row without its last digit."""
    line = f"{time},{command},{position}\n"
    body = "".join(line.format(i=i, j=i % 7, k=i % 3, m=count - i, c=i // 10) for i in range(count))
    return "time [s],u [V],y [mm]\n" + body


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (rows("{i}", "{j}", "{k}", 0), "no lines of numbers"),
        (rows("{i}", "{j}", "{k}", 1), r"'time' does not increase from row to row \(1 rows\)"),
        (rows("{m}", "{j}", "{k}"), r"'time' goes down from row to row; sort the rows by it, the oldest first"),
        (
            rows("{c}", "{j}", "{k}"),
            r"'time' stays the same in 180 of 200 rows: .* rate = [\d.]+ \(Hz, as its stamps go",
        ),
        (rows("{c}", "{j}", "{k}", 35), r" rate = 10 \(Hz, as its stamps go"),  # a line through few stamps says 10.2
        (rows("1", "{j}", "{k}"), r"'time' does not increase from row to row \(200 rows\)"),
        (rows("{i}", "{j}", "nan"), "position has no number in 200 of 200 samples"),
        (rows("{i}", "{j}", "inf"), "position has no number in 200 of 200 samples"),
        (rows("{i}", "{j}e300", "{k}"), r"command \('u'\) holds 1e\+300 in row 1, beyond what is measured"),
        (rows("{i}e-3", "{j}", "{k}").replace("9e-3", "9e300"), "beyond what is measured|goes back"),
    ],
)
def test_files_at_the_edge_are_refused_in_a_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=sentence):
        read_log(path)


@pytest.mark.parametrize("ending", [".mat", ".parquet", ".blf", ".asc", ".log", ".trc", ".csv"])
@settings(max_examples=8)
@given(data=st.binary(max_size=300), whole=st.booleans())
def test_rubbish_of_every_ending_is_refused_in_a_sentence(
    tmp_path_factory: pytest.TempPathFactory, ending: str, data: bytes, whole: bool
) -> None:
    begin = {".mat": b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM", ".parquet": b"PAR1", ".blf": b"LOGG"}
    path = tmp_path_factory.mktemp("rubbish") / f"log{ending}"
    path.write_bytes((begin.get(ending, b"") if whole else b"") + data)
    with pytest.raises(InputError) as refusal:
        read_log(path)
    assert str(refusal.value).startswith(str(path))


def test_a_slip_of_the_encoder_has_its_time(tmp_path: Path) -> None:
    good = axis()
    position = good["position"].copy()
    position[2000:] += 0.12
    log = read(tmp_path, good | {"position": position})
    finding = grave(log)["leap"]
    assert finding.sample == 2000 and "the position leaps at 2 s by +0.1" in finding.what
    alone = good["position"].copy()
    alone[2000] += 0.12  # one reading, there and back
    assert "leap" not in grave(read(tmp_path, good | {"position": alone}))


def test_a_leap_of_a_run_whose_samples_were_late_may_be_one_of_these(tmp_path: Path) -> None:
    made = axis()
    made["position"][2000:] += 0.12
    columns = {"time": made["time"], "X_voltage": made["voltage"], "X_measured": made["position"]}
    meta = {"axes": ["X"], "sample_period": 1e-3, "mode": "system-test", "machine": "mini-cnc", "voltage_range": 10.0}
    for verdict, asked in (("void", True), ("met", False)):
        where = Result(columns, {}, meta | {"verdict": verdict}).save(tmp_path / verdict)
        (log,) = read_log(where)
        assert ("Or was that sample late" in grave(log)["leap"].what) == asked
        said = fit([log], structure("axis"), "simulation").warnings
        (leap,) = [sentence for sentence in said if "the measurement leaps" in sentence]
        assert leap.endswith("Or was that sample late, as the run's timing says of some?") == asked


def test_sampling_that_is_too_slow_is_told_with_the_period_that_would_do(tmp_path: Path) -> None:
    rows = axis(16_000)
    slow = read(tmp_path, {name: values[::50] for name, values in rows.items()})  # 50 ms, and tau is 10 ms
    finding = grave(slow)["sampling"]
    assert "within its sample period of 50 ms" in finding.what and "ms or less tells it" in finding.what
    assert "sampling" not in grave(read(tmp_path, rows))


@pytest.mark.parametrize("every", [1, 2, 5])
def test_positions_that_are_repeated_are_told_with_their_period(every: int) -> None:
    """Measured every 2 ms and logged every 1 ms: a fit had a time constant 5 % too long, 50 standard errors, unsaid.

    Not told of a coarse encoder, nor of an axis at rest or slow.
    """
    T = np.arange(2000)
    way = 20.0 * np.sin(2 * np.pi * T / 500.0)
    read = np.round(way[T // every * every], 3)
    found = sampling.repeated(Log("made", 1e-3 * T, 0.0 * T, read, resolution=1e-3), None)
    assert [f"is new in one of {every} samples only" in f.what for f in found] == [True] * (every > 1)
    assert not found or found[0].sample == every * (found[0].sample // every) + 1
    assert not sampling.repeated(Log("made", 1e-3 * T, 0.0 * T, read, units={"position": "mm/s"}), None)
    for still in (np.round(way / 0.2) * 0.2, np.where(T % 100 < 50, 0.0, way), np.round(way / 1e4, 3)):
        assert not sampling.repeated(Log("made", 1e-3 * T, 0.0 * T, still, resolution=None), None)


def test_ripples_of_a_filter_are_no_leaps_of_an_encoder(tmp_path: Path) -> None:
    """A filtered position has no noise beside which a leap could stand out; a ripple of 1 % of a step is none."""
    t = np.arange(3000) * 1e-3
    position = 20.0 * (1.0 - np.cos(2.0 * t))
    columns = {"time [s]": t, "voltage [V]": np.sin(2.0 * t), "position [mm]": position + 4e-4 * (t > 0.7005)}
    (log,) = read_log(write(tmp_path / "ripple.csv", columns))
    assert not [f for f in log.findings if f.kind == "leap"]
    columns["position [mm]"] = position + 0.1 * (t > 0.7005)
    (log,) = read_log(write(tmp_path / "slip.csv", columns))
    assert ["at 0.701 s by +0." in f.what for f in log.findings if f.kind == "leap"] == [True]


def test_levels_that_are_each_held_are_no_limit(tmp_path: Path) -> None:
    """Random levels of one length each: the highest was taken for a limit. Clipped levels are alike more than once."""
    levels = np.random.default_rng(0).uniform(-6.0, 6.0, 60)
    held = np.repeat(levels, 100)
    columns = axis(6000) | {"voltage": held}
    assert "saturation" not in grave(read(tmp_path, columns))
    ramp = np.maximum(np.linspace(-3.0, 6.0, 6000), 0.0)  # one way, after a rest
    assert "saturation" not in grave(read(tmp_path, columns | {"voltage": ramp}))
    clipped = np.clip(held, -4.0, 4.0)
    assert "limited?" in grave(read(tmp_path, columns | {"voltage": clipped}))["saturation"].what


def test_what_some_stretches_have_is_said_of_these(tmp_path: Path) -> None:
    columns = axis(2000)
    columns["time"] = columns["time"] + 0.01 * sum(columns["time"] >= gap for gap in (0.2195, 0.2795, 0.7195, 0.7795))
    path = write(tmp_path / "log.csv", headed(columns))
    (tmp_path / "log.csv.map.toml").write_text('gaps = "split"\n' + MAP)
    said = [finding.what for finding in describe(path).findings if "only 60 samples" in finding.what]
    assert len(said) == 1 and said[0].startswith("log part 2, log part 4: it has only 60 samples")


@pytest.mark.parametrize("levels", [(4.0, 0.6), (2.0, 1.7), (2.0, 1.85)])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_the_steps_of_a_command_are_no_noise_of_it(tmp_path: Path, levels: tuple[float, float], noise: float) -> None:
    """Two levels each way were taken for one: the steps of a clean command were called noise."""
    voltage = np.repeat([s * level for level in levels for s in (1.0, -1.0)] * 4, 250)
    voltage += noise * np.random.default_rng(1).standard_normal(4000)
    columns = {"time": np.arange(4000) * 1e-3, "voltage": voltage, "position": np.cumsum(voltage) * 1e-3}
    assert not [f for f in read(tmp_path, columns).findings if "one level in each direction" in f.what]
