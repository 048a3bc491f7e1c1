"""Where submitted code runs: a process of its own that can reach nothing, and answers one sample at a time."""
