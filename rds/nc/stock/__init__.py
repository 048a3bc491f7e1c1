"""The cut of a program, or of a run: the stock as a height field, and what the tools take away from it."""
