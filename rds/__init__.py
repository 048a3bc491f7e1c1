"""RDS: rapid development system for machine-tool axes."""
