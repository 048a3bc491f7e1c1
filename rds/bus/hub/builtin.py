"""The built-in bus: a python-can interface for any number of processes on one machine, without privileges.

`can.Bus(interface="rds", channel="mini-cnc")`. The first bus that opens a channel starts its hub (hub.py), which
carries all frames in one order and loses none: when a node reads too slowly, senders wait.

Our own, because python-can's `virtual` lives in one process and its `udp_multicast` loses frames of a burst; neither
has bit timing or arbitration.
"""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import select
import socket
import threading
import time
from collections import deque
from typing import Any

import can

from rds.bus.hub import connect, wire
from rds.bus.hub.address import Address, channels
from rds.bus.hub.bus_settings import read_settings
from rds.bus.hub.error_states import ErrorStateReader
from rds.bus.hub.wire_messages import filters_of, message_of, record_of
from rds.bus.medium.confinement import ErrorState

LOG = logging.getLogger(__name__)

_SIZE = wire.RECORD
_AT_ONCE = getattr(socket, "MSG_DONTWAIT", 0)  # 0 on Windows, where `select` has to tell beforehand
_WHOLE = socket.MSG_WAITALL
_PERIODIC_END = 1.0  # s for a periodic task to send its last frame
_HALF_SENT = 10.0  # s to finish a frame of which a part is on its way
_SHUT_DOWN = "this bus has been shut down"


class _ShutMeanwhile(can.CanOperationError):
    """Another thread shut the bus down while this one waited in recv()."""


