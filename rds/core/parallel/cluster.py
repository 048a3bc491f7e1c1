"""Items on the workers of a dask cluster.

All that is dask's lives in one thread with an event loop of its own. A client that starts a loop by itself holds a lock
until that runs; if a client that was refused before is collected in the new loop's thread, it waits there for that
lock, and both give up after ten seconds.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import queue
import threading
import time
import uuid
from collections.abc import AsyncIterator, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import asynccontextmanager
from typing import Any

from rds.core.errors import InputError, MachineError
from rds.core.extras import needed_for
from rds.core.parallel.local import following
from rds.core.parallel.outcome import Failure, Outcome, reason_of
from rds.core.parallel.process import Reply, Work
from rds.core.parallel.scheduler import Scheduler, refused
from rds.core.portable import portable

CONNECT = 5.0  # s that a scheduler may take to answer
PATIENCE = 30.0  # s without any worker before the cluster counts as lost
_ARRIVE = 15.0  # s that the first worker may take, which may be on its way in place of one that died
_LOOK = 1.0  # s between two looks at the workers
_GOODBYE = 5.0  # s that workers may take to hear that the work is over


def on_cluster(work: Work, items: Sequence[Any], scheduler: str | Scheduler) -> Iterator[Outcome]:
    """The outcomes as they come; see `spread`. Connects at once, so that a wrong address is refused at once."""
    scheduler = Scheduler.of(scheduler)
    scheduler.check()
    with needed_for("a scheduler"):
        import distributed  # noqa: F401 - whether it is there
    session = _Session(work, items, scheduler, scheduler.security())
    session.start()
    return _outcomes(session, len(items))


def _outcomes(session: _Session, count: int) -> Iterator[Outcome]:
    try:
        for _ in range(count):
            yield following(session.found)
    finally:
        session.end()


class _Session:
    """The thread with the loop. `found` gets None once it is connected, then outcomes, or an exception at any time."""

    def __init__(self, work: Work, items: Sequence[Any], scheduler: Scheduler, security: Any):
        self._security = security
        self._work, self._items, self._scheduler = work, items, scheduler
        self.found: queue.SimpleQueue[Outcome | BaseException | None] = queue.SimpleQueue()
        self._loop = asyncio.new_event_loop()
        self._is_over = asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="rds cluster", daemon=True)

    def start(self) -> None:
        """Connect; InputError where that fails."""
        self._thread.start()
        try:
            following(self.found)
        except BaseException:
            self.end()
            raise

    def end(self) -> None:
        """End what is still at work, and the thread."""
        with contextlib.suppress(RuntimeError):  # the loop has ended by itself
            self._loop.call_soon_threadsafe(self._is_over.set)
        self._thread.join()

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            try:
                runner.run(self._main())
            except BaseException as error:
                self.found.put(error)

    async def _main(self) -> None:
        async with (
            _client(self._scheduler, self._security) as client,
            _plugin(client, self._work, self._scheduler) as plugin,
        ):
            self.found.put(None)
            parts = (self._all(client, plugin), self._watch(client), self._is_over.wait())
            tasks: list[asyncio.Task[Any]] = [asyncio.create_task(part) for part in parts]
            try:
                done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
                for task in done:
                    task.result()
            finally:
                await _cancel(tasks)

    async def _all(self, client: Any, plugin: str) -> None:
        """Every item; those whose worker ended once more, one by one, so that none is blamed for what lay beside it."""
        tries = [asyncio.create_task(self._one(client, plugin, index)) for index in range(len(self._items))]
        left_over = []
        try:
            for each in asyncio.as_completed(tries):
                index, reply = await each
                if isinstance(reply, Reply):
                    self.found.put(reply.outcome(index))
                else:
                    left_over.append(index)
        finally:
            await _cancel(tries)
        for index in left_over:
            self.found.put((await self._alone(client, plugin, index)).outcome(index))

    async def _alone(self, client: Any, plugin: str, index: int) -> Reply:
        """An item with none of the others beside it."""
        deaths = 0
        while deaths <= self._work.retries:
            _, reply = await self._one(client, plugin, index)
            if isinstance(reply, Reply):
                return reply
            deaths += reply
        reason = f"the cluster's worker that had it ended, each of {deaths} times it was tried alone"
        return Reply(failure=Failure.DIED, reason=reason, attempts=deaths)

    async def _one(self, client: Any, plugin: str, index: int) -> tuple[int, Reply | int]:
        """The item's number, and its reply; or how many of the cluster's workers ended while they had it."""
        from distributed import KilledWorker

        from rds.core.parallel.remote import run_remotely

        future = client.submit(run_remotely, plugin, portable(self._items[index]), pure=False)
        try:
            reply: Reply = await future
        except KilledWorker as error:
            return index, error.allowed_failures + 1
        except (CancelledError, asyncio.CancelledError):
            if not future.cancelled():
                raise  # this coroutine is, not the item
            raise MachineError(
                f"scheduler {self._scheduler!r} is gone, and with it what was at work there; start it again, and go on"
            ) from None
        except Exception as error:  # it did not come as far as its process
            return index, Reply(failure=Failure.RAISED, reason=reason_of(error))
        return index, reply

    async def _watch(self, client: Any) -> None:
        """MachineError once there are no workers any more."""
        seen = time.monotonic()
        while time.monotonic() - seen < PATIENCE:
            await asyncio.sleep(_LOOK)
            with contextlib.suppress(OSError):
                if (await client.scheduler.identity())["workers"]:
                    seen = time.monotonic()
        raise MachineError(f"scheduler {self._scheduler!r} has had no workers for {PATIENCE:g} s; start some")


@asynccontextmanager
async def _client(scheduler: Scheduler, security: Any) -> AsyncIterator[Any]:
    """A connection; InputError if nobody answers, or there are no workers."""
    from distributed import Client

    client: Any = Client(scheduler.address, timeout=CONNECT, set_as_default=False, asynchronous=True, security=security)
    try:
        with _silence():  # what dask would log of a failed connection is said here
            try:
                await asyncio.wait_for(client, 2.0 * CONNECT)  # something else may listen there, and say nothing
                has_workers = await _has_workers(client)
            except Exception as error:  # what else listens there may answer anything, and dask believes it
                if reason := refused(error):
                    raise InputError(f"scheduler {scheduler!r} is refused, or refuses: {reason}") from error
                raise InputError(
                    f"scheduler {scheduler!r}: no dask scheduler answers within {CONNECT:g} s "
                    f"({str(error) or 'silence'}); start one with `dask scheduler`, and give its address, such as "
                    "tls://192.168.0.10:8786"
                ) from error
        if not has_workers:
            raise InputError(
                f"scheduler {scheduler!r} has no workers; start some with `dask worker {scheduler.address}`"
            )
        yield client
    finally:
        with contextlib.suppress(TimeoutError):
            await client.close()


async def _has_workers(client: Any) -> bool:
    until = time.monotonic() + _ARRIVE
    while not (await client.scheduler.identity())["workers"]:
        if time.monotonic() > until:
            return False
        await asyncio.sleep(_LOOK)
    return True


@asynccontextmanager
async def _plugin(client: Any, work: Work, scheduler: Scheduler) -> AsyncIterator[str]:
    """The name of a plugin for this work on all workers; InputError if they cannot have one."""
    from rds.core.parallel.remote import WorkPlugin, places

    name = f"rds-{uuid.uuid4().hex}"
    try:
        try:
            workers = (await client.scheduler.identity())["workers"]
            await client.register_plugin(WorkPlugin(work, places(workers)), name=name)
        except Exception as error:
            raise InputError(
                f"the workers of scheduler {scheduler!r} cannot take the work ({reason_of(error)}); they need the same "
                "version of rds as there is here"
            ) from error
        yield name
    finally:
        with contextlib.suppress(Exception):  # who is gone has no plugin
            await asyncio.wait_for(client.unregister_worker_plugin(name), _GOODBYE)


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    loud = logging.getLogger("distributed")
    before = loud.level
    loud.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        loud.setLevel(before)


async def _cancel(tasks: Sequence[asyncio.Task[Any]]) -> None:
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
