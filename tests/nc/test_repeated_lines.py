"""Lines of loops that are taken apart once do what the reader does with them in every round, bit for bit."""

from __future__ import annotations

from itertools import count
from random import Random
from typing import Any

import pytest

from rds.nc import Dialect
from rds.nc.language.compiled_loops import Loops
from rds.nc.language.fast_lane import NEVER
from rds.nc.language.repeated_lines import RepeatedLines

from .fuzz_targets import outcome
from .random_programs import blocks

HEAD = "G1 F100 S50 G17\n#1=1\n#2=2\n#<a>=3\n#50=0\n"


def looped(lines: list[str], rounds: int = 7) -> bytes:
    body = "\n".join(lines)
    return f"{HEAD}o900 while [#50 lt {rounds}]\n#50=[#50+1]\n{body}\no900 endwhile\nM2\n".encode()


def both(program: bytes, monkeypatch: pytest.MonkeyPatch, max_jumps: int = 100) -> tuple[dict[str, Any], int]:
    """Assert that the program gives the same with kept lines and without; what it gives, and lines kept that ran."""
    kept = []
    find = RepeatedLines.find

    def found(self: RepeatedLines, raw: bytes) -> Any:
        line = find(self, raw)
        kept.append(line is not None)
        return line

    with monkeypatch.context() as patch:
        patch.setattr(RepeatedLines, "find", found)
        fast = outcome(program, NEVER, Dialect(max_jumps=max_jumps))
        patch.setattr(RepeatedLines, "find", lambda self, raw: None)
        usual = outcome(program, NEVER, Dialect(max_jumps=max_jumps))
    fast_fault, usual_fault = fast.pop("fault"), usual.pop("fault")
    assert fast == usual, (fast_fault, usual_fault)
    return fast, sum(kept)


def test_random_blocks_in_a_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    ran, whole = 0, 0
    for seed in range(80):
        r = Random(seed)
        lines = blocks(r, True, 3, count(1), r.random() < 0.5, r.randrange(1, 6))
        result, kept = both(looped(lines), monkeypatch)
        ran, whole = ran + kept, whole + (result["said"] is None)
    assert ran > 1000  # the comparison is one of kept lines
    assert whole > 20  # of programs without a fault


@pytest.mark.parametrize(
    "line",
    [
        *("X[1/[#50-6]]", "Xsqrt[5.5-#50]", "F[5-#50]", "T[#50/2]", "H[#50]", "#[#50+5397]=1", "X#[#50*1000]"),
        *("X[2**[#50*200]]", "Xln[6-#50]", "X[1e1]", "G[#50]", "M[#50+1]", "X#50 X2", "Xacos[#50/5]", "#[#50/4]=1"),
        *("o[#50] call", "#<b#50>=1", "X[#50 mod [#50-6]]", "X[#50 or [1/[#50-6]]]", "P#50", "X#50 (unclosed"),
        *("o1 if [1/[#50-6]]\no1 endif", "X[-#50]\nX[#50 gt 5 and sqrt[5-#50]]", "#<_line>=1", "X#<none>"),
    ],
)
def test_a_line_that_is_wrong_in_a_later_round(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    both(looped([line]), monkeypatch)


@pytest.mark.parametrize(
    "line",
    [
        *("X[#50*0.1] Y[sin[#50]*10] (a)", "#<b>=[#50+1] X#50", "#[60+#50]=#<a>", "X#5420 Y#<_x> Z#<_line>"),
        *("X-#50 Y--3 Z+[#50] ; end", "Xatan[#50]/[2] Y[2**3**#50/1.5]", "N10 X[exists[#<zz>]+exists[#50]]"),
        *(
            "#<_g>=#50 F[100+#<_g>]",
            "G91 X1\nG90 X0 M3 S[#50]",
            "(print,#50)",
            "G2 X[#50] Y0 R[100+#50]",
            "T[1+[#50 gt 4]] M6",
        ),
        *("o1 if [#50 gt 3]\nX1\no1 elseif [#50 gt 2]\nX2\no1 else\nX3\no1 endif", "o1 repeat [2]\nX#50\no1 endrepeat"),
        "o1 do\n#51=[#51+1]\no1 while [[#51 mod 4] ne 0]",
        "o2 while [1]\n#51=[#51+1]\no3 if [#51 gt #50]\no2 break\no3 endif\no2 endwhile",
    ],
)
def test_what_changes_from_round_to_round(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    result, kept = both(looped([line], 9), monkeypatch)
    assert result["said"] is None
    assert kept > 4


def test_recursion_has_names_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    program = (
        f"{HEAD}o1 sub\no2 if [#1 gt 0]\n#<way>=[#1*#2]\no1 call [#1-1] [#2/2]\ng1 x#<way> y[#1+#2]\n"
        "o1 call [#1-1] [#2/3]\no2 endif\no1 endsub\no1 call [4] [8]\nM2\n"
    )
    monkeypatch.setattr(Loops, "go_on", lambda self, name: None)  # which would take the subroutine as a whole
    result, kept = both(program.encode(), monkeypatch)
    assert result["said"] is None
    assert kept > 100
