"""The modules behind a bus: what all dialects share, and a folder for each dialect (`dialects.py` is their table)."""
