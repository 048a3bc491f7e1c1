"""The parts of the planner by themselves: limits, segments, profile, certificate, and the planner without numba."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.interpolators.motion import Limits, plan
from rds.interpolators.motion.certificate import Certificate
from rds.interpolators.motion.deviation import deviation
from rds.interpolators.motion.profile import hold_tops, phases_of, speeds
from rds.interpolators.motion.segments import BLEND, SEGMENT, arc, chain, line, point_at
from rds.machines import load_machine

from .chains import MACHINES, planned, polygon

FOLDER = Path(__file__).parent
T = 1e-3


@pytest.mark.parametrize("name", ["mini-cnc", "mrmt-oacs"])
def test_the_machines_can_follow_their_limits(name: str) -> None:
    """v + τ a + friction is within what the converter gives, by each axis's model, both ways, with 3 % to spare."""
    machine = load_machine(name)
    limits = Limits.of(machine)
    assert limits.present.any()
    for axis, v, a, j in zip("XYZABC", limits.velocity, limits.acceleration, limits.jerk, strict=True):
        if v > 0.0:
            model = machine.axis(axis).model
            friction = max(model["friction_plus"], -model["friction_minus"])
            assert v + model["tau"] * a + friction < 0.97 * model["K"] * machine.converter.range
            assert v / a > a / j  # the acceleration is built up while it speeds up


def test_limits_that_cannot_be_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no axis 'Q'"):
        Limits.from_axes({"Q": (1, 1, 1)})
    with pytest.raises(InputError, match=r"axis X: .* must each be more than 0"):
        Limits.from_axes({"X": (1, 0, 1)})
    text = "sample_period = 0.001\n[axis.X]\nnode = 2\ntravel = [-1.0, 1.0]\nresolution = 0.001\n"
    for table, message in {
        "": "axis X has no limits",
        "[axis.X.limits]\nvelocity = 1.0\nacceleration = 1.0": "jerk is missing; give it in axis unit/s³",
        "[axis.X.limits]\nvelocity = 1.0\nacceleration = -1.0\njerk = 1.0": "acceleration = -1.0 must be from 1e-09",
        "[axis.X.limits]\nvelocity = 1e-300\nacceleration = 1.0\njerk = 1.0": "velocity = 1e-300 must be from 1e-09",
        "[axis.X.limits]\nspeed = 1.0": "velocity is missing",
    }.items():
        (tmp_path / "m.toml").write_text(text + table)
        with pytest.raises(InputError, match=message):
            Limits.of(load_machine(str(tmp_path / "m.toml")))


@given(share=st.floats(0.0, 1.0), turns=st.integers(0, 2), clockwise=st.booleans(), plane=st.sampled_from((0, 1, 2)))
def test_points_of_a_helix(share: float, turns: int, clockwise: bool, plane: int) -> None:
    """In the plane on the circle, along the normal in proportion, from start to end; `deviation` agrees."""
    first, second, normal = ((0, 1, 2), (2, 0, 1), (1, 2, 0))[plane]
    start, end, centre = np.zeros(6), np.zeros(6), np.zeros(3)
    centre[first], end[second], end[first], end[normal], end[4] = 3.0, 3.0, 3.0, 2.0, 10.0
    helix = arc(start, end, centre, 1.0, clockwise=clockwise, turns=turns, plane=plane)
    assert abs(helix["sweep"][0]) == pytest.approx(2 * pi * turns + (0.5 * pi if clockwise else 1.5 * pi))
    point = point_at(helix[0], share * helix["length"][0])
    assert np.hypot(point[first] - 3.0, point[second]) == pytest.approx(3.0, abs=1e-12)
    assert point[normal] == pytest.approx(2.0 * share) and point[4] == pytest.approx(10.0 * share)
    off = point[None].copy()
    assert deviation(off, helix, np.array([0]), np.array([share]))[0] < 1e-9
    off[0, first] += 0.01 * (point[first] - 3.0) / 3.0
    off[0, second] += 0.01 * point[second] / 3.0
    assert deviation(off, helix, np.array([0]), np.array([share]))[0] == pytest.approx(0.01, rel=0.02)


