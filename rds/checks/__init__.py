"""Conformance checks: whether a student's controller, model or interpolator keeps its fixed interface.

Panels, the command line, the tests and the grader use the same ones.
"""

from rds.checks.controller import check_controller
from rds.checks.report import CheckReport, Fault, FileReport, Timing

__all__ = ["CheckReport", "Fault", "FileReport", "Timing", "check_controller"]
