"""Every attack ends with a status and a reason, and neither the next submission nor the computer notices it."""

from __future__ import annotations

import re
import resource
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from rds.grading.grade import Status
from rds.grading.sandbox import Pool
from tests.grading.attacked import HONEST, SAMPLES, Machine, Outcome, run
from tests.grading.attacks import (
    PATIENT,
    Attack,
    changing,
    escaping,
    forging,
    leaving,
    looking,
    lying,
    seeming,
    spying,
    taking,
)

Written = Callable[..., Path]
KINDS = (changing, escaping, forging, leaving, looking, lying, seeming, spying, taking)
ATTACKS: dict[str, Attack] = {name: attack for kind in KINDS for name, attack in kind.ATTACKS.items()}


@pytest.fixture(scope="module")
def honest(pool: Pool, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Somebody else's submission."""
    path = tmp_path_factory.mktemp("next") / "submission.py"
    path.write_text(HONEST)
    return path


@pytest.fixture(scope="module")
def before(pool: Pool, honest: Path) -> Outcome:
    """What it answers when nobody has attacked anything yet."""
    found = run(pool, honest, PATIENT)
    assert (found.status, len(set(found.answers))) == (Status.OK, SAMPLES)
    return found


@pytest.fixture(scope="module")
def machine(pool: Pool, before: Outcome) -> Machine:
    """The computer before the first attack."""
    return Machine(pool)


@pytest.fixture(scope="module", autouse=True)
def memory(before: Outcome) -> Iterator[None]:
    """The grader's own process has not grown in the end: what attackers send is not kept."""
    first = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # KiB
    yield
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - first < 64 << 10


@pytest.mark.parametrize("name", ATTACKS)
def test_an_attack_ends_with_a_reason_and_nobody_else_notices(
    name: str,
    pool: Pool,
    written: Written,
    honest: Path,
    before: Outcome,
    machine: Machine,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    attack = ATTACKS[name]
    for beside in ("numpy.py", "json.py", "os.py"):
        written("raise SystemExit('shadow')", "", beside)
    monkeypatch.setenv("GRADER_TOKEN", "ATTACK-CANARY")
    found = run(pool, written(attack.whole, ""), attack.limits)
    assert "not inside" not in found.reason
    assert found.status is attack.status, found
    assert re.search(attack.said, found.reason), found
    if attack.status is Status.OK:
        assert found.answers == [1.0] * (SAMPLES + 3)
    else:
        assert found.reason.strip()
    if found.answers:
        assert found.output.startswith("inside\n")
    assert machine.fault() == ""
    assert run(pool, honest, PATIENT) == before
