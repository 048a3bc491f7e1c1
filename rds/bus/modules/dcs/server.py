"""The units of a machine on a serial line, in a process of their own.

`python -m rds.bus.modules.dcs.server MACHINE [--channel C] [--option baud=38400]` makes a pseudo-terminal, links it in
the user's runtime folder by the channel's name, and carries bytes on it at the baud rate; a channel that is a real port
(/dev/ttyUSB0) has units at its end. It writes one line, "ready ...", on stdout, and reports on stderr. Lines on stdin
are hands at the line: "cut", "whole", "noise 0.01", "unit 2 reset", "unit 2 off". Its end is that of server_program.py.
"""

from __future__ import annotations

import logging
import os
import queue
import select
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from rds.bus.hub.address import lock_file
from rds.bus.hub.bus_settings import NOISE, SERIAL
from rds.bus.modules import server_program
from rds.bus.modules.dcs.build import make_line
from rds.bus.modules.dcs.line import FieldLine
from rds.bus.modules.dcs.port import LOCK, SerialPort, is_device, link_of
from rds.bus.modules.serve_loop import AFTERLIFE, as_process
from rds.bus.tools.link import BUILTIN
from rds.core.errors import InputError, MachineError
from rds.core.garbage import leave
from rds.core.interrupt import SignalEvent
from rds.core.private_files import keep_process_private, write_private
from rds.machines import Machine

LOG = logging.getLogger(__name__)
_LONGEST_SLEEP = 0.05  # s, so that a stop or a line on stdin is noticed
_LOOK = 0.02  # s between two looks at stdin and the starter


class LineEnd(Protocol):
    """The units' end of the line."""

    def read(self, timeout: float) -> bytes:
        """What the host sent, waiting at most so many s."""

    def write(self, data: bytes) -> None:
        """To the host."""


class PtyEnd:
    """The master of a pseudo-terminal, whose slave a link names. A host at another baud rate is not understood."""

    def __init__(self, channel: str, baud: float):
        if os.name != "posix":
            raise MachineError("pseudo-terminals need Linux or macOS; serve on a real port (channel COM3)")
        import termios
        import tty

        self._termios, self._baud = termios, baud
        self._link = link_of(channel)
        self._lock = os.open(self._link.with_suffix(LOCK), os.O_RDWR | os.O_CREAT, 0o600)
        try:
            lock_file(self._lock)
        except OSError:
            os.close(self._lock)
            raise MachineError(
                f"serial line {channel} is served already; end that process, or choose a channel"
            ) from None
        self._master, self._slave = os.openpty()  # the slave stays open, or a host that leaves would end the line
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self._link.unlink(missing_ok=True)
        self._link.symlink_to(os.ttyname(self._slave))

    def read(self, timeout: float) -> bytes:
        """As End."""
        if not select.select([self._master], [], [], max(0.0, timeout))[0]:
            return b""
        data = os.read(self._master, 8192)
        return data if self._is_tuned() else bytes(byte ^ 0xFF for byte in data)  # as good as noise

    def _is_tuned(self) -> bool:
        speed = getattr(self._termios, f"B{self._baud:g}", None)
        return speed is None or self._termios.tcgetattr(self._master)[4] == speed

    def write(self, data: bytes) -> None:
        """As End; what a host does not read is lost, as on wires."""
        with suppress(BlockingIOError):
            os.write(self._master, data)

    def close(self) -> None:
        """Take the line away."""
        self._link.unlink(missing_ok=True)
        for descriptor in (self._master, self._slave, self._lock):
            os.close(descriptor)


class Gauges:
    """Dial gauges at all carriages: what they show each millisecond, as long as it changes."""

    def __init__(self, line: FieldLine):
        self.rows: list[tuple[float, ...]] = []
        self._names = [unit.name for unit in line.units]
        line.watch, line.next_look = self._look, time.monotonic()

    def _look(self, at: float, positions: list[float]) -> None:
        row = (at, *positions)
        if not self.rows or row[1:] != self.rows[-1][1:]:
            self.rows.append(row)

    def save(self, path: str) -> None:
        """Write the rows: time (s, of the monotonic clock), and a column for each axis."""
        head = ",".join(["time", *self._names])
        text = "\n".join([head, *(",".join(f"{value:.6f}" for value in row) for row in self.rows)])
        write_private(Path(path), (text + "\n").encode())


