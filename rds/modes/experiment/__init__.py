"""Experiments: from the words of a user to a run and its result."""

from rds.modes.experiment.experiment import Experiment

__all__ = ["Experiment"]
