"""Attacks on what crosses the wall: the pipes and the shared memory that the grader itself reads and waits at."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from rds.core.types import LineSegment
from rds.grading.grade import Status
from rds.grading.sandbox import Pool, SubmissionError
from tests.grading.attacked import HONEST, Machine, Outcome, run
from tests.grading.attacks import CONTROL, INSIDE, PATIENT, SHORT, in_control

Written = Callable[..., Path]

ENDS = """
import os, stat, struct, mmap, fcntl, random, time
_there = []
for _number in range(3, 64):
    try: os.fstat(_number)
    except OSError: continue
    _there.append(_number)
questions, answers, memory, question_bell, answer_bell = _there
shared = mmap.mmap(memory, 4096)
def frame(text):
    data = text if isinstance(text, bytes) else text.encode()
    os.write(answers, struct.pack("<I", len(data)) + data)
def record(k, code, *values):
    data = struct.pack(f"<QQ{len(values)}d", k, code, *values)
    shared[2048:2048 + len(data)] = data
    return data
def come(number):
    shared[256:264] = struct.pack("<Q", number)
    time.sleep(9)
"""
FILL = """
import ctypes
try: fcntl.fcntl(question_bell, 4, 0)
except OSError: pass
ctypes.CDLL(None).ioctl(question_bell, 0x5421, ctypes.byref(ctypes.c_int(0)))
assert fcntl.fcntl(question_bell, 3) & os.O_NONBLOCK
os.write(question_bell, struct.pack("<Q", (1 << 64) - 2))
shared[(32 + 1) * 8:(32 + 2) * 8] = struct.pack("<Q", 1)
"""
IN_SAMPLES = {
    "another sample's number": "os.write(answers, record(7, 0, 1.0)); come(6)",
    "a code that is none": "os.write(answers, record(5, 9, 1.0)); come(6)",
    "an end that is none": "os.write(answers, record(5, 2, 1.0)); come(6)",
    "NaN past all checks": ("os.write(answers, record(5, 0, float('nan'))); come(6)"),
    "a fault without a text": ("os.write(answers, record(5, 1, 1.0)); frame('[]'); come(6)"),
    "a fault whose text is not one": (
        'os.write(answers, record(5, 1, 1.0)); frame(b\'{"error": "\\xff\\xfe"}\')\ncome(6)'
    ),
    "half a record": "os.write(answers, b'12345'); time.sleep(9)",
    "counters far ahead": "shared[256:264] = b'\\xff' * 8; os.write(answers, b'\\xff' * 999); time.sleep(9)",
    "everything overwritten": "shared[:] = random.randbytes(4096); os.write(answers, shared[:]); time.sleep(9)",
    "a bell that is rung without end": "while True: os.write(answer_bell, struct.pack('<Q', 1))",
    "records without end": "while True: os.write(answers, b'\\xfe' * 4096)",
}
LOADING = {
    "NaN in JSON": '{"defines": [], "params": {"x": NaN}, "problem": ""}',
    "infinity in JSON": '{"defines": [], "params": {"x": 1e999}, "problem": ""}',
    "an integer beyond floats": '{"defines": [], "params": {"x": ' + "9" * 4000 + '}, "problem": ""}',
    "half a character": r'{"defines": [], "params": {"x": "\ud800"}, "problem": ""}',
    "half a character in a key": r'{"defines": [], "params": {"\udfff": 1}, "problem": ""}',
    "lists in lists": "[" * 100_000,
    "lists in lists that end": "[" * 900 + "]" * 900,
    "no dict": "[1, 2]",
    "other types": '{"defines": 7, "params": [], "problem": null}',
    "params that are none": '{"defines": [], "params": "x", "problem": ""}',
    "nothing": "",
}


@pytest.fixture(scope="module", params=["memory", "pipes"])
def either(request: pytest.FixtureRequest, pool: Pool) -> Iterator[Pool]:
    """A pool that has a processor for each side, if this computer has two, and one that has not."""
    if request.param == "memory":
        yield pool
        return
    with Pool(jobs=64, slot=0) as made:
        yield made


@pytest.fixture(scope="module")
def before(either: Pool, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Outcome, Machine]:
    """Somebody else's submission, what it answers, and the computer before the first attack."""
    path = tmp_path_factory.mktemp("next") / "submission.py"
    path.write_text(HONEST)
    found = run(either, path, PATIENT)
    assert found.status is Status.OK
    return path, found, Machine(either)