def serve(
    machine: Machine,
    interface: str = SERIAL,
    channel: str | None = None,
    axes: Sequence[str] | None = None,
    ready: Callable[[], Any] | None = None,
    stop: threading.Event | None = None,
    orphaned: threading.Event | None = None,
    afterlife: float = AFTERLIFE,
    faults: Sequence[Any] = (),
    lines: queue.SimpleQueue[str] | None = None,
    trace: str | None = None,
    **options: Any,
) -> None:
    """Serve the units of `machine` until `stop` is set; `options` as of `build.make_line`.

    At the end the file `trace` (CSV) gets where the carriages really were, each millisecond in which one moved.

    `lines` are hands at the line, see above. Once `orphaned` is set, it also ends when nobody has commanded for
    `afterlife` s. InputError for options, axes or faults that can't be; MachineError if the line cannot be had.
    """
    if interface not in (SERIAL, BUILTIN):
        raise InputError(f'dialect dcs is spoken on serial lines, not on {interface}: leave interface out, or "serial"')
    if faults:
        raise InputError("scheduled faults are the built-in CAN bus's; a serial line takes noise and lines on stdin")
    channel = machine.channel if channel is None else channel
    stop = stop or SignalEvent()
    line = make_line(machine, time.monotonic(), **options)
    if axes is not None:
        kept = {machine.axis(name).node for name in axes}
        line.units = [unit for unit in line.units if unit.number in kept]
    gauges = Gauges(line) if trace is not None else None
    with _end_of(channel, line) as end, as_process(stop):
        if ready is not None:
            ready()
        try:
            _serve(line, end, stop, orphaned, afterlife, lines)
        finally:
            if gauges is not None and trace is not None:
                gauges.save(trace)


@contextmanager
def _end_of(channel: str, line: FieldLine) -> Iterator[LineEnd]:
    if is_device(channel):
        port = SerialPort(channel, line.baud)
        line.down.byte = line.up.byte = 0.0  # the real line takes its own time
        try:
            yield port
        finally:
            port.close()
        return
    end = PtyEnd(channel, line.baud)
    try:
        yield end
    finally:
        end.close()


def _serve(
    line: FieldLine,
    end: LineEnd,
    stop: threading.Event,
    orphaned: threading.Event | None,
    afterlife: float,
    lines: queue.SimpleQueue[str] | None,
) -> None:
    clock = time.monotonic
    look, heard, since = 0.0, -1, clock()
    while True:
        data = end.read(min(line.due - clock(), _LONGEST_SLEEP))
        now = clock()
        if data:
            line.write(data, now)
        answered = line.advance(now)
        if answered:
            end.write(answered)
        if now < look:
            continue
        look = now + _LOOK
        if stop.is_set():
            return
        if lines is not None:
            _do_lines(lines, line, now)
        if orphaned is not None and orphaned.is_set():
            count = sum(unit.heard for unit in line.units)
            if count != heard:
                heard, since = count, now
            elif now - since > afterlife:
                LOG.warning("the starter has gone and nobody commands: end")
                return


def _do_lines(lines: queue.SimpleQueue[str], line: FieldLine, at: float) -> None:
    for _ in range(lines.qsize()):  # and no more: a flood of lines must not stop the units
        try:
            handle(lines.get(), line, at)
        except InputError as error:
            LOG.error("%s", error)


def handle(text: str, line: FieldLine, at: float) -> None:
    """Do to the line what a hand says. InputError if it says nothing that can be done."""
    words = text.split()
    if words in (["cut"], ["whole"]):
        line.cut = words == ["cut"]
    elif len(words) == 2 and words[0] == "noise":
        try:
            line.noise = NOISE.check(float(words[1]), "noise")
        except ValueError:
            raise InputError(f"noise {words[1]!r} must be a number from 0 to 1") from None
    elif len(words) == 3 and words[0] == "unit" and words[2] in ("reset", "off") and words[1].isdecimal():
        unit = line.unit(int(words[1]))
        if unit is None:
            numbers = ", ".join(str(each.number) for each in line.units)
            raise InputError(f"there is no unit {words[1]} on the line; there are {numbers}")
        if words[2] == "reset":
            unit.power_cycle(at)
        else:
            line.remove(unit.number, at)
    else:
        raise InputError(
            f"{text.strip()!r} is nothing that can be done to a line; say cut, whole, noise 0.01, unit 2 reset or "
            "unit 2 off"
        )
    LOG.warning("by hand: %s", text.strip())


def main(arguments: Sequence[str] | None = None) -> int:
    """The program. Exit code 0: told to end; 1: the line failed at the start; 2: bad input."""
    lines = queue.SimpleQueue[str]()
    with_hands = partial(serve, lines=lines)
    return server_program.run(
        with_hands, "rds.bus.modules.dcs.server", "serve units on a serial line", arguments, lines, SERIAL
    )


if __name__ == "__main__":
    keep_process_private()
    leave(main())
