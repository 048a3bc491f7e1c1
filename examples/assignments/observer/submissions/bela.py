"""The law of the paper with its reduced-order observer, its pole slowed down because of the noise."""

from math import exp

params = {"tau": 9.943e-3, "K": 1.764, "T": 0.001, "pole": -150.0, "g1": 1000.0, "g2": 55.0 - 1 / 9.943e-3}
initial_state = [None]


def observer_gains(tau, K, pole, T):
    a22 = exp(-T / tau)
    a12 = tau * (1 - a22)
    F = exp(pole * T)
    L = (a22 - F) / a12
    return [L, F, (F - 1) * L, K * (1 - a22) - L * K * (T - a12)]


def estimated_velocity(y, u, tau, K, pole, T):
    L, F, G, H = observer_gains(tau, K, pole, T)
    z = -L * y[0]
    result = []
    for a, b in zip(y, u):
        result.append(L * a + z)
        z = F * z + G * a + H * b
    return result


params["observer"] = observer_gains(params["tau"], params["K"], params["pole"], params["T"])


def control(t, r, y, state, params):
    L, F, G, H = params["observer"]
    z = -L * y if state[0] is None else state[0]
    v = L * y + z
    a = r.acceleration + params["g1"] * (r.position - y) + params["g2"] * (r.velocity - v)
    u = (params["tau"] * a + r.velocity) / params["K"]
    u = max(min(u, 10.0), -10.0)
    return u, [F * z + G * y + H * u]
