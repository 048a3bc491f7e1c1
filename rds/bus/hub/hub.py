"""The hub of the built-in bus as a program: one process per channel that brings every frame to every other node.

It is started by the first node of a channel (see connect.py) and ends by itself some seconds after the last one has
left. By hand, in the foreground, for other limits or to watch its log: `python -m rds.bus.hub.hub CHANNEL`.
"""

from __future__ import annotations

if __name__ == "__main__":  # a program of our own
    from rds.core.garbage import collect_rarely

    collect_rarely()

import argparse
import gc
import os
import signal
import sys
import traceback
from collections.abc import Sequence
from types import FrameType

from rds.bus.hub.address import Address
from rds.bus.hub.hub_loop import LINGER, QUEUE, STALL, Hub
from rds.bus.hub.hub_nodes import log
from rds.core.garbage import leave
from rds.core.private_files import keep_process_private

PRIORITY = 70  # below the target's 80, above the modules' 60


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve a channel. Exit code 0: served (or now serving, detached); 1: the address failed; 3: it has a hub."""
    parser = argparse.ArgumentParser(
        prog="python -m rds.bus.hub.hub", description="hub of one channel of the built-in bus"
    )
    parser.add_argument("channel")
    parser.add_argument("--stall", type=float, default=STALL, help="s until a node that reads nothing is let go")
    parser.add_argument("--linger", type=float, default=LINGER, help="s without a node until the hub ends")
    parser.add_argument("--queue", type=int, default=QUEUE, help="bytes that a node may lag")
    parser.add_argument("--detach", action="store_true", help="serve in the background; return when listening")
    parser.add_argument("--lock", type=int, default=None, help=argparse.SUPPRESS)  # inherited descriptor
    options = parser.parse_args(arguments)
    try:
        address = Address(options.channel)
        lock = options.lock if options.lock is not None else address.lock()
        if lock is None:
            sys.stderr.write(f"channel {options.channel} has a hub already\n")
            return 3
        hub = Hub(address, options.stall, options.linger, options.queue)
    except (OSError, ValueError) as error:
        sys.stderr.write(f"{error}\n")
        return 1
    if options.detach and not _detach(address):
        os._exit(0)  # the starter's wait is over: the hub listens
    address.sign(lock)
    _serve(hub)
    return 0


def _detach(address: Address) -> bool:
    """Go to the background with stderr in the channel's log file; false in the process that shall end."""
    if hasattr(os, "fork") and os.fork() != 0:
        return False
    descriptor = os.open(address.log_path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    os.dup2(descriptor, 1)
    os.dup2(descriptor, 2)
    os.close(descriptor)
    os.chdir("/")
    return True


def _serve(hub: Hub) -> None:
    # not imported above: nobody needs these before the hub listens
    from rds.core.scheduling import lock_memory, raise_priority, set_timer_slack

    signal.signal(signal.SIGTERM, _end)
    signal.signal(signal.SIGINT, _end)
    set_timer_slack()
    log(f"hub {os.getpid()} listens; {raise_priority(PRIORITY)}; memory {'' if lock_memory() else 'not '}locked")
    gc.collect()
    gc.freeze()
    gc.disable()  # what runs per frame makes no cycles
    reason, quiet = "the hub failed; its log tells", False
    try:
        hub.run()
        reason, quiet = "the hub has ended", True
    except SystemExit:
        reason = "the hub was told to end"
    except RuntimeError as error:
        reason = str(error)
    except BaseException:
        log(traceback.format_exc())
    finally:
        log(f"end: {reason}")
        hub.close(reason, remove_log=quiet and not hub.noted)


def _end(number: int, frame: FrameType | None) -> None:
    raise SystemExit


if __name__ == "__main__":
    keep_process_private()
    leave(main())
