# the law of the lecture, all in metres as in physics
tau, K = 9.943e-3, 1.764
params = {"Kp": 30.0, "Kv": 1 / K}


def control(t, r, y, state, params):
    e = (r.position - y) / 1000.0  # m
    v = r.velocity / 1000.0  # m/s
    return params["Kp"] * e + params["Kv"] * v, state
