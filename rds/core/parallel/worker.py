"""A worker process: `python -m rds.core.parallel.worker`. Folders first, then a function and its items, over stdin.

Whatever the function prints goes to stderr, because stdout is for answers. It ends when stdin does, and on Linux at
once when who started it is killed: an item may take long, and nobody would read what comes of it.
"""

from __future__ import annotations

if __name__ == "__main__":  # a program of our own
    from rds.core.garbage import collect_rarely

    collect_rarely()

import os
import pickle
import sys
from contextlib import suppress
from typing import IO, Any

from rds.core.errors import RdsError
from rds.core.parallel.outcome import reason_of
from rds.core.parallel.pipe import FUNCTION, receive, send
from rds.core.portable import portable
from rds.core.private_files import keep_process_private
from rds.core.scheduling import end_with_parent


def main() -> None:
    """Be a worker, over stdin and stdout."""
    end_with_parent()
    answers = os.fdopen(os.dup(1), "wb")
    serve(sys.stdin.buffer, answers)
    with suppress(BrokenPipeError):  # what nobody reads any more; Python would say so on stderr as it ends
        answers.close()


def serve(questions: IO[bytes], answers: IO[bytes]) -> None:
    """Answer items until there are none."""
    keep_process_private()
    os.dup2(2, 1)
    try:
        sys.path += [folder for folder in pickle.loads(receive(questions)) if folder not in sys.path]
        function: Any = None
        while True:
            message = receive(questions)
            if message[:1] == FUNCTION:
                function = _function(message[1:])
                send(answers, b"ready")
            else:
                send(answers, _answer(function, message[1:]))
    except (EOFError, BrokenPipeError):
        return


def _function(data: bytes) -> Any:
    """The function; if it cannot be had here, one that says so of every item."""
    try:
        return pickle.loads(data)
    except Exception as error:
        reason = reason_of(error)

        def refuse(item: Any) -> None:
            raise RdsError(f"the function cannot be loaded in a worker process: {reason}")

        return refuse


def _answer(function: Any, data: bytes) -> bytes:
    """(False, value), or (True, why there is none), pickled."""
    try:
        return portable((False, function(pickle.loads(data))))
    except Exception as error:
        return pickle.dumps((True, reason_of(error)))


if __name__ == "__main__":
    main()
