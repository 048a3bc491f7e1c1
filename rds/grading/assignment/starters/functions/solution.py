"""A first-order lag rises from 10 % to 90 % in τ ln 9."""

from math import log


def rise_time(tau):
    return tau * log(9.0)
