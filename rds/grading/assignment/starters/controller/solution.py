"""Proportional control with velocity feedforward."""

params = {"Kp": 30.0, "Kv": 0.567}


def control(t, r, y, state, params):
    return params["Kp"] * (r.position - y) + params["Kv"] * r.velocity, state
