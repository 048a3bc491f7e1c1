"""Grading in a Linux container: for Windows and macOS, and for whoever wants one more wall."""
