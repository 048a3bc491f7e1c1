"""The host's side of the addressed protocol: select, fill, carry out, jog, home, stop, reset, inquire.

The functions are those of dcs-thesis, section 6.3 and appendix D (SendData, Execute, Jog, JogStop), with what they
lack: each answer is waited for within a time, asked for again where it was lost, and a unit that does not answer, or
that has been reset meanwhile, ends the motion of all.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from math import ceil

from rds.bus.modules.dcs import commands, frames
from rds.bus.modules.dcs.commands import BUFFER, HOST, REPORT_SIZE, SELECT, Report
from rds.bus.modules.dcs.port import Port
from rds.core.errors import MachineError

TRIES = 4  # for an answer
_MARGIN = 0.02  # s beyond the wire's time until an answer counts as lost: computers stall for so long
_SILENCE = 0.06  # s before another try, so that units that skip data hear it (unit.SKIP)
_HOMING = 60.0  # s until a unit has found its switch
_STEPS_LOST = 5  # answers in a row, of the master of the steps, that may be lost


class NoAnswer(MachineError):
    """A unit is not there, or the line is broken."""


@dataclass
class Counters:
    """What went wrong and was put right."""

    retries: int = 0  # answers that were asked for again
    lost: int = 0  # answers to steps that never came
    damaged: int = 0  # buffers that were filled again


class Host:
    """Commands over a port; `titles` names the units in messages ("X (unit 2)")."""

    def __init__(self, port: Port, baud: float, titles: dict[int, str], name: str = "serial", tries: int = TRIES):
        self._tries = tries
        self.port, self._byte, self._titles, self._name = port, frames.byte_time(baud), titles, name
        self.counters = Counters()
        self._kept = bytearray()

    # --- asking

    def _ask(self, unit: int, request: bytes, size: int, what: str) -> bytes:
        """Send; return an answer of `size` bytes that begins with the unit's identifier. MachineError if none comes."""
        for attempt in range(self._tries):
            if attempt:
                self.counters.retries += 1
                self.port.sleep(self.port.now() + _SILENCE)
            self._clear()
            self.port.write(request)
            time = (len(request) + size) * self._byte + commands.TURN_ROUND + _MARGIN
            answer = self._answer(unit, size, self.port.now() + time)
            if answer is not None:
                return answer
        raise NoAnswer(f"no answer from {self.title(unit)} on line {self._name} to {what}; {self.help}")

    def _answer(self, unit: int, size: int, deadline: float) -> bytes | None:
        uid = commands.uid(unit)
        while True:
            while self._kept and self._kept[0] != uid:
                del self._kept[0]
            while len(self._kept) >= size:
                found = bytes(self._kept[:size])
                if size == 1 or commands.decode_report(found) is not None:
                    del self._kept[:size]
                    return found
                del self._kept[0]
            left = deadline - self.port.now()
            more = self.port.read(left) if left > 0.0 else b""
            if not more and self.port.now() >= deadline:
                return None
            self._kept += more

    def _clear(self) -> None:
        self._kept.clear()
        while self.port.read(0.0):
            pass

    @property
    def help(self) -> str:
        """What to look at where the line or a unit does not work."""
        return "check power, cable, baud rate and the unit's switches"

    # --- verbs

    def inquire(self, unit: int) -> Report:
        """Where a unit is, and what it does."""
        request = bytes([commands.INQUIRY, commands.uid(unit)])
        report = commands.decode_report(self._ask(unit, request, REPORT_SIZE, "an inquiry"))
        assert report is not None
        return report

    def data(self, unit: int, command: int, index: int, piece: bytes) -> Report:
        """A piece of a unit's cyclic buffer, or of its segments, whose first byte has this number; what it reports."""
        request = commands.encode_data(command, unit, index, piece)
        report = commands.decode_report(self._ask(unit, request, REPORT_SIZE, "its data"))
        assert report is not None
        return report

    def go(self) -> float:
        """All units carry out what they hold, by their own clocks; the instant at which they begin."""
        self.port.write(bytes([commands.GO, HOST]))
        return self.port.now() + 2 * self._byte

    def clock(self, begun: float) -> None:
        """Tell the units' clocks which step begins now, for a motion that has `begun` at that instant."""
        ahead = (self.port.now() + 2 * self._byte - begun) / commands.BYTE_TIME
        step = ceil(ahead + 0.1)
        self.port.sleep(begun + step * commands.BYTE_TIME - 2 * self._byte)
        self.port.write(bytes([commands.CLOCK, step & 0xFF]))

    def title(self, unit: int) -> str:
        """What messages call a unit."""
        return self._titles.get(unit, f"unit {unit}")

    def fill(self, unit: int, data: bytes, master: bool = False, checked: bool = True) -> None:
        """SendData: select a unit, as the master of the steps or as a servant, and fill its buffer with 1500 bytes.

        `checked` asks for the checksum of what arrived, and fills again where it is wrong; the thesis trusts the line.
        """
        uid = commands.uid(unit)
        for _ in range(TRIES):
            self._ask(unit, bytes([uid, uid if master else SELECT]), 1, "a selection")
            self.port.write(data)
            time = (BUFFER + 1) * self._byte + commands.TURN_ROUND + _MARGIN
            done = self._answer(unit, 1, self.port.now() + time) is not None
            if done and (not checked or self.inquire(unit).step == crc_hqx(data, 0)):
                return
            self.counters.damaged += 1
            self.port.sleep(self.port.now() + _SILENCE)
        raise MachineError(f"{self.title(unit)} on line {self._name} did not take its buffer; {self.help}")

    def step_through(self, master: int, progress: Callable[[int], None] | None = None) -> None:
        """Execute: carry out the buffers of all units byte by byte, each step asked for when the master has made one.

        An answer that is lost does not stop the steps: every byte makes one, in all units alike.
        """
        uid, lost = commands.uid(master), 0
        self._clear()
        self.port.write(bytes([HOST, 0]))
        for k in range(BUFFER):
            self.port.write(bytes(1))
            time = 2 * self._byte + commands.BYTE_TIME + commands.TURN_ROUND + _MARGIN
            found = self._answer(master, 1, self.port.now() + time)
            if found is None:
                self.counters.lost += 1
                lost += 1
                if lost >= _STEPS_LOST:
                    self.stop_all(hold=True)
                    raise MachineError(
                        f"no answer from {self.title(master)}, the master of the steps, on line {self._name} "
                        f"(step {k + 1}, {uid}); {self.help}"
                    )
            else:
                lost = 0
            if progress is not None:
                progress(k + 1)

    def jog(self, unit: int, position_byte: int) -> None:
        """Jog: the unit moves by this byte every 10 ms until anything else is sent, but for half a second at most."""
        uid = commands.uid(unit)
        self._ask(unit, bytes([commands.JOG, uid]), 1, "a jog")
        self.port.write(bytes([uid, position_byte]))

    def home(self, unit: int) -> None:
        """The unit goes to its limit switch; returns when it is there. MachineError if it does not get there."""
        self._clear()
        self.port.write(bytes([commands.HOME, commands.uid(unit)]))
        if self._answer(unit, 1, self.port.now() + _HOMING) is None:
            self.stop_all()
            raise MachineError(
                f"{self.title(unit)} on line {self._name} did not reach its limit switch in {_HOMING:g} s"
            )

    def stop_all(self, hold: bool = False) -> None:
        """JogStop: all units stand. `hold`: they carry a buffer out, where a single byte says so."""
        self.port.write(bytes([commands.STOP] * (3 if hold else 2)))
        self.port.sleep(self.port.now() + 3 * self._byte)

    @contextmanager
    def stopping(self, hold: bool = False) -> Iterator[None]:
        """All units stand where the block is interrupted; `hold` as of `stop_all`."""
        try:
            yield
        except MachineError:
            raise  # whoever raised it has stopped them, as far as they can be reached
        except BaseException:
            with suppress(MachineError):
                self.stop_all(hold)
            raise

    def reset(self) -> None:
        """All units begin anew, as if they were switched on."""
        self.port.write(bytes([commands.RESET] * 2))
        self.port.sleep(self.port.now() + 2 * self._byte)