def unchanged(pool: Pool, before: tuple[Path, Outcome, Machine]) -> None:
    """Nobody else has noticed anything."""
    path, found, machine = before
    assert machine.fault() == ""
    assert run(pool, path, PATIENT) == found


@pytest.mark.parametrize("name", IN_SAMPLES)
def test_a_sample_s_mailbox(name: str, either: Pool, written: Written, before: tuple[Path, Outcome, Machine]) -> None:
    found = run(either, written(INSIDE + ENDS + in_control(IN_SAMPLES[name]), ""), SHORT)
    assert found.status in (Status.BROKE_CONTRACT, Status.TIMED_OUT), found
    assert (found.answers, found.output[:7]) == ([1.0] * 5, "inside\n"), found
    unchanged(either, before)


@pytest.mark.parametrize("name", LOADING)
def test_what_it_says_of_itself(
    name: str, either: Pool, written: Written, before: tuple[Path, Outcome, Machine]
) -> None:
    text = INSIDE + ENDS + f"frame({LOADING[name]!r})\ntime.sleep(9)\n"
    found = run(either, written(text), SHORT)
    assert found.status in (Status.BROKE_CONTRACT, Status.FAILED_TO_LOAD), found
    assert "pipe" in found.reason
    unchanged(either, before)


def test_the_grader_never_waits_at_a_bell(
    either: Pool, written: Written, before: tuple[Path, Outcome, Machine]
) -> None:
    """A bell that is full makes who rings it wait, if it may: then nothing that the submission suffers would help."""
    found = run(either, written(INSIDE + ENDS + in_control(FILL)), SHORT)
    assert found.status is Status.OK, found
    assert found.answers == [1.0] * len(found.answers)
    unchanged(either, before)


def test_the_shared_memory_keeps_its_size(
    either: Pool, written: Written, before: tuple[Path, Outcome, Machine]
) -> None:
    body = """
for size in (0, 1, 1 << 30):
    try: os.ftruncate(memory, size)
    except OSError: continue
    raise AssertionError(size)
import ctypes
ctypes.CDLL(None).fallocate(memory, 3, ctypes.c_long(0), ctypes.c_long(4096))  # a hole reads as zeros
"""
    found = run(either, written(INSIDE + ENDS + in_control(body)), SHORT)
    assert found.status in (Status.OK, Status.TIMED_OUT), found
    unchanged(either, before)


@pytest.mark.parametrize("count", ["float('nan')", "float('inf')", "-1.0", "1e300", "65.0", "0.5"])
@pytest.mark.parametrize("code", [0, 2])
def test_a_block_of_rows_with_an_impossible_count(count: str, code: int, pool: Pool, written: Written) -> None:
    text = (
        INSIDE
        + ENDS
        + f"""
def interpolate(segment, T, params):
    os.write(answers, record(0, {code}, {count}, *[0.0] * 192 * len(segment.start)))
    time.sleep(9)
    yield
"""
    )
    with pool.open(written(text, ""), SHORT, "interpolator") as subject:
        with pytest.raises(SubmissionError) as caught:
            list(subject.rows(LineSegment((0.0,), (10.0,), 10.0), 1e-3))
        assert subject.output.startswith("inside\n")
    assert caught.value.status is Status.BROKE_CONTRACT


def test_rows_that_are_not_finite_at_the_end(pool: Pool, written: Written) -> None:
    text = (
        INSIDE
        + ENDS
        + """
def interpolate(segment, T, params):
    os.write(answers, record(0, 2, 1.0, *[float("nan")] * 192 * len(segment.start)))
    time.sleep(9)
    yield
"""
    )
    opened = pool.open(written(text, ""), SHORT, "interpolator")
    with opened as subject, pytest.raises(SubmissionError, match="not finite"):
        list(subject.rows(LineSegment((0.0,), (10.0,), 10.0), 1e-3))


