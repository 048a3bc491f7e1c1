# differences are good enough
params = {"Kp": 25.0, "Kd": 0.2, "Kv": 0.567, "T": 0.001}
initial_state = [0.0]


def observer_gains(tau, K, pole, T):
    return [-1 / tau - pole, pole, pole * (-1 / tau - pole), K / tau]  # as printed in the paper


def estimated_velocity(y, u, tau, K, pole, T):
    return [0.0] + [(b - a) / T for a, b in zip(y, y[1:])]


def control(t, r, y, state, params):
    v = (y - state[0]) / params["T"]
    return params["Kp"] * (r.position - y) + params["Kd"] * (r.velocity - v) + params["Kv"] * r.velocity, [y]
