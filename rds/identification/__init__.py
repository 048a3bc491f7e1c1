"""Logged data in; parameters, validation and verdicts out."""
