"""Which frame asks and which answers: patterns of frames, and the time between them.

A pattern is an identifier, `#`, and how the data begin, in hexadecimal:

    001#01          identifier 0x001, data begin with 0x01
    000#04MM00      the second byte is the number of the module
    M#0301..01      the identifier is the number of the module; the third byte may be anything
    020+M#          the identifier is 0x020 + the number of the module (1 to 127), any data
    000#04MM00..$   no more data after these four bytes

An identifier of eight digits is an extended one. A pair is `name: request -> answer`, and where there is more than one
answer that will do, `name: request -> answer | answer`; pairs are separated by `;`. What a module says once more when
the request is carried out is no answer, and stands behind `then`: `name: request -> answer then end`. A request without
M is to all modules, and each module's first answer counts; a request with M is to that module alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from rds.core.errors import InputError

MODULES = range(1, 128)
EVERY = 0  # the module that a pattern without M speaks to or of

_IDENTIFIER = re.compile(r"(?P<base>[0-9A-Fa-f]{1,8})?(?P<plus>\+)?(?P<module>M)?")
_DATA = re.compile(r"([0-9A-Fa-f]{2}|\.\.|MM)*")


class Frame(NamedTuple):
    """One frame of a log."""

    time: float  # s
    identifier: int
    extended: bool
    data: bytes


@dataclass(frozen=True)
class Pattern:
    """Frames with a certain identifier whose data begin in a certain way."""

    base: int
    module_in_identifier: bool
    extended: bool
    data: tuple[int | str, ...]  # a byte, ".." for any, "MM" for the module's number
    whole: bool = False  # whether no more data may follow

    def module(self, frame: Frame) -> int | None:
        """The module of a frame that fits (EVERY where the pattern has no M), or None for a frame that doesn't."""
        module = frame.identifier - self.base if self.module_in_identifier else EVERY
        if frame.extended != self.extended or len(frame.data) < len(self.data):
            return None
        if self.whole and len(frame.data) > len(self.data):
            return None
        if module not in MODULES if self.module_in_identifier else frame.identifier != self.base:
            return None
        for wanted, found in zip(self.data, frame.data, strict=False):
            if wanted == "MM":
                if module not in (EVERY, found) or found not in MODULES:
                    return None
                module = found
            elif wanted not in ("..", found):
                return None
        return module


class Pair(NamedTuple):
    """A request and the answers to it: whichever comes first."""

    name: str
    request: Pattern
    answers: tuple[Pattern, ...]
    ends: tuple[Pattern, ...] = ()

    def answered_by(self, frame: Frame) -> int | None:
        """The module whose answer a frame is (EVERY where the pattern has no M); None if it is none."""
        return _first(self.answers, frame)

    def ended_by(self, frame: Frame) -> int | None:
        """The same for a frame that says that an answered request is carried out."""
        return _first(self.ends, frame)


def _first(patterns: Iterable[Pattern], frame: Frame) -> int | None:
    found = (pattern.module(frame) for pattern in patterns)
    return next((module for module in found if module is not None), None)


def parse_pattern(text: str) -> Pattern:
    """A pattern from its text; InputError where it is none."""
    identifier, hash_sign, data = text.strip().partition("#")
    whole, data = data.endswith("$"), data.removesuffix("$")
    parts, valid = _IDENTIFIER.fullmatch(identifier), _DATA.fullmatch(data)
    # "M" or "020+M" or "020": a sum needs both of its terms
    summed = parts is not None and bool(parts["plus"]) == bool(parts["base"] and parts["module"])
    if not hash_sign or parts is None or valid is None or not identifier or not summed:
        raise InputError(
            f"{text.strip()!r} is not a pattern of frames; write one as in '001#01', 'M#0301' or '020+M#..04': "
            "identifier in hexadecimal or M, '#', bytes of data in hexadecimal, '..' for any, 'MM' for the module, "
            "'$' at the end for no more"
        )
    digits = parts["base"] or ""
    base, extended = int(digits or "0", 16), len(digits) == 8
    if base >= 1 << (29 if extended else 11):
        raise InputError(
            f"identifier {digits!r} in {text.strip()!r} is too large; a standard one is at most 7FF, "
            "an extended one at most 1FFFFFFF and written with eight digits"
        )
    pieces = [data[at : at + 2] for at in range(0, len(data), 2)]
    wanted = tuple(piece if piece in ("..", "MM") else int(piece, 16) for piece in pieces)
    return Pattern(base, parts["module"] is not None, extended, wanted, whole)


