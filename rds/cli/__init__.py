"""Groups of commands, one module each; rds/cli/main.py puts them together."""
