"""Colours of all pictures: those of Okabe and Ito, "Color Universal Design" (2008).

They are told apart with any kind of colour vision.
"""

from __future__ import annotations

BLACK, ORANGE, SKY, GREEN, BLUE, VERMILLION, PURPLE = (
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#0072B2",
    "#D55E00",
    "#CC79A7",
)
GREY = "#8A8A8A"
OCHRE = "#B87400"  # the orange, darker: a thin line of it can be seen on white

# One colour for each quantity of a run, on every plot, on the page and in print.
QUANTITIES = {
    "reference": GREY,
    "measured": BLUE,
    "modelled": VERMILLION,
    "simulated": GREEN,
    "error": PURPLE,
    "contour error": PURPLE,
    "voltage": OCHRE,
    "target": OCHRE,
}
