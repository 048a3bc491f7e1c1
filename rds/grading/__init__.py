"""Batch grading: assignments, a sandbox for submissions, criteria, batches, feedback and gradebooks."""

from rds.core.face import face

__getattr__, __dir__ = face(
    __name__,
    {
        "Pool": "sandbox.pool",
        "ExportOptions": "exports.exported",
        "available": "sandbox.requirements",
        "check_assignment": "assignment.check_assignment",
        "export": "exports.export",
        "grade_with_runs": "batch.grade_one",
        "hand_out": "assignment.hand_out",
        "read_assignment": "assignment.assignment",
        "run_batch": "batch.run",
        "self_check": "assignment.self_check",
    },
)
