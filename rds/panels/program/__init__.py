"""The program panel: part programs written, checked, seen and run."""
