"""What goes wrong in a sandbox: by the submission's doing, or by the computer's."""

from __future__ import annotations

from rds.core.errors import RdsError
from rds.grading.grade import Status


class SubmissionError(RdsError):
    """The submission's own doing. `status` is what a grade records, `reason` a sentence for its author.

    `printed` is what it printed where it could not be loaded: then there is no subject to ask.
    """

    def __init__(self, status: Status, reason: str):
        self.status = status
        self.reason = reason
        self.printed = ""
        super().__init__(f"{status}: {reason}")


class SandboxError(RdsError):
    """The sandbox cannot be had, or broke by no fault of a submission: to be graded again, never a zero."""
