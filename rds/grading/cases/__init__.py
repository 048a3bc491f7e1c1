"""Cases: what a submission is run on. One file per kind of submission."""

from rds.grading.cases.case import Case, CaseRun, Submitted

__all__ = ["Case", "CaseRun", "Submitted"]
