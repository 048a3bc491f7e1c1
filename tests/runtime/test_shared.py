"""Shared memory of runs that were killed is removed by the next run, that of living ones is not."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from lost_machines import unless_lost

import rds
from rds.core.errors import InputError
from rds.modes.loop.live_values import LiveValues
from rds.modes.process import host, shared
from rds.modes.process.ring import Ring

pytest.importorskip("fcntl")

HOLDER = """
import sys
from rds.modes.process.ring import Ring
ring = Ring.open(sys.argv[1])
print("held", flush=True)
sys.stdin.read()
"""


def test_a_ring_is_removed_when_the_last_of_its_processes_is_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ring = Ring.create(tmp_path / "rds-0.ring", ["a"], 100)
    LiveValues.create(ring.live_values_path, [])
    files = {ring.path, ring.live_values_path}
    command = [sys.executable, "-c", HOLDER, str(ring.path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None and other.stdout.readline() == "held\n"
        monkeypatch.setattr(shared, "_YOUNG", 0.0)
        shared.remove_left(tmp_path)
        assert set(tmp_path.iterdir()) == files
        ring.close()
        shared.remove_left(tmp_path)
        assert set(tmp_path.iterdir()) == files
        other.kill()
    shared.remove_left(tmp_path)
    assert set(tmp_path.iterdir()) == set()


def test_more_columns_than_can_be_described_are_refused(tmp_path: Path) -> None:
    columns = [f"X_a_signal_with_a_long_name_{k}" for k in range(500)]
    with pytest.raises(InputError, match=r"the run's 500 columns take .* let controllers declare fewer signals"):
        Ring.create(tmp_path / "rds-0.ring", columns, 10)


def test_shared_memory_is_there_to_its_last_byte(tmp_path: Path) -> None:
    """In a full /dev/shm, as that of a container soon is, its pages were missing when the loop came to write them."""
    ring = Ring.create(tmp_path / "rds-0.ring", ["a", "b"], 10_000)
    LiveValues.create(ring.live_values_path, []).close()
    ring.close()
    for path in (ring.path, ring.live_values_path):
        about = path.stat()
        assert about.st_blocks * 512 >= about.st_size > 100_000


def test_a_run_whose_memory_finds_no_room_goes_to_the_next_folder_or_says_so(
    alone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    experiment = rds.Experiment(duration=0.1, reference=rds.sinusoid(2.0, 1.0), controller={"name": "p"})
    monkeypatch.setattr(host, "folders", lambda: [alone / "missing", alone])
    unless_lost(lambda: experiment.run("emulation", out=alone / "run"))
    assert not list(alone.glob("rds-*"))
    monkeypatch.setattr(host, "folders", lambda: [alone / "missing"])
    with pytest.raises(InputError, match=r"\(0\.0 MB\) finds no room \(.*missing: No such file.*make some"):
        experiment.run("emulation", out=alone / "none")
    assert not (alone / "none").exists()


def test_a_ring_that_was_just_made_and_what_is_none_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "rds-0.ring").write_bytes(b"")
    shared.remove_left(tmp_path)
    assert (tmp_path / "rds-0.ring").exists()
    monkeypatch.setattr(shared, "_YOUNG", 0.0)
    (tmp_path / "mine").write_text("")
    (tmp_path / "rds-1.ring").symlink_to(tmp_path / "mine")
    (tmp_path / "rds-2.ring").mkdir()
    (tmp_path / "other.ring").write_text("")
    shared.remove_left(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine", "other.ring", "rds-1.ring", "rds-2.ring"]
