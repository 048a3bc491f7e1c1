"""The way back from bus off: 128 times eleven recessive bits, counted between and within what the others send."""

from __future__ import annotations

from collections.abc import Iterable

from rds.bus.medium.confinement import RECOVERY
from rds.bus.medium.station import Station


class Recovery:
    """Counts for all stations that recover; `sequence` is the time of eleven bits, ns.

    A frame ends with eleven recessive bits, if the bus stays free for so long: acknowledge delimiter, end of frame
    and interframe space; so does an error frame, with its delimiter. Longer pauses count as often as they are long.
    """

    def __init__(self, sequence: int):
        self._sequence = sequence
        self._recessive = 0  # from when on the bus is
        self._stations: list[Station] = []

    def __bool__(self) -> bool:
        return bool(self._stations)

    def ask(self, station: Station, now: int) -> None:
        """A station wants to come back."""
        if not station.recovering:
            station.recovering, station.recovery_from = RECOVERY, now
            self._stations.append(station)

    def ended(self, free: int) -> None:
        """A frame or error frame is over; the next may start at `free`."""
        self._recessive = free - self._sequence

    def started(self, time: int) -> list[Station]:
        """A frame starts; returns those that have seen enough."""
        for station in self._stations:
            seen = max(0, time - self._since(station)) // self._sequence
            station.recovering -= min(seen, station.recovering)
        return self._settle()

    def time(self) -> int:
        """When the first of those that recover has seen enough if the bus stays free."""
        return min(map(self._complete, self._stations))

    def reached(self, time: int) -> list[Station]:
        """It stayed free until `time`; returns those that have seen enough."""
        for station in self._stations:
            if self._complete(station) <= time:
                station.recovering = 0
        return self._settle()

    def forget(self, stations: Iterable[Station]) -> None:
        """These have gone."""
        gone = {id(station) for station in stations}
        self._stations = [station for station in self._stations if id(station) not in gone]

    def _settle(self) -> list[Station]:
        ready = [station for station in self._stations if not station.recovering]
        self._stations = [station for station in self._stations if station.recovering]
        return ready

    def _since(self, station: Station) -> int:
        return max(self._recessive, station.recovery_from)

    def _complete(self, station: Station) -> int:
        return self._since(station) + station.recovering * self._sequence