def parse_pairs(text: str) -> list[Pair]:
    """Pairs from their text; InputError for one that is none, or a name given twice."""
    pairs: list[Pair] = []
    for entry in filter(None, (part.strip() for part in text.split(";"))):
        name, colon, patterns = entry.partition(":")
        request, arrow, answer = patterns.partition("->")
        if not (colon and arrow and name.strip()):
            raise InputError(f"{entry!r} is not a pair; write it as in 'move start: M#0301 -> 000#04MM00'")
        if any(pair.name == name.strip() for pair in pairs):
            raise InputError(f"two pairs are called {name.strip()!r}; rename one")
        answer, then, end = answer.partition(" then ")
        answers = tuple(parse_pattern(text) for text in answer.split("|"))
        ends = tuple(parse_pattern(text) for text in end.split("|")) if then else ()
        pairs.append(Pair(name.strip(), parse_pattern(request), answers, ends))
    if not pairs:
        raise InputError("there is no pair; write at least one as in 'move start: M#0301 -> 000#04MM00'")
    return pairs


@dataclass
class Exchanges:
    """What a log holds of some pairs: response times, and what had no other side."""

    times: dict[tuple[str, int], list[float]] = field(default_factory=dict)  # s, by pair and module
    requests: dict[tuple[str, int], int] = field(default_factory=dict)  # by pair and module (EVERY: to all)
    under_way: set[tuple[str, int]] = field(default_factory=set)  # answered, and not yet said to be carried out
    strays: int = 0  # answers without a request that waited for them

    def unanswered(self, pair: str, module: int) -> int:
        """How many requests this module left without an answer in time."""
        asked = self.requests.get((pair, EVERY), 0) + (self.requests.get((pair, module), 0) if module else 0)
        return asked - len(self.times.get((pair, module), []))

    def sides(self) -> list[tuple[str, int]]:
        """Pairs and modules that a request was addressed to or an answer came from, in this order."""
        answered = {pair for pair, module in self.times if module != EVERY}
        # a request to all is counted at the modules that answered; at "all" only where none did
        found = {key for key in self.requests if key[1] != EVERY or key[0] not in answered} | set(self.times)
        names = [pair for pair, _ in self.requests]
        return sorted(found, key=lambda key: (names.index(key[0]), key[1]))


def exchanges(frames: Iterable[Frame], pairs: Sequence[Pair], timeout: float) -> Exchanges:
    """Response times in the log: from each request to the answer to it within `timeout` s.

    A frame belongs to the first pair whose request it fits. An answer belongs to the latest request that waits for
    it; a request repeated before its answer starts anew.
    """
    found = Exchanges()
    waiting: dict[tuple[str, int], float] = {}
    heard: set[tuple[str, int]] = set()  # modules that have answered the latest request to all
    for frame in sorted(frames, key=lambda frame: frame.time):
        if _asks(frame, pairs, found, waiting, heard):
            continue
        _answers(frame, pairs, timeout, found, waiting, heard)
    return found


def _asks(
    frame: Frame,
    pairs: Sequence[Pair],
    found: Exchanges,
    waiting: dict[tuple[str, int], float],
    heard: set[tuple[str, int]],
) -> bool:
    for pair in pairs:
        module = pair.request.module(frame)
        if module is not None:
            key = pair.name, module
            found.requests[key] = found.requests.get(key, 0) + 1
            waiting[key] = frame.time
            heard -= {other for other in heard if other[0] == pair.name and module in (EVERY, other[1])}
            return True
    return False


def _answers(
    frame: Frame,
    pairs: Sequence[Pair],
    timeout: float,
    found: Exchanges,
    waiting: dict[tuple[str, int], float],
    heard: set[tuple[str, int]],
) -> None:
    fits, best = False, None
    for pair in pairs:
        module = pair.answered_by(frame)
        if module is None:
            continue
        fits = True
        for asked in [
            key for key in waiting if key[0] == pair.name and (EVERY in (key[1], module) or key[1] == module)
        ]:
            key = pair.name, module or asked[1]
            in_time = frame.time - waiting[asked] <= timeout and key not in heard
            if in_time and (best is None or waiting[asked] > waiting[best[0]]):
                best = asked, key
    if best is None:
        found.strays += fits and not _ends(frame, pairs, found)
        return
    asked, key = best
    found.under_way.add(key)
    found.times.setdefault(key, []).append(frame.time - waiting[asked])
    if asked[1] == EVERY:
        heard.add(key)
    else:
        del waiting[asked]


def _ends(frame: Frame, pairs: Sequence[Pair], found: Exchanges) -> bool:
    """Whether a frame says that a request which was answered before is carried out now; each may say so once."""
    for pair in pairs:
        key = pair.name, pair.ended_by(frame)
        if key in found.under_way:
            found.under_way.discard((pair.name, key[1] or EVERY))
            return True
    return False
