"""A network between the axes and their controllers, as stages around those of a mode: `read`, `write` and `follow`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf

from rds.core.contracts import Motion
from rds.modes.loop.plan import Plan
from rds.network.links import ROUNDING, actuator_link, sensor_link

LOST = -1.0  # stands in a column of delays for a message that never arrived: a result's values are finite
Read = Callable[[], Sequence[float]]
Stage = Callable[[Sequence[float]], Sequence[float]]


class Links:
    """The links of all axes of a run. A simulated plant is moved by them (`moving`), to the instant.

    A machine gets voltages at its samples only: there a message acts from the first sample at or after its arrival,
    and the machine's own delay comes on top.
    """

    def __init__(self, plan: Plan):
        network, T = plan.network, plan.T
        assert network is not None
        self.T, self.k = T, 0
        self.sensed, self.computing, self.sent, self.arrived = [], [], [], []
        for axis in plan.axes:
            to_law, computes, to_axis = network.streams(axis.axis.name)
            draws = network.sensor.draws(to_law, T)
            self.sensed.append(sensor_link(network.sensor, draws, network.controller_buffer, network.event))
            self.computing.append(network.computing_draws(computes, T).__next__)
            sent, arrived = actuator_link(network.actuator, network.actuator.draws(to_axis, T), network.actuator_buffer)
            self.sent.append(sent)
            self.arrived.append(arrived)
        self.held = [0.0] * len(plan.axes)  # V, acting now
        self.offsets = [0.0] * len(plan.axes)  # samples into the period at which the law runs
        self._together = [  # the axes of one law
            i for i, axis in enumerate(plan.axes) if axis.controller is not None and axis.controller.coupled
        ]
        self._events: list[list[tuple[float, float]]] = [[] for _ in plan.axes]  # of a plant with a dead time
        self._dead: list[float] = [0.0] * len(plan.axes)

    def around(self, read: Read, write: Stage, follow: Stage) -> tuple[Read, Stage, Stage]:
        """The stages of a mode with the network between them."""
        T, sensed, computing, sent, arrived = self.T, self.sensed, self.computing, self.sent, self.arrived
        held, offsets, axes = self.held, self.offsets, range(len(self.held))
        ages, dead, events = [0.0] * len(held), self._dead, self._events
        measured_now = [0.0] * len(held)
        together = self._together
        told: list[float] = []
        if len(held) == 1 and not dead[0]:
            return self._around_one(read, write, follow)

        def read_through() -> Sequence[float]:
            k, positions = self.k, read()
            measured = []
            for i in axes:
                y, offsets[i] = sensed[i](k, positions[i])
                measured_now[i] = positions[i]
                ages[i] = y.age + offsets[i]
                measured.append(y)
            if together:  # their law waits for the last of their measurements
                latest = max(offsets[i] for i in together)
                for i in together:
                    ages[i] += latest - offsets[i]
                    offsets[i] = latest
            return measured

        def write_through(voltages: Sequence[float]) -> Sequence[float]:
            k = self.k
            told.clear()
            for i in axes:
                c = computing[i]()
                left = k + offsets[i] + c
                arrival = sent[i](k, left, voltages[i])
                told.extend((measured_now[i], ages[i] * T, c * T, LOST if arrival == inf else (arrival - left) * T))
                for message in arrived[i](k):
                    held[i] = message[2]
                    if dead[i]:
                        events[i].append((message[0] + dead[i], message[2]))
            return write(held)

        def follow_through(acting: Sequence[float]) -> Sequence[float]:
            outputs = follow(acting)
            self.k += 1
            return (*outputs, *told)

        return read_through, write_through, follow_through

    def _around_one(self, read: Read, write: Stage, follow: Stage) -> tuple[Read, Stage, Stage]:
        """`around` for one axis, the most frequent case by far."""
        T, held = self.T, self.held
        (sensed,), (computing,), (sent,), (arrived,) = self.sensed, self.computing, self.sent, self.arrived
        offset = age = now = 0.0
        told: tuple[float, ...] = ()

        def read_through() -> Sequence[float]:
            nonlocal offset, age, now
            (now,) = read()
            y, offset = sensed(self.k, now)
            age = (y.age + offset) * T
            return (y,)

        def write_through(voltages: Sequence[float]) -> Sequence[float]:
            nonlocal told
            k, c = self.k, computing()
            left = k + offset + c
            arrival = sent(k, left, voltages[0])
            told = (c * T, LOST if arrival == inf else (arrival - left) * T)
            for message in arrived(k):
                held[0] = message[2]
            return write(held)

        def follow_through(acting: Sequence[float]) -> Sequence[float]:
            outputs = follow(acting)
            self.k += 1
            return (*outputs, now, age, *told)

        return read_through, write_through, follow_through

    def moving(self, motions: Sequence[Motion]) -> Callable[[Sequence[float]], tuple[()]]:
        """The stage that moves simulated axes on by one sample, their voltages changing when messages arrive."""
        arrived, held, T = self.arrived, self.held, self.T
        self._dead = [motion.dead_time / T for motion in motions]
        behind = [0.0] * len(motions)  # V, behind the dead time
        if len(motions) == 1 and not self._dead[0]:
            return self._moving_one(motions[0])
        plants = list(zip(motions, arrived, self._dead, self._events, strict=True))

        def follow(acting: Sequence[float]) -> tuple[()]:
            k = self.k
            end = k + 1.0 - 2.0 * ROUNDING
            for i, (motion, arriving, dead, events) in enumerate(plants):
                if dead:
                    for message in arriving(end):
                        held[i] = message[2]
                        events.append((message[0] + dead, message[2]))
                    now, u = 0.0, behind[i]
                    while events and events[0][0] <= end:
                        at, following = events.pop(0)
                        if at - k > now + ROUNDING:
                            motion.move(u, (at - k - now) * T)
                            now = at - k
                        u = following
                    behind[i] = u
                    motion.move(u, (1.0 - now) * T)
                    continue
                messages = arriving(end)
                if not messages:
                    motion.write(held[i])
                    continue
                now, u = 0.0, held[i]
                for at, _, following in messages:
                    if at - k > now + ROUNDING:
                        motion.move(u, (at - k - now) * T)
                        now = at - k
                    u = following
                held[i] = u
                motion.move(u, (1.0 - now) * T)
            return ()

        return follow

    def _moving_one(self, motion: Motion) -> Callable[[Sequence[float]], tuple[()]]:
        """`moving` for one axis without a dead time."""
        held, T = self.held, self.T
        (arrived,) = self.arrived
        write, move = motion.write, motion.move

        def follow(acting: Sequence[float]) -> tuple[()]:
            k = self.k
            messages = arrived(k + 1.0 - 2.0 * ROUNDING)
            u = held[0]
            if not messages:
                write(u)
                return ()
            now = 0.0
            for at, _, following in messages:
                at -= k
                if at > now + ROUNDING:
                    move(u, (at - now) * T)
                    now = at
                u = following
            held[0] = u
            move(u, (1.0 - now) * T)
            return ()

        return follow
