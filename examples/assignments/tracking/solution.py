"""State feedback with feedforward, a reduced-order velocity observer and friction compensation, for the X axis."""

from math import exp, tanh

tau, K = 9.943e-3, 1.764  # s, (mm/s)/V
friction = (0.539, -0.222)  # mm/s: forward, backward
T = 0.001  # s
POLE = -320.0  # 1/s, of the observer

# the axis over one sample, with the voltage held: x+ = x + a12 v + b1 u, v+ = a22 v + b2 u
a22 = exp(-T / tau)
a12 = tau * (1.0 - a22)
b1, b2 = K * (T - a12), K * (1.0 - a22)
F = exp(POLE * T)
L = (a22 - F) / a12

params = {
    "g1": 1600.0,  # 1/s²: poles at -32 ± 24i
    "g2": 64.0 - 1.0 / tau,  # 1/s
    "tau": tau,
    "K": K,
    "L": L,
    "F": F,
    "G": (F - 1.0) * L,
    "H": b2 - L * b1,
    "middle": (friction[0] + friction[1]) / 2.0,
    "half": (friction[0] - friction[1]) / 2.0,
    "slow": 0.2,  # mm/s: below this speed friction is compensated in part
    "limit": 10.0,  # V
}

initial_state = [0.0, False]  # the observer's z (mm/s), whether a sample was taken


def control(t, r, y, state, params):
    z, started = state
    if not started:
        z = -params["L"] * y  # at rest, wherever the axis stands
    velocity = params["L"] * y + z
    wanted = r.acceleration + params["g1"] * (r.position - y) + params["g2"] * (r.velocity - velocity)
    linear = (params["tau"] * wanted + r.velocity) / params["K"]
    share = tanh(r.velocity / params["slow"])
    lost = params["half"] * share + params["middle"] * share * share
    u = linear + lost / params["K"]
    u = min(max(u, -params["limit"]), params["limit"])
    moving = u - lost / params["K"]  # what is left for the axis without friction
    return u, [params["F"] * z + params["G"] * y + params["H"] * moving, True]
