"""What goes wrong in a sandbox: by the submission's doing, or by the computer's."""

from __future__ import annotations

from rds.core.errors import RdsError
from rds.grading.grade import Status


class SubmissionError(RdsError):
    """The submission's own doing. `status` is what a grade records, `reason` a sentence for its author.

    `printed` is what it printed where it could not be loaded: then there is no subject to ask. `may_be_foreign` is set
    where its process was ended by SIGKILL: by itself, or by somebody who looked for memory or for another program.
    """

    def __init__(self, status: Status, reason: str, may_be_foreign: bool = False):
        self.status = status
        self.reason = reason
        self.printed = ""
        self.may_be_foreign = may_be_foreign
        super().__init__(f"{status}: {reason}")


class SandboxError(RdsError):
    """The sandbox cannot be had, or broke by no fault of a submission: to be graded again, never a zero."""
