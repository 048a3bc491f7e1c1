"""Where Jupyter gets the kernels of the page from: forks of a process that is ready, or new ones as always."""

from __future__ import annotations

import asyncio
from functools import partial
from pathlib import Path
from typing import Any

from jupyter_client.provisioning import KernelProvisionerFactory, LocalProvisioner

from rds.panels.app.ready_kernels import ReadyKernels

NAME = "rds-ready"  # as kernel.json names it


class ReadyProvisioner(LocalProvisioner):
    """A local kernel."""

    def __init__(self, ready: ReadyKernels, **traits: Any):
        super().__init__(**traits)
        self._ready = ready

    async def launch_kernel(self, cmd: list[str], **kwargs: Any) -> Any:
        """Jupyter's word for starting the process; gives what connects to it."""
        cwd = kwargs.get("cwd") or Path.cwd()
        # beside the loop: the first one waits until everything is imported
        process: Any = await asyncio.to_thread(self._ready.start, cmd, kwargs.get("env", {}), cwd)
        if process is None:
            return await super().launch_kernel(cmd, **kwargs)
        self.process = process
        self.pid = self.pgid = process.pid  # it leads a session of its own
        self.cwd = cwd
        return self.connection_info


class _Entry:
    """What Jupyter takes for an entry point of an installed package."""

    name = NAME

    def __init__(self, ready: ReadyKernels):
        self._ready = ready

    def load(self) -> Any:
        """What makes the provisioner of one kernel."""
        return partial(ReadyProvisioner, self._ready)


def offer(ready: ReadyKernels) -> None:
    """Let this process's kernels of the specification `rds` come from here."""
    KernelProvisionerFactory.provisioners[NAME] = _Entry(ready)  # type: ignore[assignment]
