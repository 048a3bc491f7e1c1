"""A disturbance observer: position, velocity and the voltage that friction and forces take, estimated each sample."""

from math import exp

tau, K, T = 9.943e-3, 1.764, 0.001  # s, (mm/s)/V, s
WIDTH = 60.0  # 1/s: the observer's three poles are at -WIDTH

params = {"g1": 900.0, "g2": 60.0 - 1.0 / tau, "tau": tau, "K": K, "T": T, "limit": 10.0}

initial_state = [0.0, 0.0, 0.0, False]  # position (mm), velocity (mm/s), disturbance (V), whether a sample was taken


def held_axis(tau, K, T):
    """Of x+ = x + a12 v + b1 u, v+ = a22 v + b2 u."""
    a22 = exp(-T / tau)
    a12 = tau * (1.0 - a22)
    return a12, a22, K * (T - a12), K * (1.0 - a22)


def observer_gains(tau, K, pole, T):
    """L, F, G, H of the reduced-order observer with its pole at `pole` (1/s)."""
    a12, a22, b1, b2 = held_axis(tau, K, T)
    F = exp(pole * T)
    L = (a22 - F) / a12
    return [L, F, (F - 1.0) * L, b2 - L * b1]


def estimated_velocity(y, u, tau, K, pole, T):
    """Velocities (mm/s) at the samples of positions `y` (mm) and voltages `u` (V); at rest before the first."""
    L, F, G, H = observer_gains(tau, K, pole, T)
    z = -L * y[0]
    velocities = []
    for position, voltage in zip(y, u, strict=True):
        velocities.append(L * position + z)
        z = F * z + G * position + H * voltage
    return velocities


def corrections(tau, K, T, width):
    """Of position, velocity and disturbance for each mm of surprise: all three poles at exp(-width T)."""
    a12, a22, b1, b2 = held_axis(tau, K, T)
    # A = [1 a12 b1; 0 a22 b2; 0 0 1], C = [1 0 0]; det(zI - A + l C) = (z - p)^3, compared by powers of z - 1
    q, s = 1.0 - exp(-width * T), 1.0 - a22
    l1 = 3.0 * q - s
    l3 = q**3 / (a12 * b2 + b1 * s)
    l2 = (3.0 * q**2 - s * l1 - b1 * l3) / a12
    return l1, l2, l3


params["held"] = held_axis(tau, K, T)
params["corrections"] = corrections(tau, K, T, WIDTH)


def control(t, r, y, state, params):
    x, v, d, started = state
    if not started:
        x = y
    a12, a22, b1, b2 = params["held"]
    l1, l2, l3 = params["corrections"]
    wanted = r.acceleration + params["g1"] * (r.position - x) + params["g2"] * (r.velocity - v)
    u = (params["tau"] * wanted + r.velocity) / params["K"] - d
    u = min(max(u, -params["limit"]), params["limit"])
    surprise = y - x
    x, v = x + a12 * v + b1 * (u + d) + l1 * surprise, a22 * v + b2 * (u + d) + l2 * surprise
    return u, [x, v, d + l3 * surprise, True]
