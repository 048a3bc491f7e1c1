"""Your functions. Try them with `rds grade self FOLDER my_functions.py`."""


def rise_time(tau):
    """The time (s) in which a first-order lag of time constant tau (s) rises from 10 % to 90 %."""
    return 0.0
