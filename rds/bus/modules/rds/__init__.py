"""The rds dialect: cyclic frames, one command for all axis modules and one answer of each in every sample period."""
