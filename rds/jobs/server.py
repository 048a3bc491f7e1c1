"""Serves jobs to other programs of this user: a JSON object in a line asks, a JSON object in a line answers.

A client says the secret first. Before that nothing is answered but a refusal, and a line that is no greeting (a web
page's, say) ends the connection. A client that leaves, or does not read, ends nothing but itself: a run goes on.
"""

from __future__ import annotations

import asyncio
import hmac
import json
import os
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar

from rds.core.errors import InputError
from rds.core.installed import version
from rds.core.interrupt import ending_signals
from rds.jobs.address import Address
from rds.jobs.job import OVER
from rds.jobs.jobs import Jobs, sentence
from rds.jobs.requests import answer, parse, words_of

T = TypeVar("T")
LONGEST_LINE = 65_536  # bytes
CLIENTS = 16  # that have said the secret, and as many that have not
WATCHES = 8  # of one client at a time
GREETING = 5.0  # s to say the secret
READING = 5.0  # s in which a client has to read what it asked for


class Server:
    """The clients and what they ask of `jobs`. `secret` None: whoever can connect is served."""

    def __init__(self, jobs: Jobs, address: Address, secret: str | None):
        self._jobs, self._address, self._secret = jobs, address, secret
        self._clients: set[asyncio.StreamWriter] = set()
        self._strangers: dict[asyncio.StreamWriter, None] = {}  # in order

    async def serve(self, listener: Any, ready: Callable[[], None]) -> None:
        """Until SIGINT, SIGTERM or the end of its terminal (SIGHUP, but under nohup); then what runs is stopped."""
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()
        for number in ending_signals():
            with suppress(NotImplementedError):  # Windows: Ctrl-C ends asyncio.run
                loop.add_signal_handler(number, stop.set)
        start = asyncio.start_server if self._address.path is None else asyncio.start_unix_server
        async with await start(self._meet, sock=listener, limit=LONGEST_LINE) as server:
            ready()
            await stop.wait()
            server.close()
            await _beside(self._jobs.close)
            for writer in [*self._clients, *self._strangers]:
                writer.close()

    async def _meet(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(self._strangers) >= CLIENTS:
            next(iter(self._strangers)).close()
        self._strangers[writer] = None
        watches: set[asyncio.Task[None]] = set()
        try:
            if self._secret is None or await self._greeted(reader, writer):
                self._strangers.pop(writer, None)
                if len(self._clients) >= CLIENTS:
                    await _say(writer, _refusal(None, f"{CLIENTS} programs are connected; end one of them"))
                    return
                self._clients.add(writer)
                await self._converse(reader, writer, watches)
        except (OSError, TimeoutError, asyncio.IncompleteReadError, asyncio.CancelledError):
            pass  # it has left, or does not read; or the server ends
        finally:
            self._strangers.pop(writer, None)
            self._clients.discard(writer)
            for task in watches:
                task.cancel()
            writer.close()

    async def _greeted(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> bool:
        """Whether the first line says the secret."""
        assert self._secret is not None
        request: dict[str, Any] = {}
        try:
            async with asyncio.timeout(GREETING):
                line = await _line(reader)
            request = parse(line) if line is not None else {}
            said = request.get("secret")
            is_greeting = isinstance(said, str) and request.keys() <= {"secret", "id"}
            if is_greeting and hmac.compare_digest(str(said).encode(errors="replace"), self._secret.encode()):
                await _say(writer, {"id": request.get("id"), "ok": True, "rds": version()})
                return True
        except InputError:
            pass
        remedy = f'begin with {{"secret": "…"}}, which is in {self._address.secret_file}'
        await _say(writer, _refusal(request.get("id"), remedy))
        return False

    async def _converse(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, watches: set[asyncio.Task[None]]
    ) -> None:
        while True:
            try:
                line = await _line(reader)
            except InputError as error:
                await _say(writer, _refusal(None, str(error)))
                return
            if line is None:
                return
            told, watched = await self._reply(line, len(watches))
            if watched is None:
                await _say(writer, told)
                continue
            task = asyncio.create_task(_watch(writer, told["id"], *watched))
            watches.add(task)
            task.add_done_callback(watches.discard)

    async def _reply(self, line: bytes, watches: int) -> tuple[dict[str, Any], tuple[Any, float] | None]:
        """The answer to a line, or else job and period (s) of what is to be watched."""
        mark = None
        try:
            request = parse(line)
            mark = request.get("id")
            if self._secret is None and request.keys() - {"id"} == {"secret"}:
                return {"id": mark, "ok": True, "rds": version()}, None  # the same client for both kinds of servers
            verb, values = words_of(request)
            if verb != "watch":
                answered = await _beside(lambda: answer(self._jobs, verb, values))
                return {"id": mark, "ok": True, **answered}, None
            if watches >= WATCHES:
                raise InputError(f"{WATCHES} watches are at work on this connection; open another one")
            return {"id": mark}, (self._jobs.job(values["job"]), values["period"])
        except Exception as error:
            return _refusal(mark, sentence(error)), None


async def _watch(writer: asyncio.StreamWriter, mark: Any, job: Any, period: float) -> None:
    """Status lines until the job is over, that of its end the last."""
    with suppress(OSError, TimeoutError):
        while True:
            told = await _beside(job.status)
            await _say(writer, {"id": mark, "ok": True, "event": "status", **told})
            if told["state"] == OVER:
                return
            await asyncio.sleep(period)


async def _beside(work: Callable[[], T]) -> T:
    """`work()` in a thread of its own, so that nobody waits for a file of somebody else that does not end.

    The server's end does not wait for such threads either, as it would for those of asyncio.
    """
    loop, found = asyncio.get_running_loop(), asyncio.Future[T]()

    def told(value: T | None, error: BaseException | None) -> None:
        if found.done():
            return  # who asked has left
        if error is None:
            found.set_result(value)  # type: ignore[arg-type]
        else:
            found.set_exception(error)

    def go() -> None:
        value, error = None, None
        try:
            value = work()
        except Exception as raised:
            error = raised
        except BaseException as raised:  # a file's own KeyboardInterrupt, which would end the server
            error = InputError(sentence(raised))
        with suppress(RuntimeError):  # the server has ended
            loop.call_soon_threadsafe(told, value, error)

    threading.Thread(target=go, name="request", daemon=True).start()
    return await found


async def _line(reader: asyncio.StreamReader) -> bytes | None:
    """The next line; None at the end. InputError for one that is too long, whose rest is not read."""
    try:
        line = await reader.readline()
    except ValueError as error:
        raise InputError(f"the line is longer than {LONGEST_LINE} bytes; the connection ends") from error
    return line if line.endswith(b"\n") else None


async def _say(writer: asyncio.StreamWriter, what: dict[str, Any]) -> None:
    """One line; TimeoutError, and the connection's end, where the client does not read."""
    writer.write(json.dumps({k: v for k, v in what.items() if k != "id" or v is not None}).encode() + b"\n")
    try:
        async with asyncio.timeout(READING):
            await writer.drain()
    except TimeoutError:
        writer.transport.abort()
        raise


def _refusal(mark: Any, message: str) -> dict[str, Any]:
    return {"id": mark, "ok": False, "error": message}


def serve(jobs: Jobs, address: Address, with_secret: bool, ready: Callable[[], None]) -> None:
    """Listen at `address` until SIGINT or SIGTERM. InputError for TCP without a secret; OSError where none can listen.

    Without a secret, whoever can connect is served: on a Unix socket that is the user alone.
    """
    if not with_secret and address.path is None:
        raise InputError("a port of the loopback address is open to every user of this computer: it needs the secret")
    listener = address.listen()
    try:
        secret = address.new_secret() if with_secret else None
        _keep_this_process()
        asyncio.run(Server(jobs, address, secret).serve(listener, ready))
    finally:
        listener.close()
        address.leave()


def _keep_this_process() -> None:
    """Let code of a job that would end this process end its job only; a job is loaded and simulated in a thread here.

    A crash of compiled code still ends the server, but no run against the clock, which has processes of its own.
    """
    server = os.getpid()

    def instead_of(name: str) -> Callable[..., Any]:
        ours = getattr(os, name)

        def call(*given: Any, **named: Any) -> Any:
            if os.getpid() != server or (name == "kill" and (given[:1] != (server,) or given[1:] == (0,))):
                return ours(*given, **named)
            raise SystemExit(f"os.{name}() would have ended the server of jobs; remove it")

        return call

    for name in ("_exit", "abort", "kill"):
        setattr(os, name, instead_of(name))
