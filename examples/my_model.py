"""The X axis without friction: tau dv/dt + v = K u."""

params = {
    "tau": 9.943e-3,  # s
    "K": 1.764,  # (mm/s)/V
}

initial_state = [0.0, 0.0]  # position (mm), velocity (mm/s)


def derivatives(t, x, u, params):
    velocity, voltage = x[1], u[0]
    acceleration = (params["K"] * voltage - velocity) / params["tau"]
    return [velocity, acceleration]
