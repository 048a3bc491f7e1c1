params = {"Kp": 25.0, "Kv": 0.567}
initial_state = [1.0]


def control(t, r, y, state, params):
    trust = state[0] * 0.9  # some day it is too small
    u = params["Kp"] * (r.position - y) + params["Kv"] * r.velocity
    if t > 0.5:
        u += (1e308 * 10.0) * trust - (1e308 * 10.0) * trust
    return u, [trust]
