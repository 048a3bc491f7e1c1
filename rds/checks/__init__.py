"""Conformance checks: whether a student's controller, model or interpolator keeps its fixed interface.

Panels, the command line, the tests and the grader use the same ones. `check_file` runs the student's code in a process
of its own, the others in this one.
"""

from rds.checks.controller import check_controller
from rds.checks.dispatch import check
from rds.checks.file import check_file
from rds.checks.interpolator import check_interpolator
from rds.checks.model import check_model
from rds.checks.report import CheckReport, Fault, FileReport, Timing

__all__ = [
    "CheckReport",
    "Fault",
    "FileReport",
    "Timing",
    "check",
    "check_controller",
    "check_file",
    "check_interpolator",
    "check_model",
]
