"""First-order velocity lag and an integrator: τ dv/dt + v = K u."""

params = {"tau": 0.009943, "K": 1.764}
initial_state = [0.0, 0.0]  # position (mm), velocity (mm/s)


def derivatives(t, x, u, params):
    return [x[1], (params["K"] * u[0] - x[1]) / params["tau"]]
