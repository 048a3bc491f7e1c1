"""Which tests run beside each other under pytest-xdist, and which one by one."""

from __future__ import annotations

import pytest

from tests.conftest import BROWSER, PANELS, REALTIME, group_of


@pytest.mark.parametrize(
    ("nodeid", "group"),
    [
        ("tests/test_cli.py::test_real_time", REALTIME),
        ("tests/test_cli.py::test_stdout_is_the_json_s_whatever_the_student_prints[simulation]", REALTIME),
        ("tests/test_cli.py::test_help_is_quick", "tests/test_cli.py"),
        ("tests/runtime/test_killed.py::test_a_killed_target", REALTIME),
        ("tests/runtime/test_timing.py::TestWhoseFault::test_met", "tests/runtime/test_timing.py"),
        ("tests/panels/test_help.py::test_help_opens_at_the_page_of_the_panel[a::b]", PANELS),
        ("tests/panels/test_help.py::test_pictures_are_shown", PANELS),  # by what its file builds once, for a page too
        ("tests/panels/test_held.py::test_a_kernel_that_its_code_ends_is_said_and_begun_again", PANELS),
        ("tests/panels/test_file_import.py::test_parts_of_two_files_are_not_mixed", "tests/panels/test_file_import.py"),
    ],
)
def test_only_a_test_that_waits_for_real_time_waits_for_its_turn(nodeid: str, group: str) -> None:
    assert group_of(nodeid) == group


def test_all_that_has_a_page_waits_for_its_turn(request: pytest.FixtureRequest) -> None:
    """Whatever way it comes by it."""
    items = [item for item in request.session.items if "/panels/" in item.nodeid]
    shown = [item.nodeid for item in items if not BROWSER.isdisjoint(getattr(item, "fixturenames", ()))]
    assert not [nodeid for nodeid in shown if group_of(nodeid) != PANELS]


def test_all_that_is_marked_waits_for_its_turn(request: pytest.FixtureRequest) -> None:
    marked = [item.nodeid for item in request.session.items if item.get_closest_marker("realtime")]
    assert not [nodeid for nodeid in marked if group_of(nodeid) not in (REALTIME, PANELS)]
