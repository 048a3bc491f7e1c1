"""Part programs and experiments that other programs on this computer start (docs/jobs.md)."""