class BuiltinBus(can.BusABC):
    """One node of the built-in bus.

    Parameters beside python-can's own; an unknown one is a ValueError:

    `bitrate`, bit/s (10,000 to 1,000,000): the bus has bit timing, if this is the first node on it; any other node's
    must be the same. Without it a node joins whatever is there; the first one makes the bus untimed.
    `data_bitrate`, bit/s (up to 8,000,000): of CAN FD frames with bit-rate switch.
    `timing`: a can.BitTiming or can.BitTimingFd, in place of the bit rates, which are all that is taken of it.
    `name`: what the hub calls this node, for faults and `rds bus nodes`.
    `error_frames`: receive what this node's controller reports, in SocketCAN's format (error_reports.py).
    `restart_ms`: come back from bus off by itself, so much later.
    `fd`: False: this node sends no CAN FD frames, send() raises ValueError; it still receives those of others.

    With `receive_own_messages` a node's own frames come back with `is_rx` False, as on SocketCAN.

    `channel` is a name of up to 32 letters, digits, '.', '_' and '-'. Time stamps are given by the hub: seconds since
    the epoch by a clock that never steps, the same for all nodes; with bit timing, of the end of the frame on the
    wire. A bus must not be used in a forked child.

    Raises can.CanInitializationError if the channel can't be joined.
    """

    def __init__(
        self,
        channel: Any = "default",
        can_filters: Any = None,
        receive_own_messages: bool = False,
        fd: bool | None = None,
        **options: Any,
    ):
        settings = read_settings(options)
        for option, value in (("fd", fd), ("receive_own_messages", receive_own_messages)):
            if value not in (None, True, False):  # 1 and 0 are what python-can makes of its variables' text
                raise ValueError(f"{option} {value!r} must be true or false")
        can_filters = list(can_filters or ()) or None
        wanted = filters_of(can_filters or ())
        self._channel = str(channel)
        self._channel_given = channel  # as python-can's own interfaces, messages bear it as it was given: 0, not "0"
        self.channel_info = f"built-in bus channel {self._channel!r}"
        self._can_protocol = can.CanProtocol.CAN_20 if fd is not None and not fd else can.CanProtocol.CAN_FD
        self._lost: str | None = None
        self._early: deque[bytes] = deque()  # frames read while looking for the reason of an end
        self._stand_in: tuple[socket.socket, socket.socket] | None = None
        self._sending = threading.Lock()
        self._pid = os.getpid()
        try:
            connection = connect.join(self._channel, bool(receive_own_messages), wanted, settings)
            states = Address(self._channel).error_states_path
            self._error_states = ErrorStateReader(states, connection.node) if connection.bitrate else None
        except OSError as error:
            raise can.CanInitializationError(f"{self.channel_info}: {error}") from error
        self._sock = connection.sock
        self._node = connection.node
        self.hub_pid = connection.hub_pid
        self.bitrate = connection.bitrate  # bit/s; 0: the bus has no bit timing
        self.data_bitrate = connection.data_bitrate
        self._filters = can_filters
        self._periodic_tasks = []
        self._is_shutdown = False

    def set_filters(self, filters: Any = None) -> None:
        """Receive the frames that pass one of `filters` (any iterable of python-can's; none of them: all frames).

        ValueError for what is no filter, can.CanOperationError if the bus is gone; the filters before go on, then.
        """
        asked = list(filters or ()) or None
        wanted = filters_of(asked or ())
        self._require_hub()
        before, self._filters = self._filters, asked
        try:
            connect.retune(self._channel, self._node, wanted)
        except OSError as error:
            self._filters = before
            raise can.CanOperationError(f"{self.channel_info}: filters not set: {error}") from error

    def _require_hub(self) -> None:
        """CanOperationError if this bus is gone: its number may be another node's, of a hub that came afterwards."""
        if self._is_shutdown:
            raise can.CanOperationError(f"{self.channel_info}: {_SHUT_DOWN}")
        if self._lost is None and _is_hung_up(self._sock):
            raise self._lose(self._look_for_reason() or self._describe(ConnectionResetError("the hub has ended")))
        if self._lost is not None:
            raise can.CanOperationError(self._lost)

    # --- receiving

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next message, or None if none comes within `timeout` s (None: waits as long as it takes).

        When another thread shuts the bus down meanwhile, nothing more can come: the wait ends early, and a notifier
        that was stopped before ends in peace. Raises can.CanOperationError if the bus is gone.
        """
        try:
            return super().recv(timeout)
        except _ShutMeanwhile:
            if timeout is None:
                raise
            return None

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if self._lost is not None:
            return self._after_the_end()
        if self._is_shutdown:
            raise can.CanOperationError(f"{self.channel_info}: {_SHUT_DOWN}")
        try:
            record = self._next_record(timeout)
        except OSError as error:
            if self._is_shutdown:
                raise _ShutMeanwhile(f"{self.channel_info}: {_SHUT_DOWN}") from error
            raise self._lose(self._describe(error)) from error
        if record is None:
            return None, False
        if record[12] != wire.FRAME:
            raise self._lose(f"the hub let this node go: {wire.goodbye_reason(record)}")
        # frames that were on their way when filters changed are sorted out by python-can; error frames have no filter
        return message_of(record, self._channel_given), self._filters is None or bool(record[13] & wire.ERROR)

    def _next_record(self, timeout: float | None) -> bytes | None:
        """The next record, or None if there is none in time. OSError if the connection broke."""
        receive = self._sock.recv
        if timeout is None:
            record = receive(_SIZE, _WHOLE)
        elif _AT_ONCE:
            try:
                record = receive(_SIZE, _AT_ONCE)
            except BlockingIOError:
                if timeout <= 0 or (waited := self._wait_and_receive(timeout)) is None:
                    return None
                record = waited
        else:
            if not _wait(self._sock, False, max(0.0, timeout)):
                return None
            record = receive(_SIZE, _WHOLE)
        while len(record) < _SIZE:  # the rest is on its way: the hub sends whole records
            more = receive(_SIZE - len(record), _WHOLE) if record else b""
            if not more:
                raise ConnectionResetError("the hub has ended")
            record += more
        return record

    def _wait_and_receive(self, timeout: float) -> bytes | None:
        """What is there first, within `timeout` s; another thread that reads the same bus may have been quicker."""
        deadline = time.monotonic() + timeout
        while timeout > 0 and _wait(self._sock, False, timeout):
            try:
                return self._sock.recv(_SIZE, _AT_ONCE)
            except BlockingIOError:
                timeout = deadline - time.monotonic()
        return None

    # --- sending

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Give `msg` to the bus. Waits while a reader lags, up to `timeout` s (None: as long as it takes; 0: not).

        Raises can.CanTimeoutError if it could not be taken in time (then nothing of it was sent),
        can.CanOperationError if the bus is gone, ValueError for a frame that can't exist.
        """
        record = record_of(msg)
        if msg.is_fd and self._can_protocol is can.CanProtocol.CAN_20:
            raise ValueError(f"{self.channel_info}: opened with fd=False, it sends no CAN FD frames; leave fd away")
        if self._lost is not None:
            raise can.CanOperationError(self._lost)
        if self._error_states is not None:
            self._check_state(msg)
        with self._sending:
            try:
                sent = self._send_at_once(record)
                if sent == 0:
                    sent = self._send_waiting(record, timeout)
                if sent < _SIZE:
                    self._finish(record[sent:])
            except (BlockingIOError, TimeoutError):
                raise can.CanTimeoutError(
                    f"{self.channel_info}: frame {msg.arbitration_id:#x} was not taken within {timeout} s: "
                    f"{self._obstacle()}"
                ) from None
            except OSError as error:
                raise self._lose(self._look_for_reason() or self._describe(error)) from error

    def _check_state(self, msg: can.Message) -> None:
        assert self._error_states is not None
        if msg.is_error_frame:
            raise ValueError("error frames can't be sent on a bus with bit timing; inject a fault (rds.bus.hub.faults)")
        if self._error_states.state() == ErrorState.OFF:
            raise can.CanOperationError(
                f"{self.channel_info}: this node is bus off: too many of its frames met errors. Mend the "
                "fault and start the run again ([bus] restart_ms lets it come back by itself); in Python, call "
                "restart() or open the bus again"
            )

    def _obstacle(self) -> str:
        """Why frames wait."""
        if self._error_states is None:
            return f"a node does not read its frames, or the hub (process {self.hub_pid}) stands still"
        if self._error_states.state() == ErrorState.PASSIVE:
            return "the node is error passive: nobody acknowledges its frames, or all are disturbed"
        return "the bus is busy with other frames, or a node does not read its frames"

    @property
    def state(self) -> can.BusState:
        """ACTIVE, PASSIVE, or ERROR for bus off; always ACTIVE on a bus without bit timing."""
        states = (can.BusState.ACTIVE, can.BusState.PASSIVE, can.BusState.ERROR)
        return states[0 if self._error_states is None else self._error_states.state()]

    @state.setter
    def state(self, new_state: can.BusState) -> None:
        raise NotImplementedError(
            f"the state cannot be set to {new_state}: a controller's error state follows from its counters, restart() "
            "leads out of bus off, and no node of the built-in bus only listens; who sends nothing disturbs nothing"
        )

    def restart(self) -> None:
        """Ask the controller to come back from bus off: it does when it has seen 128 times 11 recessive bits.

        Raises can.CanOperationError if it is not bus off, or the hub does not answer.
        """
        from rds.bus.hub.faults import Faults
        from rds.core.errors import RdsError

        self._require_hub()
        try:
            with Faults(self._channel) as faults:
                faults.restart(self._node)
        except RdsError as error:
            raise can.CanOperationError(str(error)) from error

    def _send_at_once(self, data: bytes) -> int:
        if not _AT_ONCE and not _wait(self._sock, True, 0.0):
            return 0
        try:
            return self._sock.send(data, _AT_ONCE)
        except BlockingIOError:
            return 0

    def _send_waiting(self, data: bytes, timeout: float | None) -> int:
        deadline = None if timeout is None else time.monotonic() + timeout
        while True:
            left = None if deadline is None else max(0.0, deadline - time.monotonic())
            if left == 0.0 or not _wait(self._sock, True, left):
                raise TimeoutError
            sent = self._send_at_once(data)
            if sent:
                return sent

    def _finish(self, rest: bytes) -> None:
        """Half a frame would spoil the connection, so its rest may take longer than the caller's timeout."""
        deadline = time.monotonic() + _HALF_SENT
        while rest:
            if not _wait(self._sock, True, max(0.0, deadline - time.monotonic())):
                raise ConnectionAbortedError("a frame was half sent")
            rest = rest[self._send_at_once(rest) :]

    # --- the end

    def _after_the_end(self) -> tuple[can.Message, bool]:
        if self._early:
            return message_of(self._early.popleft(), self._channel_given), self._filters is None
        raise can.CanOperationError(self._lost or "")

    def _describe(self, error: OSError) -> str:
        if self._sock.fileno() < 0 or self._is_shutdown:
            return _SHUT_DOWN
        return f"the hub (process {self.hub_pid}) ended without a word ({error}); open the bus again"

    def _lose(self, reason: str) -> can.CanOperationError:
        """Remember that the bus is gone and why, and say so in the log; return the error to raise."""
        if self._lost is None:
            self._lost = f"{self.channel_info}: {reason}"
            if not self._is_shutdown:
                LOG.error("%s", self._lost)
                self._silence()
        return can.CanOperationError(self._lost)

    def _silence(self) -> None:
        """Put a socket that is never readable under our descriptor: an end would wake an event loop for ever."""
        if hasattr(socket, "AF_UNIX") and self._stand_in is None:
            with contextlib.suppress(OSError):
                self._stand_in = socket.socketpair()
                os.dup2(self._stand_in[0].fileno(), self._sock.fileno(), inheritable=False)

    def _look_for_reason(self) -> str:
        """Read what is left, keep the frames for recv(), return the reason at the end of them."""
        with contextlib.suppress(OSError):
            while record := self._next_record(0.0):
                if record[12] != wire.FRAME:
                    return f"the hub let this node go: {wire.goodbye_reason(record)}"
                self._early.append(record)
        return ""

    def _send_periodic_internal(self, msgs: Any, period: float, *args: Any, **options: Any) -> Any:
        """As python-can's. Raises can.CanOperationError at once if the bus is gone, not in the thread that sends;
        ValueError for a period that is none, by which python-can would send as fast as it can.
        """
        self._require_hub()
        if not period > 0.0:
            raise ValueError(f"{self.channel_info}: period {period!r} s must be more than 0; send() sends once")
        return super()._send_periodic_internal(msgs, period, *args, **options)

    def shutdown(self) -> None:
        """Leave the bus. May be called more than once. Frames sent before still reach the others."""
        if self._is_shutdown:
            super().shutdown()  # python-can's log tells
            return
        periodic = [getattr(task, "thread", None) for task in self._periodic_tasks]
        super().shutdown()
        for thread in periodic:  # told to stop; the frame that one is sending would meet a closed bus
            if thread is not None and thread is not threading.current_thread():
                thread.join(_PERIODIC_END)
        if os.getpid() == self._pid and self._lost is None:
            with contextlib.suppress(OSError):
                self._sock.shutdown(socket.SHUT_WR)
                if self._sock.family == socket.AF_INET:  # closing with frames unread would take back those sent
                    self._sock.settimeout(1.0)
                    while self._sock.recv(1 << 16):
                        pass
                self._sock.shutdown(socket.SHUT_RD)  # wakes a thread that waits in recv()
        self._sock.close()
        if self._error_states is not None:
            self._error_states.close()
            self._error_states = None
        for stand_in in self._stand_in or ():
            stand_in.close()

    def fileno(self) -> int:
        """The socket: readable when a frame waits; one frame per readable event, for event loops. -1 when shut down."""
        return self._sock.fileno()

    @staticmethod
    def _detect_available_configs() -> list[Any]:
        return [{"interface": "rds", "channel": channel} for channel in channels()]


def _is_hung_up(sock: socket.socket) -> bool:
    """Whether the other end has closed; false where that can't be seen before what it has sent is read."""
    if not hasattr(select, "POLLRDHUP"):
        return False
    poller = select.poll()
    poller.register(sock.fileno(), select.POLLRDHUP)
    return bool(poller.poll(0.0))


def _wait(sock: socket.socket, writing: bool, timeout: float | None) -> bool:
    """Wait until the socket is ready; `select` is exact to the µs, `poll` (for high descriptors) to the ms."""
    fd = sock.fileno()
    if fd < 0:
        raise OSError(errno.EBADF, "closed")
    if fd < 1024 or not hasattr(select, "poll"):
        ready = select.select([] if writing else [fd], [fd] if writing else [], [], timeout)
        return bool(ready[0] or ready[1])
    poller = select.poll()
    poller.register(fd, select.POLLOUT if writing else select.POLLIN)
    return bool(poller.poll(None if timeout is None else timeout * 1000.0))
