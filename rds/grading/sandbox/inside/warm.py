"""The warm interpreter: it has imported what takes long, and forks one submission's processes at each request.

    warm interpreter ──fork── walls.enter ──fork── init (number 1 in its namespace) ──fork── the submission

It never runs a submission's code, and takes nothing from a submission but the end of its processes. Requests come over
a socket: JSON, with the descriptors of one submission's pipes beside it.
"""

from __future__ import annotations

import array
import fcntl
import gc
import json
import os
import signal
import site
import socket
import sys
import traceback
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from rds.grading.sandbox.inside import kernel, walls

LARGEST = 1 << 16  # bytes of one request
_ABOVE = 20  # the descriptors that a submission's process keeps; all between these and stderr are closed


class ChannelEnds(NamedTuple):
    """The inner ends of one submission's channels: descriptors."""

    questions: int
    answers: int
    output: int
    memory: int  # shared with the grader, and its bells
    question_bell: int
    answer_bell: int
    status: int  # of init alone


def main(descriptor: int, preload: list[str]) -> None:
    """Import `preload`, say so, then serve requests from the socket `descriptor` until its other end is closed."""
    control = socket.socket(fileno=descriptor)
    _, fds, *_ = socket.recv_fds(control, 1, 1)
    with os.fdopen(fds[0], "rb") as file:
        calls = file.read()
    from rds.grading.sandbox.inside import worker

    for add in (site.setquit, site.setcopyright, site.sethelper):  # exit, help and the like: -S leaves them out
        add()
    for name in preload:
        import_module(name)
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # children are reaped without being waited for
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the grader to handle
    gc.collect()
    gc.freeze()  # a collection in a fork would copy every page
    baseline, resident = (int(pages) * os.sysconf("SC_PAGE_SIZE") for pages in _pages()[:2])
    control.send(json.dumps({"resident_bytes": resident}).encode())
    while True:
        data, received = _receive(control)
        if not data:
            return
        request = json.loads(data)
        if os.fork() == 0:
            control.close()
            _between(request, ChannelEnds(*received), baseline, calls, worker)
        for fd in received:
            os.close(fd)


def _pages() -> list[str]:
    return Path("/proc/self/statm").read_text().split()


def _receive(control: socket.socket) -> tuple[bytes, list[int]]:
    fds = array.array("i")
    data, ancillary, _, _ = control.recvmsg(LARGEST, socket.CMSG_SPACE(len(ChannelEnds._fields) * fds.itemsize))
    for level, kind, payload in ancillary:
        if (level, kind) == (socket.SOL_SOCKET, socket.SCM_RIGHTS):
            fds.frombytes(payload)
    return data, list(fds)


def _between(request: dict[str, Any], ends: ChannelEnds, baseline: int, calls: bytes, worker: Any) -> NoReturn:
    """The process between the warm interpreter and init: it makes the namespaces and is gone."""
    try:
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        walls.go_first()
        walls.enter(int(request["limits"]["file_bytes"]))
        if os.fork() == 0:
            _init(request, ends, baseline, calls, worker)
    except BaseException as error:  # whatever it is, the grader must hear of it: nothing was confined
        os.write(ends.status, f"broken: {type(error).__name__}: {error}".encode()[:500])
    os._exit(0)


def _init(request: dict[str, Any], ends: ChannelEnds, baseline: int, calls: bytes, worker: Any) -> NoReturn:
    """Number 1: the kernel tells the grader its number; when it ends, the kernel ends all that is left below it."""
    status = socket.socket(fileno=ends.status)
    try:
        os.setsid()
        for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGPIPE):
            signal.signal(number, signal.SIG_IGN)
        kernel.hide_memory()
        status.send(b"started")
        child = os.fork()
        if child == 0:
            _submission(request, ends, status, baseline, calls, worker)
        for fd in (*ends[:-1], 0, 1, 2):
            os.close(fd)
        kernel.drop_capabilities()
        while True:
            pid, how = os.wait()  # of orphans too
            if pid == child:
                break
        status.send(f"ended {os.waitstatus_to_exitcode(how)}".encode())
    except BaseException as error:
        status.send(f"broken: {type(error).__name__}: {error}".encode()[:500])
    os._exit(0)


def _submission(
    request: dict[str, Any], ends: ChannelEnds, status: socket.socket, baseline: int, calls: bytes, worker: Any
) -> NoReturn:
    """The process that runs the submission, behind all walls."""
    try:
        os.setsid()
        for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGPIPE, signal.SIGINT):
            signal.signal(number, signal.SIG_DFL)
        os.dup2(ends.output, 1)
        os.dup2(ends.output, 2)
        os.dup2(os.open("/dev/null", os.O_RDONLY), 0)
        kept = (ends.questions, ends.answers, ends.memory, ends.question_bell, ends.answer_bell)
        questions, answers, *shared = (fcntl.fcntl(fd, fcntl.F_DUPFD, _ABOVE) for fd in kept)
        walls.confine(request["limits"], baseline, calls, request["cpus"])
    except BaseException as error:
        status.send(f"broken: {type(error).__name__}: {error}".encode()[:500])
        os._exit(0)
    status.close()
    os.closerange(3, _ABOVE)
    code = 1
    try:
        code = worker.main(questions, answers, shared)
        sys.stdout.flush()
    except BaseException:  # whatever it is: a submission never gets back into the code that put up its walls
        traceback.print_exc()
    finally:
        os._exit(code)
