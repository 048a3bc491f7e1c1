"""The sampled loop and what is in it: controllers, signals, part programs, live values."""
