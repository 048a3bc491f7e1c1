"""`rds doctor --bus`: an adapter and its bus measured by questions that move nothing, and what it would carry.

Somebody on the bus has to answer: a CANopen device (its device type, 0x1000) or a module of ours (a call). Between the
question's send() and the answer's recv() lie the adapter twice, the wire twice, and the answerer once.
"""

from __future__ import annotations

import contextlib
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import ceil, floor, log10
from pathlib import Path
from typing import Any

import can
import numpy as np

from rds.bus.medium import error_reports
from rds.bus.modules.cia402.codes import NODES
from rds.bus.modules.rds import frames
from rds.bus.tools.statistics import BITRATE, Statistics
from rds.core.progress import Progress

EDGES = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)  # ms
_LISTENS = 1.0  # s, before anything is asked
_PATIENCE = 0.25  # s: an answer that takes longer is lost
_LATE = 5.0  # times the median
_MARGIN = 1.25  # of the 99.9th percentile, for the sample period
_COLLECTS = 1.5e-3  # s of round trip beyond the wire's, from which on an adapter seems to collect frames
_QUESTION_BITS = 2 * 135  # of question and answer at most, 8 bytes each
_SHARE = 0.8  # of the bus that a cycle may take
_HEAVY = 0.05  # of the frames disturbed: not single disturbances any more
_SERIAL = Path("/sys/bus/usb-serial/devices")


@dataclass(frozen=True)
class Answerer:
    """Who is asked, and how."""

    name: str
    question: tuple[int, bytes]
    answer: int
    begins: bytes  # of the answer's data, from its second byte


