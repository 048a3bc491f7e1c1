"""The submission's side of the loop: one question in, one answer out, until the grader closes the pipe.

The laws, models in motion and rows are those of every other run of RDS, so that graded answers are the same. Whatever a
submission raises is its own doing and is told, be it KeyboardInterrupt: nobody else is in this process.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import isfinite
from typing import Any

from rds.checks.rows import iterate, row_of
from rds.core.blame import student_error
from rds.core.errors import InputError
from rds.core.load import StudentFile
from rds.core.types import ArcSegment, LineSegment, Reference, Segment
from rds.core.values import shown
from rds.grading.sandbox import records
from rds.grading.sandbox.inside.channel import Channel, Receive, Send
from rds.grading.sandbox.inside.counting import RunCount
from rds.machines.converter import as_voltage
from rds.models.student import student_model
from rds.modes.loop.laws import LiveReference, controlled, coupled
from rds.modes.parts import start


def control(channel: Channel, student: StudentFile, order: dict[str, Any], counted: RunCount | None = None) -> None:
    """A controller of `order["axes"]` axes, in lock step."""
    axes = int(order["axes"])
    layout = records.control_layout(axes)
    references = [LiveReference() for _ in range(axes)]
    take = _one_axis(references[0]) if axes == 1 else _all_axes(references)
    try:
        controller = student.controller(coupled=axes > 1, params=order["params"])
        if order["initial_state"] is not None:
            controller = replace(controller, initial_state=order["initial_state"])
        params, names = dict(controller.params), [str(name) for name in order["names"]]
        if axes == 1:
            law = controlled(0, names[0], controller, references[0], order["T"], as_voltage, params)
        else:
            each = range(axes)
            law = coupled(each, names, controller, references, order["T"], [as_voltage] * axes, params)
    except BaseException as error:
        return _refuse(channel, error, student, counted)
    channel.tell({"begun": True})
    receive, send = _begun(channel, layout, order, counted)
    while True:
        values = receive()
        k = values[0]
        if counted and k == records.TOTAL:
            return counted.total()
        voltages: list[float] = []
        try:
            law(k, take(values), [], voltages)
        except BaseException as error:
            send(k, records.FAULT, *[0.0] * axes)
            return _explain(channel, error, student, k * order["T"], counted)
        send(k, records.OK, *voltages)


Take = Callable[[tuple[Any, ...]], Sequence[float]]
"""Sets the references to those of a question, and returns its measured positions."""


def _one_axis(reference: LiveReference) -> Take:
    """`_all_axes` for the most frequent case by far, written out: it is done at every sample."""
    p, v, a = reference.position, reference.velocity, reference.acceleration

    def take(values: tuple[Any, ...]) -> Sequence[float]:
        _, _, p.value, v.value, a.value, y = values
        return (y,)

    return take


def _all_axes(references: Sequence[LiveReference]) -> Take:
    cells = [getattr(each, part) for part in Reference._fields for each in references]
    positions_at = 2 + len(cells)

    def take(values: tuple[Any, ...]) -> Sequence[float]:
        for cell, value in zip(cells, values[2:positions_at], strict=True):
            cell.value = value
        return values[positions_at:]

    return take


def model(channel: Channel, student: StudentFile, order: dict[str, Any], counted: RunCount | None = None) -> None:
    """A model in motion: voltage in, output after that sample out."""
    receive, send = _begun(channel, records.MODEL, order, counted)
    try:
        motion = start(student_model(student, order["params"]), order["T"])
        write, read = motion.write, motion.read
        first = float(read())
        if not isfinite(first):
            raise InputError(f"its output before the first sample is {first!r}; it must be one finite number")
    except BaseException as error:
        return _refuse(channel, error, student, counted)
    channel.tell({"begun": True, "output": first})
    while True:
        k, voltage = receive()
        if counted and k == records.TOTAL:
            return counted.total()
        try:
            write(voltage)
            output = float(read())
        except BaseException as error:
            send(k, records.FAULT, 0.0)
            return _explain(channel, error, student, k * order["T"], counted)
        send(k, records.OK, output)


def rows(channel: Channel, student: StudentFile, order: dict[str, Any], counted: RunCount | None = None) -> None:
    """An interpolator's rows, a block at each question."""
    segment = _segment(order["segment"])
    axes = len(segment.start)
    layout = records.rows_layout(axes)
    receive, send = _begun(channel, layout, order, counted)
    try:
        params = student.parameters() | order["params"]  # the grader's own are given to whoever has no `params`, too
        given = iterate(student.functions["interpolate"](segment, order["T"], params))
        if isinstance(given, str):
            raise InputError(f"interpolate() returned {given}")
    except BaseException as error:
        return _refuse(channel, error, student, counted)
    channel.tell({"begun": True})
    taken = 0
    while True:
        (k,) = receive()
        if counted and k == records.TOTAL:
            return counted.total()
        block: list[float] = []
        code = records.OK
        for _ in range(records.ROWS):
            try:
                row = next(given, given)  # not None, which a generator may yield
                if row is given:
                    code = records.END
                    break
                values = row_of(row, axes)
                if isinstance(values, tuple):
                    raise InputError(f"row {taken} is {shown(row)}; {values[1]}")
            except BaseException as error:
                send(k, records.FAULT, *[0.0] * layout.answers)
                return _explain(channel, error, student, taken * order["T"], counted)
            block += values.ravel().tolist()
            taken += 1
        padding = [0.0] * (records.ROWS * 3 * axes - len(block))
        send(k, code, float(len(block) // (3 * axes)), *block, *padding)


def layout_of(order: dict[str, Any]) -> records.Layout:
    """The records of a run that is ordered so."""
    if order["op"] == "control":
        return records.control_layout(int(order["axes"]))
    return records.MODEL if order["op"] == "model" else records.rows_layout(len(order["segment"]["start"]))


def _begun(
    channel: Channel, layout: records.Layout, order: dict[str, Any], counted: RunCount | None
) -> tuple[Receive, Send]:
    """What questions and answers go through; what is counted is so from now on."""
    if counted is None:
        return channel.records(layout, order["through_memory"])
    counted.begin()
    return counted.receive, counted.send


def _segment(data: dict[str, Any]) -> Segment:
    fields: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in data.items()}
    return ArcSegment(**fields) if fields.pop("kind") == "arc" else LineSegment(**fields)


def _refuse(channel: Channel, error: BaseException, student: StudentFile, counted: RunCount | None) -> None:
    if counted:
        counted.stop()
    channel.tell_error(_said(error, student))


def _explain(channel: Channel, error: BaseException, student: StudentFile, t: float, counted: RunCount | None) -> None:
    if counted:
        counted.stop()
    said = _said(error, student)
    channel.tell_error(said if f"t = {t:.3f}" in said else f"at t = {t:.3f} s: {said}")


def _said(error: BaseException, student: StudentFile) -> str:
    return str(error) if isinstance(error, InputError) else student_error(error, student.source)
