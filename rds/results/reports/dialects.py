"""Which frames are requests and answers in the dialects that modules speak.

`oacs`: tables 6 and 7 of the thesis on the open architecture control system. Its general call has the identifier 0x01
in table 6 and in its code, 0x00 in table 5 and in its text; 0x01 is taken, for 0x00 is where the modules answer. Its
data download, to one module, begins with 2 like the second general call (its CANbus class, appendix H). Our modules
answer it by ISO 15765-2, whose first frame counts here (docs/oacs.md).
`rds`: command and answer of this project's cyclic exchange. `sdo`: service data of CANopen (CiA 301).
"""

from __future__ import annotations

from rds.core.errors import InputError
from rds.results.reports.pairing import Pair, parse_pairs

DIALECTS = {
    "oacs": (
        "general call: 001#01 -> 000#01MM; type call: 001#02 -> 000#02MM; data download: M#02 -> 000#02MM | 120+M#10; "
        "move start: M#0301 -> 000#04MM00 then 000#04MM00....; move stop: M#0300 -> 000#04MM03; "
        "move to a point: M#0303 -> 000#04MM04 then 000#04MM04...."
    ),
    "rds": "cycle: 010# -> 020+M#..........00; dry run: 011# -> 020+M#..........00; call: 013# -> 020+M#..........01",
    "sdo": "service data: 600+M# -> 580+M#",
}

# A start is acknowledged when the move has been carried out; the request's fourth byte is its direction (table 6). Our
# modules say at once that they have accepted it (fifth byte 1), and at the end that it is carried out (0).
# A command to a point (ours) has no direction, and numbers of its own.
_CARRIED_OUT = "000#04MM00..00 | 000#04MM00..$"
OACS_MOVES = (
    f"cw: M#0301..01 -> {_CARRIED_OUT}; ccw: M#0301..00 -> {_CARRIED_OUT}; to a point: M#0303 -> 000#04MM04..00"
)


def pairs_from(dialect: str, pairs: str | None) -> list[Pair]:
    """`pairs` as given, or those of the dialect; InputError for an unknown dialect or a pair that is none."""
    if pairs is not None:
        return parse_pairs(pairs)
    if dialect not in DIALECTS:
        raise InputError(
            f"there is no dialect {dialect!r}; known are {', '.join(DIALECTS)}; or give your own pairs, as in "
            f"{DIALECTS['sdo']!r}"
        )
    return parse_pairs(DIALECTS[dialect])
