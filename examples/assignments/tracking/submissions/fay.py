# My own controller, Fay
import math

params = {
    "gain": 28.0,
    "rate": 0.31,
    "speed": 1 / 1.764,
    "accel": 9.943e-3 / 1.764,
    "plus": 0.539 / 1.764,
    "minus": 0.222 / 1.764,
    "lag": 0.004,
    "step": 0.001,
}

initial_state = [0.0, 0.0, 0]


def stick(velocity, q):
    if velocity >= 0:
        return q["plus"] * math.tanh(velocity / 0.25)
    return q["minus"] * math.tanh(velocity / 0.25)


def control(time, ref, pos, memory, q):
    before, rate, count = memory
    err = ref.position - pos
    if count == 0:
        before = err
    share = q["step"] / (q["lag"] + q["step"])
    rate += share * ((err - before) / q["step"] - rate)
    volts = q["gain"] * err + q["rate"] * rate
    volts += q["speed"] * ref.velocity + q["accel"] * ref.acceleration + stick(ref.velocity, q)
    return volts, [err, rate, count + 1]
