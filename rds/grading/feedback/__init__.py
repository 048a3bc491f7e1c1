"""Pages that come of grading: one for each student, one for the class."""
