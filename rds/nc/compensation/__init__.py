"""Cutter radius compensation, and the proof that the cutter's edge keeps to the programmed contour."""
