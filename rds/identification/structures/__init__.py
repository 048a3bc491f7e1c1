"""Model structures: which parameters a model has, and how it answers a log's commands."""
