"""The serial fieldbus of dcs-thesis: many units on one EIA-485 line, two protocols, steppers and servo motors."""
