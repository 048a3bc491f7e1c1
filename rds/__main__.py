"""The console command `rds`, and `python -m rds`: light, so that Ctrl-C is heeded while the rest is imported."""

from __future__ import annotations

import gc
import os
import sys

from rds.core.garbage import collect_rarely

_ELSEWHERE = {"--help", "--container", "--scheduler"}  # with which `rds grade run` has no worker here
_INTERRUPTED = 130  # the exit code of what Ctrl-C ended, by the shell's custom


def open_streams() -> None:
    """What is closed of stdin, stdout and stderr reads and writes nothing from here on.

    Else the next file or socket would get its number, which a child that is started takes for its stdin.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None and os.open(os.devnull, os.O_RDWR) == number:
            setattr(sys, name, os.fdopen(number, "w" if number else "r", closefd=False))


def main() -> None:
    """Run the command line; Ctrl-C in the middle of an import is no traceback."""
    open_streams()
    collect_rarely()
    try:
        if sys.argv[1:3] == ["nc", "canon"]:
            from rds.cli.canon import canon_alone

            code = canon_alone(sys.argv[1:])
            if code is not None:
                sys.exit(code)
        if sys.argv[1:3] == ["grade", "run"] and sys.platform == "linux" and not _ELSEWHERE & {*sys.argv}:
            from rds.grading.batch.warm_worker import begun

            begun()  # it gets ready on another processor, while all else is imported here
            from rds.cli.grade_run import run_alone

            code = run_alone(sys.argv[1:])
            gc.freeze()  # or Python would go through all that was imported once more before it ends
            if code is not None:
                sys.exit(code)
        if (sys.argv[1:2] == ["run"] or sys.argv[1:3] == ["nc", "run"]) and "--help" not in sys.argv:
            from rds.core.drawing import begin

            begin("rds.results.pictures")  # on another processor, while all else is imported here and the run computes
        from rds.cli.main import main as run

        run()
    except KeyboardInterrupt:
        sys.stderr.write("rds: stopped by Ctrl-C\n")
        sys.stderr.flush()
        os._exit(_INTERRUPTED)  # a second Ctrl-C would interrupt the interpreter's own clean-up


if __name__ == "__main__":
    if not sys.flags.safe_path:
        del sys.path[0]  # the folder that one works in, where a law may be called control.py: as the command `rds`
    main()
