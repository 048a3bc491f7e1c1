"""Cross-coupled control of X and Y: each axis follows its reference, and both together keep to the contour.

Koren, "Cross-Coupled Biaxial Computer Control for Manufacturing Systems", Trans. ASME, J. of Dynamic Systems,
Measurement and Control 102 (1980) 265-272; the gains along the contour are variable, and its curvature counts, so
that lines, circles and all between are one case. Run it with examples/contour.toml.
"""

import numpy as np

params = {
    "Kp": 25.0,  # 1/s, position gain of each axis
    "W": 60.0,  # 1/s, gain of the contour error; 0 leaves two independent axes
    "Wi": 600.0,  # 1/s², of its integral: friction costs a steady contour error without it
    "K": [1.764, 1.882],  # (mm/s)/V, table 1
    "tau": [9.943e-3, 1.044e-2],  # s
    "T": 0.001,  # s, the experiment's sample period
}

initial_state = 0.0  # integral of the contour error, mm s


def control(t, r, y, state, params):
    error = r.position - y
    wanted = r.velocity + params["Kp"] * error  # mm/s
    speed = np.hypot(*r.velocity)
    if speed > 1e-6:
        along = r.velocity / speed
        across = np.array([-along[1], along[0]])
        curvature = (r.velocity[0] * r.acceleration[1] - r.velocity[1] * r.acceleration[0]) / speed**3  # 1/mm
        contour = error @ across + 0.5 * curvature * (error @ along) ** 2
        state = state + params["T"] * contour
        wanted = wanted + (params["W"] * contour + params["Wi"] * state) * across
    return (wanted + np.array(params["tau"]) * r.acceleration) / np.array(params["K"]), state
