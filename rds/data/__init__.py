"""Logs that come with the package, made by our own modules in system test mode: see `rds.logs.shipped`."""