def test_the_senses_of_arcs() -> None:
    quarter = arc((1, 0), (0, 1), (0, 0), 1.0)["sweep"][0]
    assert quarter == pytest.approx(pi / 2)
    assert arc((1, 0), (0, 1), (0, 0), 1.0, clockwise=True)["sweep"][0] == pytest.approx(-1.5 * pi)
    assert arc((1, 0), (1, 0), (0, 0), 1.0, clockwise=True)["sweep"][0] == pytest.approx(-2 * pi)
    assert arc((1, 0), (1, 0), (0, 0), 1.0, turns=1)["sweep"][0] == pytest.approx(4 * pi)
    zx = arc((0, 0, 1), (1, 0, 0), (0, 0, 0), 1.0, plane=1)  # from Z to X is counter-clockwise about Y
    assert zx["sweep"][0] == pytest.approx(pi / 2)
    with pytest.raises(InputError, match="centre"):
        arc((0, 0), (1, 0), (0, 0), 1.0)


@pytest.mark.parametrize("clockwise", [False, True])
def test_an_arc_that_ends_beside_its_start_is_a_full_circle_however_it_is_rounded(clockwise: bool) -> None:
    """Off the circle by what programs may be; an angle of 1e-16 rad would be a jump of that in no time."""
    for degrees in range(0, 360, 7):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        row = arc((3 + 7 * c, 2 + 7 * s), (3 + 7.001 * c, 2 + 7.001 * s), (3, 2), 5.0, clockwise=clockwise)[0]
        assert row["sweep"] == pytest.approx(-2 * pi if clockwise else 2 * pi)
        assert row["length"] == pytest.approx(14 * pi)


@settings(max_examples=80, deadline=None)
@given(
    table=st.lists(
        st.tuples(st.floats(1e-4, 5.0), st.floats(0.05, 20.0), st.floats(1.0, 200.0)), min_size=1, max_size=12
    ),
    tau=st.sampled_from((0.01, 0.1)),
)
@example(table=[(0.3125, 4.0, 25.0), (0.125, 3.875, 1.0), (1.5, 4.0, 6.0)], tau=0.1)  # two tops lowered to one level
def test_profiles_keep_their_envelope_and_hold_their_tops(table: list[tuple[float, ...]], tau: float) -> None:
    length, cap, push = np.array(table).T
    edges = np.concatenate(([0.0], np.cumsum(length)))
    phases = hold_tops(phases_of(edges, cap, push, speeds(edges, cap, push, 0.0, 0.0)), tau)
    assert phases[:, 0].sum() == pytest.approx(edges[-1], rel=1e-9)
    assert phases[0, 1] == 0.0 and phases[-1, 2] == 0.0
    assert phases[1:, 1] == pytest.approx(phases[:-1, 2], rel=1e-6, abs=1e-9)  # speed is continuous
    ends = np.cumsum(phases[:, 0])
    inside = np.clip(np.searchsorted(edges, ends - 0.5 * phases[:, 0], side="right") - 1, 0, len(cap) - 1)
    whole = np.abs(np.searchsorted(edges, ends - phases[:, 0] + 1e-9) - np.searchsorted(edges, ends - 1e-9)) == 0
    assert (phases[whole, 1:].max(axis=1, initial=0.0) <= cap[inside[whole]] * (1 + 1e-9)).all()
    rate = np.abs(phases[:, 2] ** 2 - phases[:, 1] ** 2) / (2 * phases[:, 0])
    assert (rate[whole] <= push[inside[whole]] * (1 + 1e-6)).all()
    # no slowing down within τ after speeding up
    lasts = 2 * phases[:, 0] / (phases[:, 1] + phases[:, 2])
    change = np.sign(np.round(phases[:, 2] - phases[:, 1], 9))
    since = np.inf
    for seconds, sign in zip(lasts, change, strict=True):
        if sign < 0:
            assert since >= tau * (1 - 1e-6)
        since = 0.0 if sign > 0 else since + seconds if sign == 0 else np.inf


def spoiled(kind: str) -> Certificate:
    """The certificate of samples of which one was changed."""
    (block,) = plan([polygon([(0, 0), (3, 0), (3, 3)], 10.0)], MACHINES[0], T)
    position = block.position.copy()
    middle = int(np.argmax(block.line == 2)) + 100
    if kind == "deviation":
        position[:, 0] += 1e-3 * np.sin(np.pi * np.arange(len(position)) / len(position)) ** 4
    else:
        position[middle, 1] += {"jerk": 3e-5, "acceleration": 3e-4, "velocity": 1e-2}[kind]
    certificate = Certificate(MACHINES[0])
    certificate.add(replace(block, position=position))
    certificate.finish()
    return certificate


