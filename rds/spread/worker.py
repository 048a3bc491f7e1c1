"""A worker process: `python -m rds.spread.worker`. Folders and the function first, then items, over stdin.

Whatever the function prints goes to stderr, because stdout is for answers. It ends when stdin does.
"""

from __future__ import annotations

import os
import pickle
import sys
from typing import Any

from rds.core.portable import portable
from rds.spread.pipe import receive, send


def main() -> None:
    """Answer items until there are none."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    questions = sys.stdin.buffer
    try:
        sys.path += [folder for folder in pickle.loads(receive(questions)) if folder not in sys.path]
        function = pickle.loads(receive(questions))
        while True:
            send(answers, _answer(function, receive(questions)))
    except (EOFError, BrokenPipeError):
        return


def _answer(function: Any, data: bytes) -> bytes:
    """(False, value), or (True, why there is none), pickled."""
    try:
        return portable((False, function(pickle.loads(data))))
    except Exception as error:
        return pickle.dumps((True, reason_of(error)))


def reason_of(error: BaseException) -> str:
    """An exception as a sentence: our own as they are, others with their kind."""
    from rds.core.errors import RdsError

    return str(error) if isinstance(error, RdsError) else f"{type(error).__name__}: {error}"


if __name__ == "__main__":
    main()
