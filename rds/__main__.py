"""The console command `rds`, and `python -m rds`: light, so that Ctrl-C is heeded while the rest is imported."""

from __future__ import annotations

import os
import sys

_INTERRUPTED = 130  # the exit code of what Ctrl-C ended, by the shell's custom


def main() -> None:
    """Run the command line; Ctrl-C in the middle of an import is no traceback."""
    try:
        from rds.cli.canon import canon_alone

        code = canon_alone(sys.argv[1:])
        if code is not None:
            sys.exit(code)
        from rds.cli.main import main as run

        run()
    except KeyboardInterrupt:
        sys.stderr.write("rds: stopped by Ctrl-C\n")
        sys.stderr.flush()
        os._exit(_INTERRUPTED)  # a second Ctrl-C would interrupt the interpreter's own clean-up


if __name__ == "__main__":
    main()
