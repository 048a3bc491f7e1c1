"""The grading panel: a batch's progress, its results, and gradebooks."""
