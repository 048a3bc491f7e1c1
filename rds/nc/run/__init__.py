"""Part programs on the machine's axes: prepared, run in every mode, and judged by what was measured."""
