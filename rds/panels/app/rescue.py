"""What a page asks of the server itself, because a student's code may hold its kernel: emergency stop, and its end."""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from typing import Any

from jupyter_core.utils import ensure_async
from jupyter_server.base.handlers import APIHandler
from tornado import web

from rds.panels.app.kernel_stack import ask
from rds.panels.app.page import BUS, FOLDER, MACHINE, WHEREABOUTS

_MOST_CHANNELS = 64
_KERNEL = r"/rds/kernel/([0-9a-f-]{36})"  # as Jupyter names them


def handlers(root: str) -> list[tuple[str, type[APIHandler]]]:
    """The addresses under `root`, the server's own, and what answers there."""
    root = root.rstrip("/")
    return [(f"{root}/rds/emergency-stop", EmergencyStop), (f"{root}{_KERNEL}", Kernel)]


class EmergencyStop(APIHandler):
    """Zero volts for all modules. `{"channels": [...]}` names those of the built-in bus beside the machine's own."""

    @web.authenticated
    async def get(self) -> None:
        """Makes ready for it: imports what it needs, and sets the cookie without which the rest is refused."""
        self.xsrf_token  # noqa: B018
        self.finish({})
        await asyncio.to_thread(import_module, "rds.bus.tools.estop")

    @web.authenticated
    async def post(self) -> None:
        """Answers {"text", "kind"}: a sentence that says who acknowledged, and how to show it."""
        text, kind = await asyncio.to_thread(emergency_stop, self._channels())
        self.finish({"text": text, "kind": kind})

    def _channels(self) -> set[str]:
        """Those that were named well; nothing that was named badly keeps the others from being stopped."""
        try:
            named = json.loads(self.request.body)["channels"]
        except (ValueError, KeyError, TypeError, RecursionError):
            return set()
        channels = named[:_MOST_CHANNELS] if isinstance(named, list) else []
        return {each for each in channels if isinstance(each, str)}


class Kernel(APIHandler):
    """The kernel of a page."""

    @web.authenticated
    async def get(self, kernel: str) -> None:
        """Answers {"text"}: what keeps it, in a sentence."""
        self.finish({"text": _held(await self._where(kernel))})

    @web.authenticated
    async def delete(self, kernel: str) -> None:
        """Ends it at once. Answers {"text"}: the sentence for the page that comes after it."""
        where = await self._where(kernel)
        if kernel in self.kernel_manager:
            await ensure_async(self.kernel_manager.shutdown_kernel(kernel, now=True))
        self.finish({"text": _ended(where)})

    async def _where(self, kernel: str) -> str | None:
        if kernel not in self.kernel_manager:
            return None
        process: Any = getattr(self.kernel_manager.get_kernel(kernel).provisioner, "process", None)
        return None if process is None else await asyncio.to_thread(ask, process, Path(os.environ[WHEREABOUTS]))


def emergency_stop(channels: Iterable[str]) -> tuple[str, str]:
    """What the page's kernel would do: the sentence, and whether it is a warning or an error."""
    from rds.panels.page.emergency import emergency_stop as stop
    from rds.panels.session import Session

    session = Session(os.environ[FOLDER], os.environ[MACHINE], json.loads(os.environ.get(BUS, "{}")))
    session.channels.update(channels)
    return stop(session)


def _held(where: str | None) -> str:
    stay = "files, fields and earlier runs stay as they are"
    if where is None:
        return f"What this page worked with has ended. Begin again: {stay}."
    at = f"{where} has not returned" if where else "what it is at takes long"
    return f"This page gets no answer: {at}. Wait for it, or begin again: {stay}."


def _ended(where: str | None) -> str:
    at = (
        f"{where} did not return, and was ended with all else in this page" if where else "all that was in it has ended"
    )
    return f"This page was begun again: {at}. Files, fields and earlier runs are as they were."
