"""The fixtures of the bus's own tests: a runtime directory for each test, nothing left open, hubs and processes."""

from bus.conftest import hub, nothing_left_open, open_bus, program, runtime_directory, start

__all__ = ["hub", "nothing_left_open", "open_bus", "program", "runtime_directory", "start"]
