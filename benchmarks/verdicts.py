"""Verdicts against truth: the table of what `rds validate` says of right and wrong models, and its two error rates.

python -m benchmarks.verdicts [--machines 300] [--first 0] [--jobs 2] [--keep FILE] [--json]

*Right ones called wrong* counts right models (exact, or fitted to another log of the same machine) with exit code 1, of
logs that suffice. *Wrong ones called valid* counts models with exit code 0 for something that they are wrong in: any
use where the gain is off or the sign; the position where friction is; and frequencies at which the phase is off by
more than half again its band, where time constant, delay or time are.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from benchmarks.figures import Figure
from benchmarks.truths import Case, cases
from rds.identification.validate.assessment import assess
from rds.identification.validate.judge import judge
from rds.identification.validate.verdict import Bands

LIMIT = 2.0  # %
_FORGIVEN = 1.5  # times the band of the phase


@dataclass(frozen=True)
class Row:
    """One verdict."""

    machine: int
    kind: str
    right: bool
    suffices: bool
    says: str  # word and purpose, without their numbers
    error: bool  # whether it counts in the rate of its side


def rows(number: int, kinds: Sequence[str] = ()) -> list[Row]:
    """The verdicts on the models of one machine; of these `kinds` only, if any are given."""
    found: list[Row] = []
    for case in cases(number):
        if not kinds or case.kind in kinds:
            found.append(_row(case))
            if len(found) == len(kinds):  # there is one of each; those to come are fitted first
                break
    return found


def _row(case: Case) -> Row:
    # as `validate` does, without the note of what other choices would say, which changes no word and doubles the time
    verdict = judge(case.candidate, assess(case.candidate, case.log), Bands())
    says = f"{verdict.word} {re.sub(r'[0-9.e+-]+ (?=mm/s|Hz)', '… ', verdict.purpose)}".strip()
    error = not verdict.ok if not case.wrong else verdict.ok and _claims(case, verdict.purpose)
    return Row(case.machine.number, case.kind, not case.wrong, case.suffices, says, error)


def _claims(case: Case, purpose: str) -> bool:
    """Whether what the verdict says that the model is good for includes what it is wrong in."""
    if case.wrong == "friction":
        return "position" in purpose or not purpose
    frequency = re.search(r"up to ([0-9.e+-]+) Hz", purpose)
    if case.wrong == "lag" and frequency:
        return 360.0 * float(frequency[1]) * case.lag > _FORGIVEN * Bands().phase_degrees
    return True


def table(found: Iterable[Row]) -> list[tuple[str, int, str]]:
    """Kind of model, count, and what was said how often, as rows."""
    said: dict[str, Counter[str]] = {}
    for row in found:
        kind = row.kind if row.suffices or not row.right else f"{row.kind}, log too weak"
        said.setdefault(kind, Counter())[row.says] += 1
    return [
        (kind, counts.total(), "; ".join(f"{n} {what}" for what, n in counts.most_common()))
        for kind, counts in said.items()
    ]


def rates(found: Sequence[Row]) -> tuple[Figure, Figure]:
    """The two error rates."""
    right = [row for row in found if row.right and row.suffices]
    wrong = [row for row in found if not row.right]
    return (
        _rate("right models called wrong", right),
        _rate("wrong models called valid for what they are wrong in", wrong),
    )


def _rate(name: str, counted: Sequence[Row]) -> Figure:
    errors = [row for row in counted if row.error]
    which = ", ".join(f"{row.machine}: {row.kind}" for row in errors[:6])
    note = f"{len(errors)} of {len(counted)}" + (f" ({which})" if which else "")
    note += f"; at most {100.0 * _most(len(errors), len(counted)):.2f} % with 95 % confidence"
    return Figure(name, "%", (100.0 * len(errors) / max(len(counted), 1),), limit=LIMIT, note=note)


def _most(errors: int, count: int) -> float:
    """The largest rate at which so few errors come up by chance in one of 20 such counts (Clopper and Pearson)."""
    from scipy.stats import beta

    return float(beta.ppf(0.95, errors + 1, count - errors)) if errors < count else 1.0


def run(machines: int = 300, first: int = 0, jobs: int = 2, keep: Path | None = None) -> Iterator[Row]:
    """The verdicts on this many machines, in `jobs` processes. What the file `keep` has of them is not made again."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of each process
    wanted = range(first, first + machines)
    lines = keep.read_text().splitlines() if keep is not None and keep.exists() else []
    kept = [row for row in (Row(**json.loads(line)) for line in lines) if row.machine in wanted]
    yield from kept
    done = {row.machine for row in kept}
    with ProcessPoolExecutor(jobs) as pool:
        for found in pool.map(partial(rows), [number for number in wanted if number not in done]):
            if keep is not None:
                with keep.open("a") as file:
                    file.write("".join(json.dumps(asdict(row)) + "\n" for row in found))
            yield from found


def main() -> int:
    """Exit code 0 if both rates are met."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.verdicts", description=__doc__)
    parser.add_argument("--machines", type=int, default=300)
    parser.add_argument("--first", type=int, default=0, help="number of the first machine; others are other draws")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument(
        "--keep", type=Path, help="file of verdicts: an ended run goes on from it; remove it after a change"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout, nothing else")
    options = parser.parse_args()
    found = list(run(options.machines, options.first, options.jobs, options.keep))
    figures = rates(found)
    if options.json:
        print(json.dumps({"table": table(found), "rates": [f.to_json() for f in figures]}, ensure_ascii=False))
    else:
        print("| model | models | verdicts |\n| --- | --- | --- |")
        for kind, count, said in table(found):
            print(f"| {kind} | {count} | {said} |")
        for figure in figures:
            print(f"{figure.name}: {figure.value:.1f} % ({figure.note}), {'met' if figure.met else 'NOT MET'}")
    return 0 if all(figure.met for figure in figures) else 1


if __name__ == "__main__":
    sys.exit(main())
