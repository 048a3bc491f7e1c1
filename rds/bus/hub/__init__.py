"""The built-in bus: a hub process for each channel, the python-can interface to it, and faults on demand."""
