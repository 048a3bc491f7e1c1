"""What people do with a bus: watch, record, replay, decode, offer it to other programs, and stop everything on it."""
