"""A design as curves and numbers: what follows the pole that is being dragged."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rds.identification.robustness.figures import MARGINS
from rds.identification.robustness.tracking_design import LoopDraws, StepResponse, TrackingDesign
from rds.panels.design.splane import series
from rds.results.html import notes_list, table

ACCENT, ASIDE, QUIET = "var(--rds-accent)", "var(--rds-warning)", "var(--rds-quiet)"  # the page's own colours
_SHORT = {
    "gain_margin": "gain margin",
    "modulus_margin": "least distance to −1",
    "pole_radius": "largest |z|",
}
_CURVE = 400  # points of a response that are drawn


def charts(design: TrackingDesign, size: float) -> list[Mapping[str, Any]]:
    """Step response and its voltage, Bode's two, Nyquist's; `size` is the step in the axis's unit."""
    w, loop = design.loop()
    return [
        *_steps(design.step(size), design.step(size, friction=False), design.axis.unit),
        *_bode(w, loop),
        _nyquist(loop),
        _error(design),
    ]


def _steps(real: StepResponse, ideal: StepResponse, unit: str) -> list[Mapping[str, Any]]:
    every = max(1, len(real.time) // _CURVE)
    t = real.time[::every]
    goal = series([0.0, t[-1]], [real.size, real.size], "", QUIET, dash="2 3")
    return [
        {
            "title": "Step",
            "x_label": "time [s]",
            "y_label": f"position [{unit}]",
            "series": [
                goal,
                series(t, ideal.position[::every], "no friction", ASIDE, dash="6 3"),
                series(t, real.position[::every], "axis", ACCENT),
            ],
        },
        {
            "title": "Voltage of the step",
            "x_label": "time [s]",
            "y_label": "voltage [V]",
            "series": [series(t, real.voltage[::every], "", ACCENT)],
        },
    ]


def _bode(w: np.ndarray, loop: np.ndarray) -> list[Mapping[str, Any]]:
    phase = np.degrees(np.unwrap(np.angle(loop)))
    phase -= 360.0 * np.round((phase[0] + 180.0) / 360.0)  # it begins at -90 or -180
    ends = [w[0], w[-1]]
    return [
        {
            "title": "Loop, gain",
            "x_label": "frequency [rad/s]",
            "y_label": "gain [dB]",
            "log": True,
            "series": [
                series(ends, [0, 0], "", QUIET, dash="2 3"),
                series(w, 20.0 * np.log10(np.abs(loop)), "", ACCENT),
            ],
        },
        {
            "title": "Loop, phase",
            "x_label": "frequency [rad/s]",
            "y_label": "phase [°]",
            "log": True,
            "y_step": 90,
            "series": [series(ends, [-180, -180], "", QUIET, dash="2 3"), series(w, phase, "", ACCENT)],
        },
    ]


def _nyquist(loop: np.ndarray) -> Mapping[str, Any]:
    angle = np.linspace(0.0, 2.0 * np.pi, 60)
    near = np.abs(loop) < 20.0
    return {
        "title": "Nyquist",
        "x_label": "real part",
        "y_label": "imaginary part",
        "equal": True,
        "x_range": [-2.5, 1.0],
        "y_range": [-1.5, 1.0],
        "series": [
            series(np.cos(angle), np.sin(angle), "", QUIET, dash="2 3", width=1),
            series([-1.0], [0.0], "−1", ASIDE, dots=True),
            series(np.where(near, loop.real, np.nan), np.where(near, loop.imag, np.nan), "loop", ACCENT),
        ],
    }


def _error(design: TrackingDesign) -> Mapping[str, Any]:
    """|S| = 1/|1 + L|: how much of a disturbance at the output remains."""
    w, loop = design.loop()
    return {
        "title": "Sensitivity |1/(1 + L)|",
        "x_label": "frequency [rad/s]",
        "y_label": "gain [dB]",
        "log": True,
        "series": [
            series([w[0], w[-1]], [0, 0], "", QUIET, dash="2 3"),
            series(w, -20.0 * np.log10(np.abs(1.0 + loop)), "", ACCENT),
        ],
    }


def key_numbers(design: TrackingDesign, size: float, cloud: LoopDraws | None) -> str:
    """What a student looks at while a pole moves, as HTML; beside the margins their worst over the cloud."""
    margins, step, worst = design.margins, design.step(size), cloud.worst if cloud is not None else {}
    rows = [
        ["natural frequency", f"{design.frequency:.4g} rad/s", ""],
        ["damping ratio ζ", f"{design.damping:.3g}", ""],
        ["g₁", f"{design.gains['g1']:.4g} 1/s²", ""],
        ["g₂", f"{design.gains['g2']:.4g} 1/s", ""],
    ]
    for name, (meaning, unit, _) in MARGINS.items():
        said = "" if unit == "1" else f" {unit}"
        of_cloud = f"{worst[name]:.3g}{said}" if name in worst else ""
        rows.append([_SHORT.get(name, meaning), f"{margins[name]:.3g}{said}", of_cloud])
    settled = "not yet" if step.settling is None else f"{step.settling:.3g} s"
    rows += [["settled within 2 %", settled, ""], ["overshoot", f"{step.overshoot:.3g} %", ""]]
    rows += [["left at the end", f"{step.remaining:.3g} {design.axis.unit}", ""]]
    rows += [["largest voltage", f"{float(np.abs(step.voltage).max()):.3g} V", ""]]
    return table(["", "now", "worst"], rows)


def details(design: TrackingDesign, cloud: LoopDraws | None) -> str:
    """Poles, the observer's numbers, and what the design does not know of."""
    gains = design.gains
    rows = [["poles", f"{_shown(design)} 1/s"], ["observer pole", f"{design.observer_pole:.4g} 1/s"]]
    for name, unit in (("L", " 1/s"), ("F", ""), ("G", " 1/s"), ("H", f" ({design.axis.unit}/s)/V")):
        rows.append([f"observer's {name}", f"{gains[name]:.5g}{unit}"])
    return table(["", ""], rows) + notes_list(_notes(design, cloud))


def _shown(design: TrackingDesign) -> str:
    pole = design.poles[0]
    if pole.imag:
        return f"{pole.real:.4g} ± {abs(pole.imag):.4g} i"
    return ", ".join(f"{each.real:.4g}" for each in design.poles)


def _notes(design: TrackingDesign, cloud: LoopDraws | None) -> list[str]:
    said = [f"for {design.axis.name}: τ = {design.axis.tau:.4g} s, K = {design.axis.K:.4g} ({design.axis.unit}/s)/V"]
    if cloud is not None:
        count = len(cloud.margins)
        lost = f"✖ unstable for {cloud.unstable} of {count}" if cloud.unstable else f"✔ stable for all {count}"
        said.append(f"{lost} axes drawn from the ranges; worst: among the stable ones")
    said += [f"the fit warned: {sentence}" for sentence in design.axis.doubts]
    return [*said, *(f"the law does not know of {sentence}" for sentence in design.axis.left_out)]
