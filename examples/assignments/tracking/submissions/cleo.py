params = {"Kp": 25.0}


def control(t, r, y, state, params):
    return params["Kp"] * (r.position - y), state
