"""Fuzzing guided by coverage, with atheris (pip install atheris; Linux, CPython 3.11 to 3.13):

    python -m fuzz program|tool_table|parameter_file FOLDER [libFuzzer's options, for example -max_total_time=600]

in tests/nc. FOLDER keeps the inputs that reach new code. What it stops at it writes to a file `crash-...`; once mended,
that becomes a file of fuzz_cases/, named after the target and what it showed.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["rds.nc"]):
    from fuzz_targets import TARGETS

WORDS = [
    *("g0", "g1", "g2", "g3", "g4", "g17", "g18", "g19", "g20", "g21", "g28", "g40", "g41", "g42.1", "g43", "g43.1"),
    *("g49", "g53", "g54", "g59.3", "g61", "g64", "g80", "g90", "g91", "g90.1", "g92", "g93", "g94", "g95", "g10 l2"),
    *("x1", "y-2.5", "z.5", "a90", "i1", "j-1", "k2", "r5", "f100", "s100", "t1", "d1", "h2", "p1", "q.1", "l20"),
    *(
        "m0",
        "m2",
        "m3",
        "m6",
        "m8",
        "m30",
        "n10",
        "%",
        "/",
        "(msg, a)",
        "(print, #<a>)",
        "(",
        ")",
        ";",
        "gr100",
        "p001",
        "\\x0a",
    ),
    *("#1=", "#<a>=", "#<_b>", "[", "]", "1+", "2**", " mod ", " and ", " eq ", "sin[", "atan[1]/[", "exists[#<a>]"),
    *("o1 sub", "o1 endsub", "o1 call", "o1 return", "o<a> call [1]", "o2 if [", "o2 else", "o2 elseif [", "o2 endif"),
    *(
        "o3 while [",
        "o3 endwhile",
        "o3 do",
        "o4 repeat [",
        "o4 endrepeat",
        "o3 break",
        "o3 continue",
        "#5420",
        "g42 d2",
    ),
]


def main() -> None:
    target, *options = sys.argv[1:]
    with tempfile.NamedTemporaryFile("w", suffix=".dict") as words:
        words.write("\n".join('"' + word.replace('"', '\\"') + '"' for word in WORDS))
        words.flush()
        Path(options[0]).mkdir(parents=True, exist_ok=True)
        cases = Path(__file__).parent
        seeds = [str(folder) for folder in (cases / "fuzz_cases", cases / "programs") if folder.is_dir()]
        options += [*seeds, f"-dict={words.name}", "-timeout=10", "-rss_limit_mb=4096"]
        atheris.Setup([sys.argv[0], *options], TARGETS[target])
        atheris.Fuzz()


if __name__ == "__main__":
    main()
