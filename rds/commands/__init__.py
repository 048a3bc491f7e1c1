"""Groups of commands, one module each; rds/cli.py puts them together."""
