"""Your controller. Try it with `rds grade self FOLDER my_controller.py`."""

params = {"Kp": 0.0}  # gains of your own


def control(t, r, y, state, params):
    """One sample: time t (s), reference r.position (mm), r.velocity (mm/s), r.acceleration (mm/s²), measured y (mm).

    Returns the voltage (V) and the state for the next sample.
    """
    return params["Kp"] * (r.position - y), state