@dataclass(frozen=True)
class AdapterReport:
    """What was measured; times in s. `round_trips` are those answered, in their order."""

    bus: str
    bitrate: int
    answerer: str | None
    asked: int
    round_trips: tuple[float, ...]
    lost: int
    late: int
    doubled: int
    echo: bool  # the adapter gives back what it has sent, as if others had
    load: float  # % before anything was asked
    error_frames: int
    errors: dict[str, int]  # by kind
    state: str
    latency_timer: float | None  # s, where the system tells it
    hints: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether all was answered in time and nothing was disturbed."""
        return self.answerer is not None and not (self.lost or self.error_frames or self.doubled)

    def percentile(self, percent: float) -> float | None:
        """Of the round trips, s; None without any."""
        return float(np.percentile(self.round_trips, percent)) if self.round_trips else None

    def sample_period(self, axes: int = 1) -> float | None:
        """The shortest sample period that this adapter would carry with so many axes, s; None if nothing answered.

        A cycle is a command and an answer of each axis: the 99.9th percentile of a round trip and the wire of the
        other answers, with a quarter more; and no more than 80 % of the bus. Rounded up to 1, 2 or 5.
        """
        longest = self.percentile(99.9)
        if longest is None:
            return None
        wire = _QUESTION_BITS / 2 / self.bitrate
        shortest = max(_MARGIN * (longest + (axes - 1) * wire), (axes + 1) * wire / _SHARE)
        decade = 10.0 ** floor(log10(shortest))
        return next(step * decade for step in (1.0, 2.0, 5.0, 10.0) if step * decade >= shortest * (1 - 1e-9))

    def histogram(self) -> list[int]:
        """Round trips by EDGES (ms); the last one is beyond them."""
        counts = np.histogram(np.array(self.round_trips) * 1e3, [0.0, *EDGES, np.inf])[0]
        return [int(count) for count in counts]

    def to_json(self) -> dict[str, Any]:
        """As plain values; times in ms."""
        plain = asdict(self)
        del plain["round_trips"]
        rest = {f"round_trip_{name}_ms": _ms(self.percentile(p)) for name, p in _PERCENTILES.items()}
        periods = {str(axes): _ms(self.sample_period(axes)) for axes in (1, 3, 6)}
        plain["latency_timer"] = _ms(self.latency_timer)
        return (
            plain
            | rest
            | {"edges_ms": list(EDGES), "histogram": self.histogram(), "sample_period_ms": periods, "ok": self.ok}
        )


_PERCENTILES = {"p50": 50.0, "p99": 99.0, "p999": 99.9, "max": 100.0}


def examine(
    bus: can.BusABC,
    name: str,
    bitrate: int | None = None,
    count: int = 1000,
    channel: Any = None,
    progress: Progress | None = None,
) -> AdapterReport:
    """Listen, find somebody who answers, ask `count` times, and judge. Nothing moves. can.CanError if the bus fails."""
    statistics = Statistics(bitrate or BITRATE)
    errors: Counter[str] = Counter()
    listening = time.monotonic()
    while (left := listening + _LISTENS - time.monotonic()) > 0:
        if (heard := bus.recv(left)) is not None:
            _note(heard, statistics, errors)
    load = statistics.snapshot(_LISTENS).load
    found, echo, nobody = _find(bus, errors)
    times: list[float] = []
    lost = doubled = 0
    for number in range(count if found is not None else 0):
        assert found is not None
        if progress is not None:
            progress(number, count)
        took, extra, own = _ask(bus, found, errors)
        doubled, echo = doubled + extra, echo or own
        if took is None:
            lost += 1
        else:
            times.append(took)
        time.sleep((number * 0.618 % 1.0) * 1e-3)  # not in step with a timer of the adapter
    late = sum(took > _LATE * float(np.median(times)) for took in times) if times else 0
    timer = latency_timer(channel)
    disturbed = sum(number for kind, number in errors.items() if kind in _DISTURBED)
    report = AdapterReport(
        bus=name,
        bitrate=bitrate or BITRATE,
        answerer=found.name if found else None,
        asked=count if found else 0,
        round_trips=tuple(times),
        lost=lost,
        late=late,
        doubled=doubled,
        echo=echo,
        load=load,
        error_frames=disturbed,
        errors=dict(errors),
        state=_state(bus),
        latency_timer=timer,
        hints=(),
    )
    return AdapterReport(**{**vars(report), "hints": tuple(hints(report, nobody))})


def hints(report: AdapterReport, nobody_acknowledges: bool = False) -> list[str]:
    """What the pattern of answers and errors speaks for, and what to do."""
    found = []
    if nobody_acknowledges or report.errors.get(_NO_ACK):
        found.append(
            "nobody acknowledges a frame: the cable is off, the devices have no power, or their bit rate is another "
            f"than {report.bitrate / 1e3:g} kbit/s"
        )
    elif report.answerer is None:
        found.append(
            f"nobody answers at {report.bitrate / 1e3:g} kbit/s: check the drive's supply, the cable, and the bit rate "
            "(others in use are 125, 250, 500 and 1000 kbit/s), or serve a machine (`rds machine serve`); a drive "
            "without a node-ID does not answer either (`rds drive node-id`)"
        )
    if report.error_frames:
        asked = max(2 * report.asked, 1)
        if report.error_frames > _HEAVY * asked:
            found.append(
                f"{report.error_frames} disturbed frames: with power off, measure between CAN-H and CAN-L. "
                "60 ohm is right; 120 ohm: one terminating resistor is missing, 40 ohm or less: there is one too many; "
                "then look for long stubs and for a bit rate that only some devices have"
            )
        else:
            found.append(
                f"{report.error_frames} disturbed frames, single ones: keep the cable away from motor leads, connect "
                "its shield at one end, and the devices' grounds with each other"
            )
    if report.echo:
        found.append(
            "the adapter gives back what it sends: switch that off (receive_own_messages), or a host takes its own "
            "commands for another host's"
        )
    if report.doubled:
        found.append(f"{report.doubled} answers came twice: two devices have one number, or the adapter repeats frames")
    median, wire = report.percentile(50.0), _QUESTION_BITS / report.bitrate
    if report.latency_timer is not None and report.latency_timer > 1e-3:
        found.append(
            f"the adapter's USB chip waits up to {report.latency_timer * 1e3:g} ms for more bytes: "
            "write 1 into latency_timer below /sys/bus/usb-serial/devices (as root)"
        )
    elif median is not None and median - wire > _COLLECTS:
        found.append(
            f"a round trip takes {median * 1e3:.1f} ms at the median, of which the wire takes {wire * 1e3:.2f} ms: the "
            "adapter seems to collect frames (a USB latency timer of up to 16 ms), or the answerer is slow"
        )
    if report.lost:
        found.append(
            f"{report.lost} of {report.asked} questions were not answered within {_PATIENCE:g} s: too slow a serial "
            "line (its baud rate), a full buffer, or another program that reads from the same adapter"
        )
    return found


def latency_timer(channel: Any) -> float | None:
    """Of a USB-serial adapter, s; None where the system does not tell."""
    device = Path(str(channel).split("@")[0])
    with contextlib.suppress(OSError, ValueError):
        return int((_SERIAL / device.resolve().name / "latency_timer").read_text()) * 1e-3
    return None


_NO_ACK, _BUS_OFF, _RESTARTED, _STATE, _BUS_ERROR = "no acknowledgement", "bus off", "restarted", "state", "bus error"
_DISTURBED = (_BUS_ERROR, _BUS_OFF)


def _note(message: can.Message, statistics: Statistics | None, errors: Counter[str]) -> None:
    if statistics is not None:
        statistics.add(message)
    if message.is_error_frame:
        errors[_kind(message.arbitration_id)] += 1


def _kind(classes: int) -> str:
    """Of an error frame of SocketCAN and the built-in bus; others' count as bus errors."""
    if classes & error_reports.ACKNOWLEDGEMENT:
        return _NO_ACK
    if classes & error_reports.OFF:
        return _BUS_OFF
    if classes & error_reports.RESTARTED:
        return _RESTARTED
    if classes & error_reports.CONTROLLER:
        return _STATE
    return _BUS_ERROR


