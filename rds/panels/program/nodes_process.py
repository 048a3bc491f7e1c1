"""A part program on the nodes of a machine, in a process of its own: `python -m rds.panels.program.nodes_process`.

What is to be done (`NodesRequest`) comes pickled on stdin; on stdout go pickled words: (BEGINS, what, share, s or None)
now and then, (NOTE, what is not carried out), and (DONE, how it was) or (FAILED, why) at the end. When stdin ends,
somebody wants it to stop, or whoever gave the order has died: the nodes are told to stop, and nothing more is said.
"""

from __future__ import annotations

if __name__ == "__main__":  # a program of our own
    from rds.bus.tools.mf4 import put_off_asammdf

    put_off_asammdf()

import os
import pickle
import signal
import sys
import threading
from functools import partial
from typing import Any

from rds.core.errors import RdsError
from rds.core.parallel.outcome import reason_of
from rds.core.parallel.pipe import receive, send
from rds.core.portable import portable
from rds.core.private_files import keep_process_private
from rds.panels.program.nodes_run import carry_out

BEGINS, NOTE, DONE, FAILED = "begins", "note", "done", "failed"


def _interrupt_at_the_end(stdin: Any) -> None:
    """As Ctrl-C would, wherever the main thread is, once nobody wants it any more."""
    stdin.read()
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
    else:
        signal.raise_signal(signal.SIGINT)


def main() -> None:
    """Carry out one order."""
    keep_process_private()
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # there are interfaces of python-can that print
    signal.signal(signal.SIGINT, signal.default_int_handler)

    def say(*words: Any) -> None:
        send(answers, portable(words))

    try:
        order = pickle.loads(receive(sys.stdin.buffer))
        threading.Thread(target=_interrupt_at_the_end, args=(sys.stdin.buffer,), daemon=True).start()
        try:
            made = carry_out(order, partial(say, BEGINS), partial(say, NOTE))
        except RdsError as error:
            say(FAILED, str(error))
        except Exception as error:
            say(FAILED, reason_of(error))
        else:
            say(DONE, made)
    except (KeyboardInterrupt, EOFError, BrokenPipeError):
        pass
    os._exit(0)  # the thread waits for stdin, whose lock the interpreter would wait for


if __name__ == "__main__":
    main()
