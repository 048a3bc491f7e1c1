"""A kernel of the page: IPython's, but it listens on no TCP port, which other users of the computer could connect to.

Where the server speaks with it by Unix sockets (`kernels.PageKernel`), so do the processes that its code forks, whose
output ipykernel takes over a TCP port of the kernel's own.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import zmq
from ipykernel import kernelapp
from ipykernel.iostream import IOPubThread
from zmq.eventloop.zmqstream import ZMQStream

_LINGER = 3000  # ms that the end of a forked process waits for its output to be taken


class _Output(IOPubThread):
    """Takes the output of forked processes at `address`."""

    def __init__(self, address: str, *args: Any, **options: Any):
        self._address = address
        super().__init__(*args, **options)

    def _setup_pipe_in(self) -> None:
        self._pipe_uuid = os.urandom(16)
        pipe = self.socket.context.socket(zmq.PULL)
        pipe.linger = 0
        pipe.bind(self._address)
        self._pipe_in = ZMQStream(pipe, self.io_loop)
        self._pipe_in.on_recv(self._handle_pipe_msg)

    def _setup_pipe_out(self) -> tuple[Any, Any]:
        context = zmq.Context()  # the one from before the fork is the other process's
        pipe = context.socket(zmq.PUSH)
        pipe.linger = _LINGER
        pipe.connect(self._address)
        return context, pipe


class PageKernelApp(kernelapp.IPKernelApp):
    """The kernel's process."""

    name = "ipython-kernel"  # the user's settings for it

    def init_iopub(self, context: Any) -> None:
        """As ever, but for where forked processes connect to."""
        if self.transport == "ipc":
            # 1 to 5 are Jupyter's
            kernelapp.IOPubThread = partial(_Output, f"ipc://{self.ip}-6")  # type: ignore[misc, assignment]
        context.setsockopt(zmq.SNDHWM, 0)  # by default more than 1000 messages that wait are thrown away
        super().init_iopub(context)


def launch(arguments: Sequence[str]) -> None:
    """Be a kernel until it is told to end."""
    PageKernelApp.launch_instance(argv=list(arguments))


if __name__ == "__main__":
    if Path(sys.path[0] or ".").resolve() == Path.cwd():
        del sys.path[0]  # as ipykernel_launcher does: the folder's files are no libraries of the kernel's
    launch(sys.argv[1:])
