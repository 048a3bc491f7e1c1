"""The machine panel: modules, their configuration and tuning, and what goes over their bus."""
