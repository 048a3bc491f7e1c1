"""Your controller for the X axis. Hand in this file, under this name."""

params = {
    "Kp": 0.0,  # V/mm: choose it
    "T": 0.001,  # s, the sample period
}

initial_state = []  # what you want to remember from one sample to the next


def control(t, r, y, state, params):
    """One sample: time t (s), reference r (mm, mm/s, mm/s²), measured position y (mm); voltage (V) and next state."""
    error = r.position - y
    voltage = params["Kp"] * error
    return voltage, state
