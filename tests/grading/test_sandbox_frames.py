"""What comes out of a sandbox is read strictly; what goes in is refused unless it is a regular file."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import rds
from rds.grading.grade import Status
from rds.grading.sandbox import SubmissionError, frames
from rds.grading.sandbox.bubblewrap import ROOMS
from rds.grading.sandbox.output import printable
from rds.grading.sandbox.submission import LARGEST, read_submission

PLAIN = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**63)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=20,
)


@given(PLAIN)
def test_plain_values_come_back_as_they_went(value: object) -> None:
    data = frames.encode(value)
    header, body = data[: frames.HEADER.size], data[frames.HEADER.size :]
    assert frames.size(header) == len(body)
    assert frames.decode(body) == value


@given(st.binary(max_size=200))
def test_any_bytes_are_a_value_or_a_frame_error(data: bytes) -> None:
    try:
        value = frames.decode(data)
    except frames.FrameError:
        return
    json.dumps(value, allow_nan=False)


@pytest.mark.parametrize(
    "text",
    ["NaN", "[Infinity]", "-Infinity", "1e999", "[" * 22 + "]" * 22, "[" * 100_000, "9" * 5000, '{"a":1}x', "\ud800"],
)
def test_what_is_not_finite_shallow_json_is_refused(text: str) -> None:
    with pytest.raises(frames.FrameError):
        frames.decode(text.encode(errors="surrogatepass"))


def test_a_frame_that_is_too_large_is_refused_before_it_is_read() -> None:
    with pytest.raises(frames.FrameError, match="4294967295 bytes"):
        frames.size(b"\xff" * 4)
    with pytest.raises(frames.FrameError, match="takes"):
        frames.encode("x" * (frames.LARGEST + 1))


@given(st.text())
def test_printed_text_cannot_move_the_cursor(text: str) -> None:
    assert all(each.isprintable() or each in "\n\t" for each in printable(text))


def test_only_a_regular_file_of_a_sensible_size_is_opened(tmp_path: Path) -> None:
    good = tmp_path / "good.py"
    good.write_text("import scipy.signal\n")
    (tmp_path / "link.py").symlink_to("/etc/shadow")
    os.mkfifo(tmp_path / "pipe.py")
    (tmp_path / "folder.py").mkdir()
    (tmp_path / "large.py").write_bytes(b"#" * (LARGEST + 1))
    for name in ("link.py", "pipe.py", "folder.py", "large.py"):
        with pytest.raises(SubmissionError) as caught:
            read_submission(tmp_path / name)
        assert caught.value.status is Status.REFUSED, name
    with pytest.raises(SubmissionError) as caught:
        read_submission(tmp_path / "none.py")
    assert caught.value.status is Status.MISSING
    found = read_submission(good)
    assert found.name == "good.py"
    assert found.imports("scipy")
    assert not found.imports("control")


def test_a_name_that_could_mislead_is_replaced(tmp_path: Path) -> None:
    for name in ("line\nbreak.py", "a b.py", "ümläut.py", "-rf.py", "x" * 200 + ".py"):
        (tmp_path / name).write_text("")
        assert read_submission(tmp_path / name).name == "submission.py"


def test_all_that_runs_inside_is_visible_inside() -> None:
    """A room that imports another one would otherwise break every sandbox at once."""
    script = "import sys, rds.grading.sandbox.inside.warm, rds.grading.sandbox.inside.worker\n"
    script += "print(*[m.__file__ for n, m in sys.modules.items() if n.partition('.')[0] == 'rds'], sep='\\n')"
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    package = Path(rds.__file__).parent
    visible = [package / room for room in ROOMS]
    loaded = [Path(line) for line in said.split("\n") if line]
    assert len(loaded) > 20
    assert [str(file) for file in loaded if not any(file.is_relative_to(place) for place in visible)] == []
