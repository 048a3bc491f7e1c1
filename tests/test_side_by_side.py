"""Which tests run beside each other under pytest-xdist, and which one by one."""

from __future__ import annotations

import pytest

from tests.conftest import PANELS, REALTIME, group_of


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
    assert group_of(nodeid) == group


def test_all_that_is_marked_waits_for_its_turn(request: pytest.FixtureRequest) -> None:
    marked = [item.nodeid for item in request.session.items if item.get_closest_marker("realtime")]
    assert not [nodeid for nodeid in marked if group_of(nodeid) not in (REALTIME, PANELS)]
