"""Model structures, and their parameters from logs: estimates with their uncertainty, model files, designs."""
