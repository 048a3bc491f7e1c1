"""What was handed in, found and read without running, extracting or trusting any of it."""

from rds.grading.intake.submissions import HandedIn, Intake, collect

__all__ = ["HandedIn", "Intake", "collect"]
