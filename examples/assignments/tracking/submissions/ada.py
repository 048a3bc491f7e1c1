"""PD with a filtered derivative; feedforward of velocity, acceleration and friction. Gains by trial in simulation."""

import math

params = {
    "Kp": 30.0,  # V/mm
    "Kd": 0.3,  # V/(mm/s)
    "Kv": 1 / 1.764,  # V/(mm/s)
    "Ka": 9.943e-3 / 1.764,  # V/(mm/s²)
    "forward": 0.539 / 1.764,  # V, friction
    "backward": 0.222 / 1.764,
    "filter": 0.004,  # s
    "T": 0.001,
}

initial_state = [0.0, 0.0, 0]  # last error, its filtered derivative, samples so far


def friction(v, p):
    if v >= 0:
        return p["forward"] * math.tanh(v / 0.2)
    return p["backward"] * math.tanh(v / 0.2)


def control(t, r, y, state, params):
    last, slope, n = state
    e = r.position - y
    if n == 0:
        last = e
    a = params["T"] / (params["filter"] + params["T"])
    slope += a * ((e - last) / params["T"] - slope)
    u = params["Kp"] * e + params["Kd"] * slope
    u += params["Kv"] * r.velocity + params["Ka"] * r.acceleration + friction(r.velocity, params)
    return u, [e, slope, n + 1]
