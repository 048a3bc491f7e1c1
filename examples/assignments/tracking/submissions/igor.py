params = {"Kp": 30.0, "Kv": 0.567}
initial_state = [0.0]


def control(t, r, y, state, params):
    u = state[0]
    wanted = params["Kp"] * (r.position - y) + params["Kv"] * r.velocity
    while u != wanted:  # let it converge
        u += 0.5 * (wanted - u) + 1e-3
    return u, [u]
