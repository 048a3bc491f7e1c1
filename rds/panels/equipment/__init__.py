"""The panels of equipment model and equipment control: one system, its run, and what came of it."""
