"""CAN: the built-in bus, the frames, virtual axis modules, and the host's drivers."""

from rds.bus.mf4_later import put_off_mf4

put_off_mf4()
