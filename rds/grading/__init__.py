"""Batch grading: assignments, a sandbox for submissions, criteria, batches, feedback and gradebooks."""
