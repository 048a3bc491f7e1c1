"""One sitting without widgets: choices, long work, runs, the machine. Panels are thin over it."""

from rds.panels.session.session import Session

__all__ = ["Session"]
