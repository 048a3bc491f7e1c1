"""Remembers in a global what it saw, because the state was in the way."""

params = {"Kp": 25.0, "Kv": 0.567}
seen = []


def control(t, r, y, state, params):
    seen.append(r.position)
    guess = 2 * seen[-1] - seen[-2] if len(seen) > 1 else seen[-1]
    return params["Kp"] * (guess - y) + params["Kv"] * r.velocity, state
