"""The language of part programs: RS274NGC as LinuxCNC documents it, from text to canonical calls."""
