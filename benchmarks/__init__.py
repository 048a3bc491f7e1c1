"""How fast RDS is, beside others in the same run: `python -m benchmarks`."""
