"""Cutting forces: their law and its coefficients, cutting parameters, and what they load the joints with."""
