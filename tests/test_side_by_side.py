"""Which tests run beside each other under pytest-xdist, and which one by one."""

from __future__ import annotations

from collections import Counter

import pytest

from tests.conftest import HERE, LANES, PANELS, REALTIME, group_of, waiting_for_real_time


@pytest.mark.parametrize(
    ("nodeid", "group"),
    [
        ("tests/test_cli.py::test_real_time", REALTIME),
        ("tests/test_cli.py::test_stdout_is_the_json_s_whatever_the_student_prints[simulation]", REALTIME),
        ("tests/test_cli.py::test_help_is_quick", "tests/test_cli.py"),
        ("tests/runtime/test_killed.py::test_a_killed_target", REALTIME),
        ("tests/runtime/test_timing.py::TestWhoseFault::test_met", "tests/runtime/test_timing.py"),
        ("tests/panels/test_help.py::test_the_search[a::b]", PANELS),
    ],
)
def test_only_a_test_that_waits_for_real_time_waits_for_its_turn(nodeid: str, group: str) -> None:
    assert group_of(nodeid).startswith(group)


def test_the_lanes_of_real_time_are_used_alike_and_a_file_keeps_to_one() -> None:
    lanes: Counter[str] = Counter()
    for file in HERE.rglob("test_*.py"):
        path = file.relative_to(HERE.parent).as_posix()
        if "/panels/" not in path and (names := waiting_for_real_time(path)):
            (lane,) = {group_of(f"{path}::{name}") for name in names}
            lanes[lane] += 1
    assert len(lanes) == LANES and min(lanes.values()) > 0.5 * max(lanes.values()), lanes


def test_all_that_is_marked_waits_for_its_turn(request: pytest.FixtureRequest) -> None:
    marked = [item.nodeid for item in request.session.items if item.get_closest_marker("realtime")]
    assert not [nodeid for nodeid in marked if not group_of(nodeid).startswith((REALTIME, PANELS))]