@pytest.mark.parametrize("kind", ["velocity", "acceleration", "jerk", "deviation"])
def test_the_certificate_names_the_line_of_a_violation(kind: str) -> None:
    certificate = spoiled(kind)
    assert not certificate.ok
    found = [violation for violation in certificate.violations if violation.kind == kind]
    assert found and found[-1].line == 2
    assert str(found[-1]).startswith(f"line 2: {kind}")
    plain = json.loads(json.dumps(certificate.to_dict()))
    assert not plain["ok"] and plain["violation_count"] == certificate.count
    assert {violation["kind"] for violation in plain["violations"]} >= {kind}


def test_a_step_at_the_end_is_a_violation_too() -> None:
    (block,) = plan([line((0, 0), (3, 0), 10.0)], MACHINES[0], T)
    certificate = Certificate(MACHINES[0])
    certificate.add(
        replace(block, **{name: getattr(block, name)[:150] for name in ("position", "line", "segment", "distance")})
    )
    assert certificate.ok
    certificate.finish()
    assert {violation.kind for violation in certificate.violations} == {"acceleration", "jerk"}


def test_the_picture_of_a_certificate(tmp_path: Path) -> None:
    _, certificate, _ = planned(polygon([(0, 0), (10, 0), (10, 10)] * 40, 10.0, mode=BLEND))
    trace = certificate.trace()
    assert len(trace) <= 4100 and (np.diff(trace[:, 0]) > 0).all()
    assert trace[:, 1:19].max() == pytest.approx(max(w.share for (_, axis), w in certificate.worst.items() if axis))
    figure = certificate.plot(tmp_path / "certificate.png")
    assert (tmp_path / "certificate.png").stat().st_size > 10_000
    assert [axes.get_ylabel() for axes in figure.axes][:1] == ["velocity [% of limit]"]


PROGRAM = """
import sys
if {blocked}:
    sys.modules["numba"] = None
sys.path.insert(0, {folder!r})
import numpy as np
from rds.interpolators.motion import Limits, plan
from rds.core.compiling import COMPILED
from rds.interpolators.motion.segments import BLEND, arc, chain, line
assert COMPILED != {blocked}
limits = Limits.from_axes({{"X": (13, 200, 1e4), "Y": (13, 200, 1e4), "Z": (11, 150, 7500)}})
path = chain(line((0, 0), (2, 0), 10.0, mode=BLEND), line((2, 0), (2, 2), 10.0, mode=BLEND),
             arc((2, 2), (2, 2, 0.5), (1, 2), 8.0), line((2, 2, 0.5), (0, 0), 1.0, rapid=True))
motion = np.concatenate([block.position for block in plan([path], limits, 1e-3)])
np.save(sys.argv[1], motion)
"""


def test_without_numba_the_samples_are_the_same(tmp_path: Path) -> None:
    for blocked in (True, False):
        program = PROGRAM.format(blocked=blocked, folder=str(FOLDER))
        subprocess.run([sys.executable, "-c", program, str(tmp_path / f"{blocked}.npy")], check=True, timeout=120)
    plain, compiled = (np.load(tmp_path / f"{blocked}.npy") for blocked in (True, False))
    assert plain.shape == compiled.shape
    assert np.abs(plain - compiled).max() < 1e-12  # mm


def test_memory_does_not_grow_with_the_path() -> None:
    """What the planner keeps is bounded: a path of 50,000 lines, made and planned portion by portion."""
    import tracemalloc

    def portions(count: int):  # type: ignore[no-untyped-def]
        for k in range(count):
            x = 0.05 * (1000 * k + np.arange(1001))
            path = np.zeros(1000, SEGMENT)
            path["start"][:, 0], path["end"][:, 0] = x[:-1], x[1:]
            path["start"][:, 1], path["end"][:, 1] = np.sin(x[:-1]), np.sin(x[1:])
            path["length"] = np.linalg.norm(path["end"] - path["start"], axis=1)
            path["plane"], path["mode"], path["rate"], path["tolerance"] = -1, BLEND, 13.0, 0.02
            yield path

    def peak(count: int) -> int:
        tracemalloc.start()
        for _ in plan(portions(count), MACHINES[0], 0.01):
            pass
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    peak(5)
    peak(2)
    assert peak(50) < 1.3 * peak(10)


def test_chains_of_nothing() -> None:
    assert len(chain()) == 0