@pytest.mark.parametrize("output", ["9" * 320, "true", "null", '"1"', "[1]", "1e400"])
def test_a_model_s_first_output(output: str, pool: Pool, written: Written) -> None:
    text = (
        INSIDE
        + ENDS
        + f"""
initial_state = 0.0
def advance(x, u, T, params):
    return x
def output(x, params):
    frame('{{"output": {output}}}')
    time.sleep(9)
"""
    )
    with pytest.raises(SubmissionError) as caught, pool.open(written(text, ""), SHORT, "model") as subject:
        subject.begin_model({}, 1e-3)
        subject.advance(1.0)
    assert "not inside" not in caught.value.reason
    assert caught.value.status in (Status.BROKE_CONTRACT, Status.FAILED_TO_LOAD)


def test_a_model_s_first_output_that_is_infinite_is_no_voltage(pool: Pool, written: Written) -> None:
    text = "initial_state = 0.0\ndef advance(x, u, T, params): return x\n"
    text += "def output(t, x, u, params): return float('inf')\n"
    with (
        pool.open(written(text, ""), SHORT, "model") as subject,
        pytest.raises(SubmissionError, match="its output before the first sample is inf; it must be one finite number"),
    ):
        subject.begin_model({}, 1e-3)


@pytest.mark.parametrize("value", ["9" * 320, r'"\\ud800"', "NaN", "[" * 50 + "]" * 50])
def test_what_a_function_returns(value: str, pool: Pool, written: Written) -> None:
    text = INSIDE + ENDS + f"def attack():\n    frame('{{\"value\": {value}}}')\n    time.sleep(9)\n"
    with pool.open(written(text, ""), SHORT, "functions") as subject:
        with pytest.raises(SubmissionError, match="pipe"):
            subject.call("attack")
        assert subject.output.startswith("inside\n")


@pytest.mark.parametrize("seed", range(12))
def test_random_bytes_are_an_error_of_the_submission(
    seed: int, either: Pool, written: Written, before: tuple[Path, Outcome, Machine]
) -> None:
    """Frames and records of random content, some of it nearly right; nothing but SubmissionError may come of it."""
    draw = random.Random(seed)
    near = [b'{"begun": true}', b'{"error": "x"}', b"{}", b"[[[", b'{"error": 1}', b"\xff" * 9, b"1" * 5000]
    pieces = [draw.choice(near) if draw.random() < 0.5 else draw.randbytes(draw.randint(0, 60)) for _ in range(6)]
    framed = draw.random() < 0.6
    parts = [len(piece).to_bytes(4, "little") + piece if framed else piece for piece in pieces]
    body = f"os.write(answers, {b''.join(parts)!r})\nshared[2048:4096] = random.Random({seed}).randbytes(2048)\n"
    body += f"shared[256:264] = struct.pack('<Q', {draw.randint(0, 9)})\ntime.sleep(9)\n"
    attack = INSIDE + ENDS + (body if seed % 3 == 0 else in_control(body))
    found = run(either, written(attack, CONTROL if seed % 3 == 0 else ""), SHORT)
    assert found.status in (Status.BROKE_CONTRACT, Status.TIMED_OUT, Status.FAILED_TO_LOAD), found
    assert "not inside" not in found.reason
    unchanged(either, before)


def test_a_bell_cannot_be_made_to_wait(pool: Pool, written: Written) -> None:
    text = """
def attack():
    refused = 0
    for number in (question_bell, answer_bell):
        try: fcntl.fcntl(number, fcntl.F_SETFL, 0)
        except PermissionError: refused += 1
        try: os.set_blocking(number, True)
        except PermissionError: refused += 1
    return [refused, *(bool(fcntl.fcntl(n, fcntl.F_GETFL) & os.O_NONBLOCK) for n in (question_bell, answer_bell))]
"""
    with pool.open(written(INSIDE + ENDS + text, ""), SHORT, "functions") as subject:
        assert subject.call("attack") == [4, True, True]
