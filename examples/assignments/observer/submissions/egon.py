# tau in ms, T in ms, so that the numbers are nice
from math import exp

params = {"tau": 9.943, "K": 1.764, "T": 1.0, "g1": 1600.0, "g2": 64.0 - 1 / 9.943}
initial_state = [0.0]


def observer_gains(tau, K, pole, T):
    tau, T = 1000 * tau, 1000 * T
    a22 = exp(-T / tau)
    a12 = tau * (1 - a22)
    F = exp(pole * T / 1000)
    L = (a22 - F) / a12
    return [L, F, (F - 1) * L, K * (1 - a22) - L * K * (T - a12)]


def control(t, r, y, state, params):
    v = (y - state[0]) / params["T"]
    a = r.acceleration + params["g1"] * (r.position - y) + params["g2"] * (r.velocity - v)
    return (params["tau"] * a + r.velocity) / params["K"], [y]
