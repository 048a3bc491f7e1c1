params = {"Kp": 20.0, "Kd": 0.2, "Kv": 0.55, "filter": 0.005, "T": 0.001}
initial_state = [0.0, 0.0]


def control(t, r, y, state, params):
    e = r.position - y
    a = params["T"] / (params["filter"] + params["T"])
    d = state[1] + a * ((e - state[0]) / params["T"] - state[1])
    return params["Kp"] * e + params["Kd"] * d + params["Kv"] * r.velocity, [e, d]
