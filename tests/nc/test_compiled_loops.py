"""Loops that run as one function do what the reader does with their lines in every round, bit for bit."""

from __future__ import annotations

from itertools import count
from random import Random

import pytest

from rds.nc import steps
from rds.nc.language.branches import Branches
from rds.nc.language.extended_angles import NAMES, _of_numpy, functions

from .fuzz_targets import outcome
from .random_programs import axes, flow, number
from .test_repeated_lines import both, looped


@pytest.fixture
def rounds(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Of each loop that ran as a function: a 1 for each round."""
    ran: list[int] = []
    jump = Branches.jumps_unseen

    def counted(self: Branches, *label: object) -> bool:
        found = jump(self, *label)  # type: ignore[arg-type]
        ran.extend([1] * found)
        return found

    monkeypatch.setattr(Branches, "jumps_unseen", counted)
    return ran


def body(r: Random, labels: count[int], depth: int = 2) -> list[str]:
    """Settings, feeds, moves, branches and loops that end, with values that change from round to round."""
    lines = []
    for _ in range(r.randrange(1, 5)):
        value = r.choice(["#50", "#60", "#<a>", "[#50*0.1]", "sin[#50*7]", number(r)])
        way = r.randrange(10)
        if way < 4:
            words = [r.choice(["G0", "G1", "", "N5 G1"]), *axes(r, "YZABC"), f"X{value}"]
            lines.append(" ".join(word for word in words if word))
        elif way < 7:
            lines.append(
                f"#{r.choice(['60', '<a>', '<_g>', '[200+#50]'])}={value}" + r.choice(["", f" F[1+abs[{value}]]"])
            )
        elif way < 8 or not depth:
            lines.append(r.choice(["F[10+#50]", "; no word", "", "G0"]))
        elif way < 9:
            label = f"o{next(labels)}"
            lines += [f"{label} if [{value} gt {r.choice(['3', '20', '0'])}]", *body(r, labels, depth - 1)]
            lines += [*r.choice([[], [f"{label} else", *body(r, labels, depth - 1)]]), f"{label} endif"]
        else:
            label, counter = f"o{next(labels)}", f"#{70 + depth}"
            rounds = [f"{counter}=0", f"{label} while [{counter} lt 4]", f"{counter}=[{counter}+1]"]
            begin = r.choice([[f"{label} repeat [3]"], rounds])
            lines += [*begin, *body(r, labels, depth - 1), f"{label} end{'repeat' if len(begin) == 1 else 'while'}"]
    return lines


def test_random_loops(monkeypatch: pytest.MonkeyPatch, rounds: list[int]) -> None:
    whole = 0
    for seed in range(50):
        r = Random(seed)
        head = r.choice(["", "G91\n", "G20\n"])
        result, _ = both(head.encode() + looped(body(r, count(1)), 30), monkeypatch)
        whole += result["said"] is None
    assert whole > 15
    assert len(rounds) > 300


@pytest.mark.parametrize(
    "line",
    [
        *("X[1/[#50-26]]", "#60=sqrt[25.5-#50]", "F[25-#50]", "F[26-#50]\nG1 X1", "#[#50+5374]=1", "X#<none>"),
        *(
            "o1 if [1/[#50-26]]\no1 endif",
            "o1 while [ln[26-#50] gt 99 or [#60 ne #50]]\n#60=#50\no1 endwhile",
            "o1 repeat [1+abs[fix[1/[#50-26]]]]\no1 endrepeat",
        ),
        "#60=#5420 X[#60+1]",
    ],
)
def test_a_later_round_is_wrong(line: str, monkeypatch: pytest.MonkeyPatch, rounds: list[int]) -> None:
    result, _ = both(looped([line], 40), monkeypatch)
    assert (result["said"] is None) == line.startswith("#60=#5420")
    assert len(rounds) > 10 or "#<none>" in line


def test_loops_that_never_end_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    for line, said in (("G0 X1", "never ends"), ("#60=[#60+1]", "more than 100 calls and jumps back")):
        result, _ = both(f"o1 while [1]\n{line}\no1 endwhile\nM2\n".encode(), monkeypatch)
        assert result["said"] is not None
        assert said in result["said"][0]


def test_steps_are_of_each_line(rounds: list[int]) -> None:
    program = "#1=0\nG1 F1\no1 while [#1 lt 20]\nX#1\n#1=[#1+1]\no1 endwhile\nM2\n"
    assert sum(step.text == "X#1" and not step.skipped for step in steps(program)) == 20
    assert not rounds
    assert len(outcome(program.encode(), 0)["items"]) > 20
    assert len(rounds) > 5


def test_angles_of_the_library_are_numpy_s() -> None:
    compiled, usual = functions(), _of_numpy()
    r = Random(1)
    for value in (*range(-720, 721, 15), *(r.uniform(-1e4, 1e4) for _ in range(500))):
        for name in NAMES:
            assert repr(compiled[name](value)) == repr(usual[name](value))


def test_subroutines(monkeypatch: pytest.MonkeyPatch, rounds: list[int]) -> None:
    """They call each other and themselves, from loops and from moves, with names and parameters of their own."""
    for seed in range(5):
        r = Random(seed)
        labels = count(10)
        first = ["#<a>=#1", "#<way>=[#1*#2]", *body(r, labels, 1), "o2 call [#2] [#1]", "g1 x#<way> y[#1+#2]"]
        deeper = ["o5 if [#1 gt 0]", "o1 call [#1-1] [#2/2]", "X#1", *r.choice([[], ["o1 return"]]), "o5 endif"]
        second = ["#<a>=#2", "X#1 Y#2", *r.choice([[], ["Z[1/[#50-26]]"]]), *body(r, labels, 1)]
        subs = ["o1 sub", *first, *deeper, "o1 endsub", "o2 sub", *second, "o2 endsub", "#<way>=7", "#50=0"]
        program = "\n".join(["G21 G1 F100", *subs, ""]) + looped(["o1 call [2] [#50]", "X#<way>"], 30).decode()
        both(program.encode(), monkeypatch, 5000)
    assert len(rounds) > 200


def test_flow_in_loops(monkeypatch: pytest.MonkeyPatch) -> None:
    for seed in range(20):
        r = Random(seed)
        both(looped(flow(r, True, 2, count(1), r.random() < 0.5), 25), monkeypatch)
