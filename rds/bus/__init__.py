"""CAN: the built-in bus, the frames, virtual axis modules, and the host's drivers."""
