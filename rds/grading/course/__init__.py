"""A course: who is in it, in which section and group, with which extensions and late days."""
