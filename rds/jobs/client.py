"""A client of the server of jobs, for the command line and for Python."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from rds.core.errors import InputError, MachineError
from rds.jobs.address import Address
from rds.jobs.job import OVER
from rds.jobs.requests import parse


class Client:
    """A connection that has said the secret, for `with`.

    InputError where the secret's file cannot be read, OSError where no server answers, MachineError where it refuses.
    """

    def __init__(self, address: Address):
        self._sock = address.connect(None)
        self._lines = self._sock.makefile("rwb")
        if address.secret_file.exists():
            try:
                word = address.secret_file.read_text().strip()
            except OSError as error:
                raise InputError(f"cannot be read ({error.strerror})", str(address.secret_file)) from error
            answered = self._exchange(json.dumps({"secret": word}))[1]
            if not answered["ok"]:
                raise MachineError(str(answered["error"]))

    def ask(self, request: str) -> Iterator[tuple[str, dict[str, Any]]]:
        """The answers to a request in JSON, as text and as objects: one, but for `watch` until the job is over."""
        asked = parse(request.encode())
        line, answered = self._exchange(json.dumps(asked))
        yield line, answered
        while asked.get("do") == "watch" and answered["ok"] and answered.get("state") != OVER:
            line, answered = self._read()
            yield line, answered

    def _exchange(self, text: str) -> tuple[str, dict[str, Any]]:
        self._lines.write(text.encode() + b"\n")
        self._lines.flush()
        return self._read()

    def _read(self) -> tuple[str, dict[str, Any]]:
        line = self._lines.readline()
        if not line:
            raise MachineError("the server of jobs has ended the connection")
        return line.decode().rstrip("\n"), json.loads(line)

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self._lines.close()
        self._sock.close()