def _find(bus: can.BusABC, errors: Counter[str]) -> tuple[Answerer | None, bool, bool]:
    """Who answers first; whether an own frame came back; whether nobody acknowledges."""
    sdo = b"\x40\x00\x10\x00" + bytes(4)
    answerers = [
        Answerer(f"the CANopen device with node-ID {node}", (0x600 + node, sdo), 0x580 + node, sdo[1:4])
        for node in NODES
    ]
    modules = [
        Answerer(f"module {node}", (frames.CALL, b""), frames.answer_identifier(node), b"") for node in frames.NODES
    ]
    echo = False
    for asked, several in ((modules[:1], modules), (answerers, answerers)):
        by_answer = {each.answer: each for each in several}
        own = {each.question for each in asked}
        for each in asked:
            try:
                _send(bus, each.question)
            except can.CanTimeoutError:
                return None, echo, True
        deadline = time.monotonic() + _PATIENCE
        while (left := deadline - time.monotonic()) > 0:
            heard = bus.recv(left)
            if heard is None:
                continue
            _note(heard, None, errors)
            if heard.is_error_frame or heard.is_extended_id:
                continue
            echo = echo or (heard.arbitration_id, bytes(heard.data)) in own
            answerer = by_answer.get(heard.arbitration_id)
            if answerer is not None and bytes(heard.data[1:4]).startswith(answerer.begins):
                _drain(bus, errors)
                return answerer, echo, False
    return None, echo, False


def _ask(bus: can.BusABC, whom: Answerer, errors: Counter[str]) -> tuple[float | None, int, bool]:
    """Time of a round trip in s, None if it is lost; answers that came twice before; whether the question came back."""
    doubled, echo = 0, False
    for message in _drain(bus, errors):
        doubled += message.arbitration_id == whom.answer
    sent = time.perf_counter()
    with contextlib.suppress(can.CanTimeoutError):
        _send(bus, whom.question)
    while (left := sent + _PATIENCE - time.perf_counter()) > 0:
        heard = bus.recv(left)
        if heard is None:
            continue
        now = time.perf_counter()
        _note(heard, None, errors)
        if heard.is_error_frame or heard.is_extended_id:
            continue
        if (heard.arbitration_id, bytes(heard.data)) == whom.question:
            echo = True
        elif heard.arbitration_id == whom.answer and bytes(heard.data[1:4]).startswith(whom.begins):
            return now - sent, doubled, echo
    return None, doubled, echo


def _drain(bus: can.BusABC, errors: Counter[str]) -> Sequence[can.Message]:
    waiting: list[can.Message] = []
    while len(waiting) < 1000 and (heard := bus.recv(0.0)) is not None:
        _note(heard, None, errors)
        waiting.append(heard)
    return waiting


def _send(bus: can.BusABC, question: tuple[int, bytes]) -> None:
    bus.send(can.Message(arbitration_id=question[0], data=question[1], is_extended_id=False), _PATIENCE)


def _state(bus: can.BusABC) -> str:
    try:
        return bus.state.name.lower()
    except (can.CanError, OSError, NotImplementedError):
        return "unknown"


def _ms(seconds: float | None) -> float | None:
    return None if seconds is None else ceil(seconds * 1e6 - 1e-6) / 1e3
