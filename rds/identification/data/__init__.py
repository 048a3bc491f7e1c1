"""Logs that come with the package, made by its own modules in system test mode; `rds.identification.logs.shipped`."""
