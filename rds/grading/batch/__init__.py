"""A folder of submissions graded with one command: parallel, resumable, one row for each whatever happened to it."""
