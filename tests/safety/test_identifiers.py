"""Two machines on one channel are found by a scan and at the start of a run, and both are named."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from .conftest import Bench, expect

pytestmark = pytest.mark.realtime


def test_a_clash_is_refused_with_both_named(bench: Bench) -> None:
    bench.serve()
    bench.serve()
    scan = bench.rds("scan")
    reason = expect(bench.host(6.0), "lost")
    for said in (scan.stderr, reason):
        serials = re.findall(r"serial number (\d+)", said)
        assert f"{bench.node} is used 2 times" in said and len(set(serials)) == 2, said
    assert scan.exit_code == 2 and scan.stdout == ""
    assert bench.counts() == bench.start_counts, "nothing has moved"


@pytest.mark.parametrize("bench", ["cia402"], indirect=True)  # the drivers are those of the host above
def test_a_run_is_refused(bench: Bench, tmp_path: Path) -> None:
    bench.serve()
    bench.serve()
    run = bench.start_run(tmp_path)
    out, err = run.communicate(timeout=60)
    assert run.returncode == 2 and out == "" and f"{bench.node} is used 2 times" in err


@pytest.mark.parametrize("bench", ["rds"], indirect=True)
def test_modules_of_two_dialects_clash_too(bench: Bench) -> None:
    bench.serve("Z")  # node 4
    bench.serve("X", "oacs")  # number 4
    scan = bench.rds("scan")
    assert scan.exit_code == 2 and "number 4 is used 2 times" in scan.stderr
    assert "module with serial number" in scan.stderr and "LinrXa with serial number" in scan.stderr
