"""The assignment: its files, how it is handed out, and how it is tried before anything is graded."""
