"""One cell: the processes of one submission behind their walls, from outside. Fresh for every case."""

from __future__ import annotations

import fcntl
import os
import signal
import socket
import struct
import termios
import threading
from array import array
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, NoReturn

from rds.grading.grade import Status
from rds.grading.sandbox import frames
from rds.grading.sandbox.budget import FLOOD, Budget
from rds.grading.sandbox.errors import SandboxError, SubmissionError
from rds.grading.sandbox.interpreter import Interpreter
from rds.grading.sandbox.output import Output, printable
from rds.grading.sandbox.processes import ended_for_memory, turns_of, usage
from rds.grading.sandbox.shared_channel import make_bell, make_memory
from rds.grading.sandbox.sleep_time import SleepTime
from rds.grading.sandbox.supervise import Supervisor

_START = 60.0  # s that the kernel may take for three forks on a busy computer
_END = 2.0  # s until init has said how its child ended
_CREDENTIALS = struct.Struct("3i")  # pid, uid, gid: written by the kernel, for the number spaces of the receiver
_KILLED = f"ended {-signal.SIGKILL}"  # in init's words


class Cell:
    """Started with `interpreter`, within `budget`, watched by `supervisor`; it may run on `cpus` (all if empty).

    `turn` is odd while the submission has to answer; `turn_limit` is how many s it may take for that.
    """

    def __init__(self, interpreter: Interpreter, budget: Budget, supervisor: Supervisor, cpus: Sequence[int] = ()):
        self.turn = 0
        self.turn_limit = budget.limits.load_seconds
        self._budget, self._supervisor = budget, supervisor
        self._verdict: tuple[Status, str] | None = None
        self._cpu, self._computed, self._turn_seen, self._turn_time = 0.0, 0.0, 0, 0.0
        self._asleep, self._grader = SleepTime(), threading.get_native_id()
        self._baseline = interpreter.resident_bytes
        self.is_closed = False
        self.signs: list[Callable[[], bool]] = []  # whether an answer is there that came by another way than the pipe
        self._lock = threading.Lock()  # the supervisor's thread ends cells too
        inner_questions, self.questions = os.pipe()
        self.answers, inner_answers = os.pipe()
        printed, inner_output = os.pipe()
        self._status, inner_status = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._status.setsockopt(socket.SOL_SOCKET, socket.SO_PASSCRED, 1)
        most = budget.limits.output_bytes
        self.output = Output(printed, max(most - budget.printed, 0), max(FLOOD * most - budget.printed, 0))
        self.shared = (make_memory(), make_bell(), make_bell())
        inner = (inner_questions, inner_answers, inner_output, *self.shared, inner_status.detach())
        try:
            limits = {key: getattr(budget.limits, key) for key in budget.limits.__dataclass_fields__}
            try:
                interpreter.fork({"limits": limits, "cpus": list(cpus)}, inner)
            finally:
                for descriptor in set(inner) - set(self.shared):
                    os.close(descriptor)
            self._process = self._started()
            self._handle = os.pidfd_open(self._process)
        except BaseException:
            self._close_ends()
            raise
        supervisor.watch(self)

    def exchange(self, value: Any, seconds: float) -> Any:
        """One frame out and one back, within `seconds`. SubmissionError if there is none, or not JSON as agreed."""
        self.turn_limit = seconds
        self.turn += 1
        try:
            data = frames.encode(value)
            while data:
                data = data[os.write(self.questions, data) :]
        except BrokenPipeError:
            self.fail()
        answer = self.frame()
        self.turn += 1
        return answer

    def frame(self) -> Any:
        """The next frame from inside."""
        try:
            return frames.decode(self.receive(frames.size(self.receive(frames.HEADER.size))))
        except frames.FrameError as error:
            self.kill(Status.BROKE_CONTRACT, f"it wrote into the grader's pipe: {printable(str(error))}")
            self.fail()

    def receive(self, count: int, data: bytes = b"") -> bytes:
        """`count` bytes from inside, of which `data` are here already. SubmissionError if there will not be as many."""
        while len(data) < count:
            part = os.read(self.answers, count - len(data))
            if not part:
                self.fail()
            data += part
        return data

    def inspect(self, seconds: float) -> None:
        """By the supervisor, `seconds` after the last time: count, and end the cell if a limit is exceeded."""
        turn, used = self.turn, usage(self._process, self._baseline)
        computed, self._computed = used.first_seconds - self._computed, used.first_seconds
        # one that waits for a processor has no fault, if none of its own children keeps it busy
        is_working = used.first_runs and used.processes == 1
        is_same, asleep, grading = turn == self._turn_seen, self._asleep, turns_of(os.getpid(), self._grader)
        asleep.look(seconds, used.first_thread, grading, used.first_sleeps, is_same)
        if not is_same:
            self._turn_seen, self._turn_time = turn, 0.0
            if turn % 2 and is_working:
                self._budget.step(asleep.between)
            elif turn % 2 and not self.has_answered():
                self._budget.step(seconds)  # asleep at many samples, if only for a moment at each
        elif turn % 2:
            self._turn_time += self._budget.step(computed if is_working else seconds)
            if asleep.slept:  # and awake at the looks
                self._turn_time += self._budget.step(asleep.own - self._turn_time)
        self._cpu = max(self._cpu, used.cpu_seconds)
        fault = self._budget.fault(self._cpu, used.memory_bytes, self._turn_time, self.turn_limit)
        if fault is not None:
            self.kill(*fault)

    def has_answered(self) -> bool:
        """By the supervisor: whether an answer is there that the grader has not come to yet."""
        with self._lock:
            if self.is_closed:
                return True
            waiting = array("i", [0])
            fcntl.ioctl(self.answers, termios.FIONREAD, waiting)
            return waiting[0] > 0 or any(answered() for answered in self.signs)

    @property
    def printed(self) -> str:
        """What it has printed so far."""
        self.printed_so_far()
        return self.output.text

    def printed_so_far(self) -> tuple[bytes, int]:
        """The same as bytes, as far as they are kept, and how many there were."""
        if not self.is_closed:
            self._supervisor.drain(self)
        return self.output.so_far

    def take_output(self) -> bool:
        """By the supervisor: read what was printed; False once nothing more can come."""
        goes_on = self.output.collect()
        if self.output.is_flood:
            self.kill(Status.KILLED, f"it printed more than {self._budget.limits.output_bytes} bytes many times over")
            return False
        return goes_on

    def kill(self, status: Status, reason: str) -> None:
        """End all its processes; the first who does so says why."""
        if self._verdict is None:
            self._verdict = (status, reason)
        self._end()

    def fail(self) -> NoReturn:
        """It has ended, or cannot go on: close it and raise SubmissionError with the reason.

        SandboxError where somebody else has ended it: then the submission is to be graded again.
        """
        said = self._last_words()
        verdict = self._verdict
        self.close()
        if said.startswith("broken"):
            raise SandboxError(f"the sandbox could not be put up: {said}")
        if verdict is None and not said:
            raise SandboxError("its sandbox was ended from outside, which no submission can do; grade it again")
        if verdict is None and said == _KILLED and ended_for_memory() > self._budget.ended_for_memory:
            raise SandboxError("the computer ran out of memory and ended processes; grade it again with fewer --jobs")
        if verdict is None:
            raise SubmissionError(*_blame(said), may_be_foreign=said == _KILLED)
        raise SubmissionError(*verdict)

    def close(self) -> None:
        """End all its processes, and forget it."""
        if self.is_closed:
            return
        self.is_closed = True
        self._cpu = max(self._cpu, usage(self._process).cpu_seconds)
        self._end()  # the kernel takes some ms to take the namespaces apart; nothing has to wait for that
        self._supervisor.forget(self)
        self.output.collect()
        self._budget.cpu_before += self._cpu
        self._budget.printed += self.output.seen
        with self._lock:
            os.close(self._handle)
            self._handle = -1
            self._close_ends()

    def _close_ends(self) -> None:
        """The grader's ends of all channels."""
        for descriptor in (self.questions, self.answers, self.output.descriptor, *self.shared):
            os.close(descriptor)
        self._status.close()

    def _started(self) -> int:
        """The number of its init, as the kernel gives it."""
        self._status.settimeout(_START)
        try:
            data, ancillary, _, _ = self._status.recvmsg(1024, socket.CMSG_SPACE(_CREDENTIALS.size))
        except OSError:
            data, ancillary = b"no sign of life", []
        for level, kind, payload in ancillary:
            if data == b"started" and (level, kind) == (socket.SOL_SOCKET, socket.SCM_CREDENTIALS):
                return int(_CREDENTIALS.unpack(payload)[0])
        raise SandboxError(f"the sandbox could not be put up: {data.decode(errors='replace') or 'it ended at once'}")

    def _end(self) -> None:
        with self._lock, suppress(ProcessLookupError):
            if self._handle >= 0:
                signal.pidfd_send_signal(self._handle, signal.SIGKILL)

    def _last_words(self) -> str:
        """What init says of the end: nothing if it was killed itself, "silent" if there was no end."""
        self._status.settimeout(_END)
        try:
            return self._status.recv(1024).decode(errors="replace")
        except TimeoutError:
            return "silent"
        except OSError:
            return ""


def _blame(said: str) -> tuple[Status, str]:
    """How it ended by itself, from init's words."""
    word, _, number = said.partition(" ")
    if word == "silent":
        return Status.BROKE_CONTRACT, "it closed the pipes to the grader"
    code = int(number)
    if code >= 0:
        return Status.KILLED, f"it ended its own process, with exit code {code}"
    if -code == signal.SIGXCPU:
        return Status.TIMED_OUT, "it took more computing time than is allowed"
    name = signal.Signals(-code).name if -code in {each.value for each in signal.Signals} else f"signal {-code}"
    hint = "; too deep a recursion, or compiled code gone wrong" if -code == signal.SIGSEGV else ""
    return Status.KILLED, f"its process was ended by {name}{hint}"
