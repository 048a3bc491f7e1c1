"""What graders say after a batch: points, comments, excuses, extensions; attempts, regrading, and who changed what."""
