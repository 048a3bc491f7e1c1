"""PD control with a filtered derivative and velocity feedforward, for the X axis of the mini CNC."""

params = {
    "Kp": 30.0,  # V/mm
    "Kd": 0.3,  # V/(mm/s)
    "Kv": 0.567,  # V/(mm/s): 1/K, the voltage that a steady speed takes
    "filter": 0.004,  # s, time constant of the derivative's filter
    "T": 0.001,  # s, the experiment's sample period
}

initial_state = [0.0, 0.0]  # last error (mm), filtered derivative of the error (mm/s)


def control(t, r, y, state, params):
    last_error, slope = state
    error = r.position - y
    share = params["T"] / (params["filter"] + params["T"])
    slope = slope + share * ((error - last_error) / params["T"] - slope)
    voltage = params["Kp"] * error + params["Kd"] * slope + params["Kv"] * r.velocity
    return voltage, [error, slope]
