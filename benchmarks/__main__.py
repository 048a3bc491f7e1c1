"""All benchmarks, each as a table with its targets, or everything as one JSON object.

python -m benchmarks [SUBJECT ...] [--json]
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import Any

from benchmarks import (
    bus,
    cia402,
    contour,
    grading,
    identification,
    imports,
    install,
    kinematics,
    live_values,
    machine,
    million_rows,
    motion,
    nc,
    network,
    panels,
    rate,
    realtime,
    robustness,
    simulation,
    timed_bus,
)
from benchmarks.figures import TITLES, Figure
from rds.cli.console import show_table

SUBJECTS = {
    "simulation": "Ten seconds of the demo's X axis: 10,000 samples",
    "imports": "Until something can be typed",
    "realtime": "The real-time loop at 1 kHz beside cyclictest",
    "bus": "The built-in bus beside python-can's virtual",
    "timed-bus": "Four modules on the bus with bit timing: 1 Mbit/s, 1 kHz",
    "cia402": "CiA 402 drives at 1 Mbit/s: our cyclic loop beside the canopen library's",
    "nc": "Part programs: 200,000 lines and arcs, beside rs274 -g",
    "motion": "Planned motion beside the least time of its path, and beside LinuxCNC's planner",
    "contour": "A circle of 10 mm under every law, on a machine with everything wrong in it",
    "live-values": "Live values and part programs in the loop",
    "identification": "A fit of tau, K, F+ and F- to 10 s at 1 kHz",
    "million-rows": "A log of a million rows described and fitted, beside pandas reading it",
    "rate": "What a path costs, and how fast a loop can be",
    "robustness": "10,000 closed loops with drawn parameters",
    "network": "A network in the loop: random delay and loss, and what delay costs",
    "grading": "Submissions graded in the sandbox: five criteria of a 10 s run",
    "kinematics": "A million poses of the 4- and 5-axis mill",
    "panels": "The page of rds app in a browser",
    "install": "What an installation takes",
}


def run_bus() -> list[Figure]:
    """The bus, in a process of its own: it raises its priority."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        subjects = process.submit(bus.run).result()
    return [
        Figure(f"{subject}: {measure}", runs=(float(value),))
        for subject, values in subjects.items()
        for measure, value in values.items()
    ]


def run_timed_bus() -> list[Figure]:
    """The bus with bit timing, in a process of its own: it raises its priority too."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        return process.submit(timed_bus.run).result()


def run_cia402() -> list[Figure]:
    """Drives, in a process of its own."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        return process.submit(cia402.run).result()


def main() -> int:
    """Exit code 0 if every target that could be measured is met, else 1."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("subjects", nargs="*", metavar="SUBJECT", help=f"{', '.join(SUBJECTS)}; all by default")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout, nothing else")
    parser.add_argument("--seconds", type=float, default=30.0, help="of each real-time run (default 30)")
    parser.add_argument(
        "--peer-python",
        default=sys.executable,
        help="an interpreter that has the peers (bdsim, control and rds; gcodeparser, pygcode; nbgrader; toppra)",
    )
    parser.add_argument("--quiet-load", type=float, default=0.5, help="load average to wait for (default 0.5)")
    parser.add_argument("--patience", type=float, default=60.0, help="s to wait for it before each (default 60)")
    options = parser.parse_args()
    if unknown := set(options.subjects) - set(SUBJECTS):
        parser.error(f"unknown subject {', '.join(sorted(unknown))}; known: {', '.join(SUBJECTS)}")
    runs: dict[str, Callable[[], list[Figure]]] = {
        "simulation": lambda: simulation.run(peer_python=options.peer_python),
        "imports": imports.run,
        "realtime": lambda: realtime.run(seconds=options.seconds),
        "bus": run_bus,
        "timed-bus": run_timed_bus,
        "cia402": run_cia402,
        "contour": contour.run,
        "motion": lambda: motion.run(peer_python=options.peer_python),
        "live-values": live_values.run,
        "identification": identification.run,
        "million-rows": million_rows.run,
        "rate": rate.run,
        "robustness": robustness.run,
        "network": network.run,
        "grading": lambda: grading.run(peer_python=options.peer_python),
        "kinematics": kinematics.run,
        "panels": panels.run,
        "install": install.run,
        "nc": lambda: nc.run(peer_python=options.peer_python),
    }
    report: dict[str, Any] = {"machine": machine.machine(), "versions": machine.versions(), "subjects": {}}
    for name in options.subjects or SUBJECTS:
        before = machine.wait_for_quiet(options.quiet_load, options.patience)
        rivals = machine.rivals()
        figures = runs[name]()
        subject = {"load_before": before, "rivals_before": rivals, "figures": [figure.to_json() for figure in figures]}
        report["subjects"][name] = subject
        if not options.json:
            note = "" if before is None else f"before: load average {before:.2f}, {rivals} rival real-time processes"
            show_table(SUBJECTS[name], TITLES, [figure.cells() for figure in figures], note)
    if options.json:
        print(json.dumps(report, ensure_ascii=False))
    else:
        for title in ("machine", "versions"):
            rows = [[key, "–" if value is None else str(value)] for key, value in report[title].items()]
            show_table(title.capitalize(), ("", ""), rows)
    judged = [figure["met"] for subject in report["subjects"].values() for figure in subject["figures"]]
    return 1 if False in judged else 0


if __name__ == "__main__":
    sys.exit(main())
