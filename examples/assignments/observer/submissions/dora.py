# a fast observer is a good observer
from math import exp

tau, K, T = 9.943e-3, 1.764, 0.001
params = {"g1": 4.0e6, "g2": 4000.0}
initial_state = [0.0]


def observer_gains(tau, K, pole, T):
    a22 = exp(-T / tau)
    a12 = tau * (1 - a22)
    F = exp(pole * T)
    L = (a22 - F) / a12
    return [L, F, (F - 1) * L, K * (1 - a22) - L * K * (T - a12)]


L, F, G, H = observer_gains(tau, K, -5000.0, T)
params.update(L=L, F=F, G=G, H=H, tau=tau, K=K)


def control(t, r, y, state, params):
    z = state[0]
    v = params["L"] * y + z
    a = r.acceleration + params["g1"] * (r.position - y) + params["g2"] * (r.velocity - v)
    u = (params["tau"] * a + r.velocity) / params["K"]
    return u, [params["F"] * z + params["G"] * y + params["H"] * u]
