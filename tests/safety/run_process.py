"""A run in a process of its own: python run_process.py EXPERIMENT FOLDER. Exit code 2: refused, explained on stderr."""

from __future__ import annotations

import sys
from pathlib import Path

from rds.core.errors import RdsError
from rds.modes.experiment.experiment import Experiment

if __name__ == "__main__":
    try:
        Experiment.from_toml(sys.argv[1]).run(out=Path(sys.argv[2])).save(Path(sys.argv[2]) / "result.csv")
    except RdsError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(2)
