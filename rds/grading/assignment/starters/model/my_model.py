"""Your model. Try it with `rds grade self FOLDER my_model.py`."""

params = {}
initial_state = [0.0, 0.0]  # position (mm), velocity (mm/s)


def derivatives(t, x, u, params):
    """The derivatives of the state x for the voltage u[0] (V)."""
    return [x[1], 0.0]
