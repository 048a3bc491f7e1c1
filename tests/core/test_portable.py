"""What goes to other processes, made by several threads at once."""

from __future__ import annotations

import pickle
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cloudpickle
import pytest

from rds.core.load import load_student
from rds.core.portable import portable
from rds.core.run_text import STUDENT_MODULE


def test_laws_of_the_tests_of_other_files_are_no_modules_any_more() -> None:
    """See `forgotten_laws` in tests/conftest.py; what the files themselves load as they are imported stays."""
    assert sum(name.startswith(STUDENT_MODULE) for name in sys.modules) < 20


def test_threads_that_pack_at_the_same_time_do_not_disturb_each_other(tmp_path: Path) -> None:
    path = tmp_path / "law.py"
    path.write_text("def control(t, r, y, state, params):\n    return 3.0, state\n")
    student = load_student(path)
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as threads:
            packed = list(threads.map(lambda _: portable(student), range(400)))
    finally:
        sys.setswitchinterval(before)
    assert len(set(packed)) == 1
    assert not cloudpickle.list_registry_pickle_by_value()


def test_an_error_in_code_that_travelled_names_the_file_it_was_written_in(tmp_path: Path) -> None:
    path = tmp_path / "law.py"
    path.write_text("def control(t, r, y, state, params):\n    return [undefined for _ in range(2)], state\n")
    travelled = pickle.loads(portable(load_student(path).functions["control"]))
    with pytest.raises(NameError) as raised:
        travelled(0.0, None, 0.0, [], {})
    assert {entry.path for entry in raised.traceback[1:]} == {path}
