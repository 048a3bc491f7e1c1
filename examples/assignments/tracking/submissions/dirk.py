# more gain is better, isn't it?
params = {"Kp": 2000.0}


def control(t, r, y, state, params):
    return params["Kp"] * (r.position - y), state
