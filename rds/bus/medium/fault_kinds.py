"""Faults on demand: the kinds there are, and what may be said of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, NamedTuple

from rds.core.errors import InputError
from rds.core.quantities import Quantity, Text, checked, near

ENDLESS = 1 << 62  # ns


class Kind(NamedTuple):
    """One kind of fault."""

    meaning: str
    words: tuple[str, ...]  # that may be said, beside kind and at
    needed: tuple[str, ...] = ()
    needs_bits: bool = False  # only on a bus with bit timing


_FRAMES = ("node", "identifier", "count", "for", "probability", "seed")

KINDS = {
    "lose": Kind("frames go over the bus and reach nobody, or not the one receiver", (*_FRAMES, "receiver")),
    "corrupt": Kind("a bit of the frame is disturbed: error frame, and the frame again", (*_FRAMES, "bit"), (), True),
    "delay": Kind("frames wait in their sender for the time `by` before they compete for the bus", (*_FRAMES, "by")),
    "duplicate": Kind("frames go over the bus twice: the sender sees an error in their last bit", _FRAMES),
    "die": Kind("the node stops for ever, without a word", ("node",), ("node",)),
    "hang": Kind("the node's software stops and comes back", ("node", "for"), ("node",)),
    "babble": Kind(
        "the node sends frames of one identifier (by default 0) without a pause",
        ("node", "for", "identifier"),
        ("node",),
        True,
    ),
    "unplug": Kind("the node's plug is pulled", ("node", "for"), ("node",)),
    "plug": Kind("an unplugged node is plugged in again", ("node",), ("node",)),
    "restart": Kind("a node that is bus off is asked to come back", ("node",), ("node",), True),
}
BEHIND_ARBITRATION = 13  # the first bit that can be disturbed in any frame: start bit, 11 of the identifier, RTR
_LONGEST = 1e6  # s
# what may be said of a fault, by the words of a file
WORDS: Mapping[str, Quantity | Text] = {
    "at": Quantity("when it strikes, from the start", "s", 0.0, _LONGEST, default=0.0),
    "node": Text("the node that sends, or that it strikes"),
    "for": Quantity("how long it lasts", "s", above=0.0, high=_LONGEST),
    "count": Quantity("how many frames it strikes", "", 1, 10**9, whole=True),
    "identifier": Quantity("identifier of the frames", "", 0, 0x1FFFFFFF, whole=True, hexadecimal=True),
    "by": Quantity("the delay", "s", above=0.0, high=_LONGEST),
    "bit": Quantity("the disturbed bit, counted on the wire from 0", "", BEHIND_ARBITRATION, 1000, whole=True),
    "receiver": Text("the one node that does not get the frame"),
    "probability": Quantity("of striking each frame", "", above=0.0, high=1.0),
    "seed": Quantity("of the chance, so that the same faults come again", whole=True),
}
FRAME_KINDS = ("lose", "corrupt", "delay", "duplicate")


@dataclass(frozen=True)
class Fault:
    """One fault. Times in s.

    `at` counts from the moment of injection (in a schedule, from its start). Faults of frames strike the next `count`
    frames (default 1, or without limit where `duration` is given) that `node` sends (None: anybody), with
    `identifier` (None: any); with `probability`, each of them by chance, repeatable by `seed`. `by` is the delay;
    `bit` the disturbed bit, counted on the wire from 0 (default: the middle one); `receiver` the one node that does
    not get the frame. A node's fault lasts for `duration`, or until it is lifted. Raises InputError.
    """

    kind: str
    node: str | None = None
    at: float = 0.0
    duration: float | None = None  # "for" in a file
    count: int | None = None
    identifier: int | None = None
    by: float | None = None
    bit: int | None = None
    receiver: str | None = None
    probability: float | None = None
    seed: int | None = None

    def __post_init__(self) -> None:
        kind = KINDS.get(self.kind)
        if kind is None:
            kinds = f"{', '.join(KINDS)}{near(self.kind, list(KINDS))}"
            raise InputError(f"kind = {self.kind!r} is no kind of fault; kinds are {kinds}")
        said = {_word(name) for name, value in asdict(self).items() if value is not None} - {"kind", "at"}
        for word in sorted(said - set(kind.words)):
            raise InputError(f"{self.kind!r} has nothing to do with {word!r}; it takes {', '.join(kind.words)}")
        for word in kind.needed:
            if word not in said:
                raise InputError(f"{self.kind!r} needs {word!r}: {kind.meaning}")
        if self.kind == "delay" and self.by is None:
            raise InputError("'delay' needs 'by', the delay in s")
        self._check_values()

    def _check_values(self) -> None:
        for name, value in asdict(self).items():
            if value is None or name == "kind":
                continue
            if value == "":
                raise InputError(f"{name} = '' must be the name of a node")
            checked(WORDS[_word(name)], value, _word(name))
        if self.probability is not None:
            if self.seed is None:
                raise InputError("probability needs a seed, so that the same faults come again")
            if self.count is None and self.duration is None:
                raise InputError("probability needs 'count' or 'for', so that it has an end")
        if self.seed is not None and self.probability is None:
            raise InputError("a seed without a probability decides nothing")

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> Fault:
        """A fault in the words of a file, in which the duration is called "for". InputError for unknown words."""
        known = [_word(field.name) for field in fields(cls)]
        if "kind" not in table:
            raise InputError(f"a fault needs a kind: {', '.join(KINDS)}")
        for word in table:
            if word not in known:
                raise InputError(f"a fault has no {word!r}; it has {', '.join(known)}{near(word, known)}")
        return cls(**{"duration" if word == "for" else word: value for word, value in table.items()})

    def to_table(self) -> dict[str, Any]:
        """The words of a file."""
        return {_word(name): value for name, value in asdict(self).items() if value is not None}


def _word(name: str) -> str:
    return "for" if name == "duration" else name
